//! The volume of absorptions that is aligned with the sun's light: \[CL\], section 3.1, equation 1.

use glam::{DVec3, Vec3};
use half::f16;
use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mode, Volume};

use super::error::LightError;
use super::options::{LightOptions, Sun};
use super::scene::OpticalScene;

/// The light's own space: slices of the volume follow one another from the sun on.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightFrame {
    /// Across the light.
    pub(super) across: [DVec3; 2],
    /// Against the light.
    pub(super) to_sun: DVec3,
}

impl LightFrame {
    pub(super) fn new(sun: &Sun) -> Self {
        let (sin_azimuth, cos_azimuth) = sun.azimuth.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = sun.elevation.to_radians().sin_cos();
        let to_sun = DVec3::new(sin_azimuth * cos_elevation, -cos_azimuth * cos_elevation, sin_elevation);
        let first = DVec3::new(cos_azimuth, sin_azimuth, 0.0);
        // Right-handed with the direction in which light travels, so that nothing is mirrored.
        Self { across: [first, (-to_sun).cross(first)], to_sun }
    }

    /// A point in the light's space: across, and along the light.
    pub(super) fn place(&self, point: DVec3) -> DVec3 {
        DVec3::new(point.dot(self.across[0]), point.dot(self.across[1]), -point.dot(self.to_sun))
    }
}

/// The sunlight's colour, and that from everywhere.
pub(super) const SUNLIGHT: Vec3 = Vec3::new(1.06, 1.0, 0.90);
pub(super) const AMBIENT: Vec3 = Vec3::new(0.90, 0.98, 1.10);

/// Light from an opaque surface whose normal points towards the viewer. Sheets let light through to their other side.
/// `shaders/shadow.wgsl` is the same for the GPU.
pub(super) fn surface_light(
    color: Vec3,
    normal: Vec3,
    sheet: bool,
    shadow: Vec3,
    frame: &LightFrame,
    sun: &Sun,
) -> Vec3 {
    #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
    let ambient = sun.ambient as f32;
    let towards = normal.dot(frame.to_sun.as_vec3());
    let facing = if sheet { towards.abs() } else { towards.max(0.0) };
    let from_everywhere = AMBIENT * ambient * (0.75 + 0.25 * normal.z);
    color * (from_everywhere + SUNLIGHT * (1.0 - ambient) * facing * shadow)
}

/// Optical depths of voxels along the light, before they are summed.
pub(super) struct ShadowVolume {
    pub(super) dims: [u32; 3],
    /// The low corner in the light's space.
    pub(super) origin: DVec3,
    pub(super) voxel: f64,
    /// Red, green, blue and nothing for each voxel, x fastest.
    pub(super) texels: Vec<[f16; 4]>,
}

/// Empty voxels round the object. The first slice must be empty for the sums to begin at 0.
const MARGIN: u32 = 2;

impl ShadowVolume {
    /// Voxelizes a scene in the light's space: solid media by parity along the light, sheets where the light through the
    /// middle of a column meets them. Both are exact.
    pub(super) fn new(scene: &OpticalScene, frame: &LightFrame, options: &LightOptions) -> Result<Self, LightError> {
        let mut mesh = scene.mesh.clone();
        mesh.normals = None;
        mesh.positions.iter_mut().for_each(|p| *p = frame.place(DVec3::from_array(*p)).to_array());
        let bounds = mesh.bounds().ok_or(LightError::Empty)?;
        let inner = Grid::fit(&bounds, options.resolution)?;
        let voxel = inner.voxel_size()[0];
        let origin = DVec3::from_array(inner.origin()) - f64::from(MARGIN) * voxel;
        let dims = inner.dims().map(|n| n + 2 * MARGIN);
        let grid = Grid::new(origin.to_array(), [voxel; 3], dims)?;
        let [nx, ny, _] = dims.map(|n| n as usize);
        let count = usize::try_from(grid.voxel_count()).unwrap_or(usize::MAX);
        let mut texels = vec![[f16::ZERO; 4]; count];
        let mut volume = Volume::new(grid)?;
        for (medium, optics) in scene.media.iter().enumerate() {
            let sheet = scene.sheets[medium];
            let mut part = scene.part(|of| of == medium);
            part.positions.clone_from(&mesh.positions);
            let lattice = LatticeMesh::snap(&part, &grid).map_err(trixel::Error::from)?;
            let job = Job::new(grid, if sheet { Mode::Sliced } else { Mode::Solid });
            CpuBackend::default().voxelize(&lattice, &job, &mut volume)?;
            let thickness = if sheet { options.sheet_thickness } else { voxel };
            #[expect(clippy::cast_possible_truncation, reason = "saturated at what half floats hold")]
            let depth = optics.absorption.map(|a| (a * thickness).min(1000.0) as f32);
            for [x, y, z] in volume.iter() {
                let index = (z as usize * ny + y as usize) * nx + x as usize;
                for (sum, depth) in texels[index].iter_mut().zip(depth) {
                    *sum = f16::from_f32((sum.to_f32() + depth).min(4000.0));
                }
            }
        }
        Ok(Self { dims, origin, voxel, texels })
    }
}
