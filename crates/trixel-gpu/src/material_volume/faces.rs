//! What shaders know of a framed mesh's triangles beside their lattice positions: `Face` of `resolve_claims.wgsl`.

use bytemuck::{Pod, Zeroable};
use trixel::{AlphaMode, FramedMesh, Material, Mesh};

use super::medium::Media;

/// A corner.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Corner {
    position: [f32; 2],
    depth: f32,
    normal: [f32; 3],
    color: [u32; 2],
}

/// A triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Face {
    corners: [Corner; 3],
    medium: u32,
}

/// Two numbers from 0 to 1 in a word, as `unpack2x16unorm` takes them.
fn pack(low: f32, high: f32) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let steps = |value: f32| (value.clamp(0.0, 1.0) * 65535.0).round() as u32;
    steps(low) | steps(high) << 16
}

/// The colour of a material at a corner: linear, with its opacity.
fn shade(material: Option<&Material>, vertex: [f32; 4]) -> [u32; 2] {
    let base = material.map_or([1.0; 4], |material| material.base_color);
    let blends = material.is_some_and(|material| material.alpha_mode == AlphaMode::Blend);
    let [r, g, b, a] = std::array::from_fn(|i| base[i] * vertex[i]);
    [pack(r, g), pack(b, if blends { a } else { 1.0 })]
}

/// The triangles of a framed mesh, in its order. Media are numbered as materials are, the other one last.
pub(super) fn faces(framed: &FramedMesh, media: &Media) -> Vec<Face> {
    let FramedMesh { mesh, depths, .. } = framed;
    let other = media.of_materials.len();
    let face = |(index, vertices): (usize, &[u32; 3])| {
        let material = mesh.triangle_materials.get(index).copied().unwrap_or(Mesh::NO_MATERIAL) as usize;
        let normals = mesh.normals.as_ref().and_then(|normals| normals.on_triangle(index, *vertices));
        let colors = mesh.colors.as_ref().and_then(|colors| colors.on_triangle(index, *vertices));
        let corners = std::array::from_fn(|i| {
            let vertex = vertices[i] as usize;
            let [x, y, _] = mesh.positions.get(vertex).copied().unwrap_or_default();
            #[expect(clippy::cast_possible_truncation, reason = "shaders count in f32")]
            let [x, y, depth] = [x, y, depths.get(vertex).copied().unwrap_or(1.0)].map(|value| value as f32);
            Corner {
                position: [x, y],
                depth,
                normal: normals.map_or([0.0; 3], |normals| normals[i]),
                color: shade(mesh.materials.get(material), colors.map_or([1.0; 4], |colors| colors[i])),
            }
        });
        Face { corners, medium: u32::try_from(material.min(other)).unwrap_or(u32::MAX) }
    };
    mesh.triangles.iter().enumerate().map(face).collect()
}
