//! Volumes to write and read back.
#![allow(dead_code, reason = "each test uses a part")]

use trixel::{Grid, Volume};

/// Away from the origin; coordinates that `f32` holds exactly, so that every format can be compared without tolerance.
pub(crate) const ORIGIN: [f64; 3] = [-3.5, 10.25, 1e3];
pub(crate) const CUBIC: [f64; 3] = [0.25; 3];
pub(crate) const ANISOTROPIC: [f64; 3] = [0.25, 0.5, 1.5];

/// A volume of the voxels for which `set` holds.
pub(crate) fn volume(dims: [u32; 3], voxel_size: [f64; 3], set: impl Fn([u32; 3]) -> bool) -> Volume {
    let mut volume = Volume::new(Grid::new(ORIGIN, voxel_size, dims).unwrap()).unwrap();
    for x in 0..dims[0] {
        for y in 0..dims[1] {
            for z in 0..dims[2] {
                if set([x, y, z]) {
                    volume.set([x, y, z]);
                }
            }
        }
    }
    volume
}

/// Whether a pseudo-random half of all voxels has this one.
pub(crate) fn noise([x, y, z]: [u32; 3]) -> bool {
    let mut mixed = x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791);
    mixed ^= mixed >> 15;
    mixed.wrapping_mul(2_654_435_761) >> 31 == 1
}

/// A ball that fills the grid, without its core, and off-centre so that no axis can be taken for another.
pub(crate) fn shell(dims: [u32; 3]) -> impl Fn([u32; 3]) -> bool {
    move |voxel| {
        let distance: f64 = (0..3)
            .map(|i| {
                let half = f64::from(dims[i]) / 2.0;
                ((f64::from(voxel[i]) + 0.5 - half * (0.8 + 0.1 * f64::from(u32::try_from(i).unwrap()))) / half).powi(2)
            })
            .sum();
        (0.2..0.7).contains(&distance)
    }
}

/// Named volumes that straddle words (64) and models (256), and the extremes.
pub(crate) fn samples(voxel_size: [f64; 3]) -> Vec<(&'static str, Volume)> {
    let make = |dims: [u32; 3], set: &dyn Fn([u32; 3]) -> bool| volume(dims, voxel_size, set);
    vec![
        ("noise", make([7, 70, 131], &noise)),
        ("shell", make([70, 131, 65], &shell([70, 131, 65]))),
        ("wide", make([259, 3, 64], &|v| noise(v.map(|c| c / 5)))),
        ("tall", make([5, 66, 257], &|v| v[2] > 250 || v == [0, 0, 0])),
        ("one", make([1, 1, 1], &|_| true)),
        ("empty", make([7, 70, 131], &|_| false)),
        ("full", make([7, 70, 131], &|_| true)),
        ("corner", make([64, 65, 63], &|v| v == [63, 64, 62])),
    ]
}
