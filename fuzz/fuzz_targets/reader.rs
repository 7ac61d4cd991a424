//! What every target does: reads the bytes as a mesh and holds the reader to its promises.

use trixel_io::read::{MeshFormat, ReadOptions, read_mesh_bytes};

pub fn read(format: MeshFormat, bytes: &[u8]) {
    for attributes in [false, true] {
        let Ok(loaded) = read_mesh_bytes(format, bytes, &ReadOptions { attributes }) else { continue };
        let mesh = loaded.mesh;
        mesh.check().expect("a mesh that was read is sound");
        assert!(!mesh.triangles.is_empty(), "a mesh that was read has triangles");
        assert!(mesh.triangle_materials.is_empty() || mesh.triangle_materials.len() == mesh.triangles.len());
        let corners = [mesh.normals.and_then(|a| a.corners), mesh.colors.and_then(|a| a.corners)];
        let corners = corners.into_iter().flatten().chain(mesh.uvs.into_iter().filter_map(|a| a.corners));
        for corners in corners {
            assert_eq!(corners.len(), mesh.triangles.len(), "corners lie beside the triangles");
        }
    }
}
