//! What every target of a mesh format does: reads the bytes as a mesh and holds the reader to its promises.

use trixel_io::read::{MeshFormat, ReadOptions, read_mesh_bytes};

#[allow(dead_code, reason = "a target with files beside the mesh reads it in its own way")]
pub fn read(format: MeshFormat, bytes: &[u8]) {
    for attributes in [false, true] {
        if let Ok(loaded) = read_mesh_bytes(format, bytes, &ReadOptions { attributes }) {
            check(loaded.mesh);
        }
    }
}

pub fn check(mesh: trixel::Mesh) {
    mesh.check().expect("a mesh that was read is sound");
    assert!(!mesh.triangles.is_empty(), "a mesh that was read has triangles");
    assert!(mesh.triangle_materials.is_empty() || mesh.triangle_materials.len() == mesh.triangles.len());
    let materials = mesh.materials.len();
    let known = |&material: &u32| material == trixel::Mesh::NO_MATERIAL || (material as usize) < materials;
    assert!(mesh.triangle_materials.iter().all(known), "triangles have materials that exist");
    let corners = [mesh.normals.and_then(|a| a.corners), mesh.colors.and_then(|a| a.corners)];
    let corners = corners.into_iter().flatten().chain(mesh.uvs.into_iter().filter_map(|a| a.corners));
    for corners in corners {
        assert_eq!(corners.len(), mesh.triangles.len(), "corners lie beside the triangles");
    }
}
