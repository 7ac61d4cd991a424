//! Meshes that deform: skinned and morphed glTF, posed at any time of an animation.

use std::path::Path;

use trixel::{Bounds, Mesh};

use crate::read::gltf::Rig;
use crate::read::{Loaded, MeshFormat, ReadError, ReadOptions, read_gltf_animated, read_mesh};

/// A mesh and what moves it. Triangles, texture coordinates and materials stay; positions and normals change.
pub struct AnimatedMesh {
    mesh: Mesh,
    rig: Option<Rig>,
    warnings: Vec<String>,
}

/// An animation of an [`AnimatedMesh`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Animation<'a> {
    /// Its name, or empty.
    pub name: &'a str,
    /// How long it is.
    pub seconds: f64,
}

/// Reads a mesh with its skins, morph targets and animations, which only glTF and GLB have; of other formats the mesh
/// alone.
///
/// # Errors
/// As [`read_mesh`], and where what moves the mesh is damaged.
///
/// ```
/// use trixel_io::animation::read_animated;
/// use trixel_io::read::ReadOptions;
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("triangle.off");
/// std::fs::write(&path, "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")?;
/// let model = read_animated(&path, &ReadOptions::default())?;
/// assert!(model.animations().is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_animated(path: &Path, options: &ReadOptions) -> Result<AnimatedMesh, ReadError> {
    match MeshFormat::from_path(path) {
        Some(MeshFormat::Gltf | MeshFormat::Glb) => {
            let (Loaded { mesh, warnings }, rig) = read_gltf_animated(path, options)?;
            Ok(AnimatedMesh { mesh, rig: Some(rig), warnings })
        }
        _ => read_mesh(path, options).map(AnimatedMesh::from),
    }
}

impl From<Loaded> for AnimatedMesh {
    /// A mesh that does not move.
    fn from(Loaded { mesh, warnings }: Loaded) -> Self {
        Self { mesh, rig: None, warnings }
    }
}

impl AnimatedMesh {
    /// Poses of an animation that [`AnimatedMesh::bounds`] looks at.
    const LOOKS: u32 = 64;

    /// The animations, in the file's order.
    #[must_use]
    pub fn animations(&self) -> Vec<Animation<'_>> {
        let clips = self.rig.iter().flat_map(|rig| &rig.clips);
        clips.map(|clip| Animation { name: &clip.name, seconds: clip.seconds }).collect()
    }

    /// The mesh at rest.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// What was skipped or repaired, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Moves the positions and normals of `mesh`, a copy of [`AnimatedMesh::mesh`], to where they are `seconds` into
    /// animation `animation`; one that does not exist changes nothing.
    pub fn pose(&self, animation: usize, seconds: f64, mesh: &mut Mesh) {
        if let Some((rig, clip)) = self.rig.as_ref().and_then(|rig| Some((rig, rig.clips.get(animation)?))) {
            rig.pose(Some(clip), seconds, mesh);
        }
    }

    /// A box round the mesh at 64 even times of an animation.
    #[must_use]
    pub fn bounds(&self, animation: usize) -> Option<Bounds> {
        let seconds = self.animations().get(animation).map_or(0.0, |animation| animation.seconds);
        let mut mesh = self.mesh.clone();
        let looks = if seconds > 0.0 { Self::LOOKS } else { 1 };
        (0..looks)
            .filter_map(|look| {
                self.pose(animation, seconds * f64::from(look) / f64::from(looks), &mut mesh);
                mesh.bounds()
            })
            .reduce(|a, b| Bounds {
                min: std::array::from_fn(|axis| a.min[axis].min(b.min[axis])),
                max: std::array::from_fn(|axis| a.max[axis].max(b.max[axis])),
            })
    }
}
