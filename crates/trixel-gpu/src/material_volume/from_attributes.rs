//! A material volume from any strategy's voxels and the attributes of a mesh.

use trixel::attributes::{AttributeKind, Values, VoxelAttributes};
use trixel::{Frame, Mesh, Rank, Volume};

use super::MaterialVolume;
use super::encoding::{Precision, VoxelMaterial};
use super::medium::Media;
use crate::error::GpuError;
use crate::gpu::Gpu;

/// The linear light of an 8-bit sRGB value.
fn linear(encoded: u8) -> f32 {
    let c = f32::from(encoded) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

impl MaterialVolume {
    /// The volume of voxels that any mode, backend and strategy made, with the attributes of these voxels: colour, normal and
    /// material, where they were asked for. Voxels that an alpha test cut out stay empty; those of a solid that no triangle
    /// reaches are inside, with the medium of no material. For a frame that is no plain grid,
    /// voxelize and describe [`Frame::mesh`]'s mesh in [`Frame::grid`].
    ///
    /// # Errors
    /// When the voxels are not in the frame's number or the attributes are not of them, a side of the frame exceeds the
    /// device's 3D textures, or memory runs out.
    pub fn from_attributes(
        gpu: &Gpu,
        frame: Frame,
        precision: Precision,
        volume: &Volume,
        attributes: &VoxelAttributes,
        media: &Media,
    ) -> Result<Self, GpuError> {
        let rank = Rank::new(volume);
        if volume.grid().dims() != frame.dims() || rank.count() != attributes.voxels() as u64 {
            return Err(GpuError::GridMismatch);
        }
        let normals = match attributes.get(AttributeKind::Normal).or(attributes.get(AttributeKind::GeometricNormal)) {
            Some(Values::F32x3(normals)) => normals.as_slice(),
            _ => &[],
        };
        let materials = match attributes.get(AttributeKind::Material) {
            Some(Values::U32(materials)) => materials.as_slice(),
            _ => &[],
        };
        Self::from_voxels(gpu, frame, precision, media, |voxel| {
            let place = rank.of(voxel).and_then(|place| usize::try_from(place).ok());
            let Some(place) = place else { return VoxelMaterial::default() };
            if !attributes.is_covered(place) {
                // Of a solid's voxels, those deep inside have no triangle.
                let inside = !attributes.cuts_out();
                return VoxelMaterial { inside, medium: inside.then_some(media.other), ..VoxelMaterial::default() };
            }
            let row = attributes.row(place).unwrap_or(usize::MAX);
            let [r, g, b, a] = attributes.color(place).unwrap_or([u8::MAX; 4]);
            VoxelMaterial {
                exists: true,
                normal: normals.get(row).copied().unwrap_or_default(),
                color: [linear(r), linear(g), linear(b), f32::from(a) / 255.0],
                medium: Some(media.get(materials.get(row).copied().unwrap_or(Mesh::NO_MATERIAL))),
                inside: false,
            }
        })
    }
}
