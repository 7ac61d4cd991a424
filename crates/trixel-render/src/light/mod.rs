//! Light through voxels: transparent shadow, refraction and transmittance, after H.-H. Chang and Y.-C. Lai, *Real-time
//! GPU-based Voxelization and Applications*, technical report 1688, 2011, section 3 (\[CL\]); and the same by ray tracing the
//! triangles, to compare with.
//!
//! A mesh becomes an [`OpticalScene`]: its materials are [`Medium`]s. [`LightRenderer`] voxelizes and renders it on a GPU,
//! [`Reference`] traces it on the CPU.
//!
//! ```
//! use trixel::UpAxis;
//! use trixel_render::light::{Effect, LightOptions, Medium, OpticalScene, Placement, Reference, Surfaces};
//! let mesh = trixel::scene::build("torus:32")?;
//! let placement = Placement::new(&mesh.bounds().ok_or("empty")?, UpAxis::Z)?;
//! let scene = OpticalScene::new(&mesh, &placement, &Medium::of_mesh(&mesh))?;
//! let options = LightOptions { size: [32, 24], ..LightOptions::default() };
//! let picture = Reference::new(&scene, &options)?.render(Effect::Refraction(Surfaces::Many)).to_picture();
//! assert_eq!((picture.width, picture.height), (32, 24));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bvh;
mod camera;
mod environment;
mod error;
mod gpu;
mod normals;
mod optics;
mod options;
mod radiance;
mod reference;
mod scene;
mod shadow;
mod volume;

pub use camera::{Camera, Orbit};
pub use environment::{Background, Environment, Floor, Panorama};
pub use error::LightError;
pub use gpu::{LightRenderer, Lit, exit_rays};
pub use optics::{reflect, reflectance, refract, transmittance};
pub use options::{Effect, LightOptions, Sun, Surfaces, Thickness};
pub use radiance::{Radiance, psnr};
pub use reference::{ExitRay, Reference};
pub use scene::{Medium, OpticalScene, Placement};
pub use volume::OpticalVolume;
