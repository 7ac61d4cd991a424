use super::*;
use crate::grid::Grid;
use crate::job::Job;
use crate::mesh::Mesh;
use crate::mode::Mode;

fn volume(dims: [u32; 3], set: impl Fn([u32; 3]) -> bool) -> Volume {
    let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
    for x in 0..dims[0] {
        for y in 0..dims[1] {
            for z in 0..dims[2] {
                if set([x, y, z]) {
                    let word = (x * dims[1] + y) as usize * volume.column_words() + (z / 64) as usize;
                    volume.words_mut()[word] |= 1 << (z % 64);
                }
            }
        }
    }
    volume
}

/// A slab from 10 to 80, one column of which lacks its upper side.
fn slab_with_a_hole() -> Volume {
    volume([5, 4, 100], |[x, y, z]| z == 10 || z == 80 && [x, y] != [2, 1])
}

#[test]
fn a_hole_is_repaired_by_both_and_leaks_without() {
    let boundary = slab_with_a_hole();
    let right = volume([5, 4, 100], |[_, _, z]| (10..80).contains(&z));
    for way in [Fill::Xor, Fill::March] {
        let (filled, report) = fill(&boundary, way).unwrap();
        assert!(filled == right, "{way}");
        assert_eq!(report, FillReport { questionable: 1, uncorrected: 0 });
    }
    let (leaking, _) = fill(&boundary, Fill::Parity).unwrap();
    assert_eq!(leaking.count(), right.count() + 20);
    assert!(leaking.get([2, 1, 99]) && !right.get([2, 1, 99]));
}

#[test]
fn a_column_alone_keeps_its_boundary() {
    let boundary = volume([1, 1, 70], |[_, _, z]| z == 66);
    for way in [Fill::Xor, Fill::March] {
        let (filled, report) = fill(&boundary, way).unwrap();
        assert!(filled == boundary, "{way}");
        assert_eq!(report, FillReport { questionable: 1, uncorrected: 1 });
    }
}

#[test]
fn wide_holes_are_repaired_from_their_rim_inwards() {
    // A wedge: the upper side is missing in a square of so many columns.
    let boundary = |hole: u32| {
        let middle = 15;
        volume([31, 31, 64], move |[x, y, z]| {
            let far = x.abs_diff(middle).max(y.abs_diff(middle));
            z == 5 || z == 40 && far > hole
        })
    };
    let right = volume([31, 31, 64], |[_, _, z]| (5..40).contains(&z));
    let (filled, report) = fill(&boundary(7), Fill::Xor).unwrap();
    assert!(filled == right && report == FillReport { questionable: 225, uncorrected: 0 });
    // One column is deeper than the passes reach.
    let (filled, report) = fill(&boundary(8), Fill::Xor).unwrap();
    assert_eq!(report, FillReport { questionable: 289, uncorrected: 1 });
    assert_eq!(filled.count() + 34, right.count());
    // Marching looks at direct neighbours alone: 17 * 17 - 15 * 15 have some.
    let (_, report) = fill(&boundary(8), Fill::March).unwrap();
    assert_eq!(report.uncorrected, 225);
}

#[test]
fn thickness_is_the_mean_of_good_neighbours() {
    // Neighbours from 30 and 33 on, 20 and 31 thick: 31.5 and 25.5 are rounded up. The column itself lacks its first voxel.
    let set = [[30, 50], [58, 58], [33, 64]];
    let boundary = volume([3, 1, 90], |[x, _, z]| set[x as usize].contains(&z));
    let (filled, _) = fill(&boundary, Fill::March).unwrap();
    assert!((0..90).all(|z| filled.get([1, 0, z]) == (32..58).contains(&z)));
    // The border of the grid ends it.
    let boundary = volume([2, 1, 90], |[x, _, z]| if x == 0 { [2, 9, 40, 88].contains(&z) } else { z == 65 });
    let (filled, _) = fill(&boundary, Fill::March).unwrap();
    assert!((0..90).all(|z| filled.get([1, 0, z]) == (2..57).contains(&z)));
    let boundary = volume([2, 1, 90], |[x, _, z]| if x == 0 { (60..70).contains(&z) } else { z == 65 });
    let (filled, _) = fill(&boundary, Fill::March).unwrap();
    assert!((0..90).all(|z| filled.get([1, 0, z]) == (60..65).contains(&z)));
    // Without neighbours that have any, the mean is nothing.
    let boundary = volume([2, 1, 90], |[x, _, z]| x == 1 && z == 65);
    let (filled, report) = fill(&boundary, Fill::March).unwrap();
    assert_eq!((filled.count(), report), (0, FillReport { questionable: 1, uncorrected: 0 }));
}

#[test]
fn a_sphere_is_nearly_right() {
    let mesh = crate::scene::build("sphere").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 70).unwrap();
    let exact = crate::voxelize(&mesh, &Job::new(grid, Mode::Solid)).unwrap();
    let boundary = crate::voxelize(&mesh, &Job::new(grid, Mode::Sliced)).unwrap();
    for way in [Fill::Xor, Fill::March] {
        let (filled, report) = fill(&boundary, way).unwrap();
        assert_eq!(report.uncorrected, 0);
        let wrong = exact.iter().chain(filled.iter()).filter(|v| exact.get(*v) != filled.get(*v));
        let (on, off): (Vec<_>, Vec<_>) = wrong.partition(|v| boundary.get(*v));
        // Where a boundary voxel is on the wrong side of its surface, by half a voxel.
        assert!(on.len() as u64 <= boundary.count());
        assert!(off.len() < 40, "{way}: {} wrong beside the boundary, {report:?}", off.len());
    }
}

#[test]
fn a_balls_thickness_is_its_chord() {
    let mesh = crate::scene::build("sphere").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 101).unwrap();
    let job = Job::new(grid, Mode::Sliced);
    let found = thicknesses(&crate::voxelize(&mesh, &job).unwrap());
    let holed: Vec<_> = mesh.triangles.iter().enumerate().filter(|(i, _)| i % 97 != 0).map(|(_, t)| *t).collect();
    let corrected = thicknesses(&crate::voxelize(&Mesh { triangles: holed, ..mesh }, &job).unwrap());
    assert!(corrected.iter().filter(|thickness| thickness.questionable).count() > 50);
    for x in 0..101_u32 {
        for y in 0..101_u32 {
            let far = (f64::from(x) - 50.0).hypot(f64::from(y) - 50.0);
            if far < 45.0 {
                let chord = 2.0 * (50.5_f64.powi(2) - far.powi(2)).sqrt();
                let place = (x * 101 + y) as usize;
                assert!(!found[place].questionable && (f64::from(found[place].slices) - chord).abs() < 1.5);
                let Thickness { slices, questionable } = corrected[place];
                // A neighbour that lost both of its crossings looks empty, and counts as good.
                assert!(
                    !questionable || (f64::from(slices) - chord).abs() < 0.6 * chord,
                    "{x} {y}: {slices} of {chord}"
                );
            }
        }
    }
}
