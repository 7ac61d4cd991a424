//! What every backend must pass: the definitions as plain code, a zoo of nasty meshes, random triangles, and the suite
//! that compares. Behind the feature `conformance`.
//!
//! A backend gets all of it in a test file of a few lines:
//!
//! ```
//! trixel::conformance_suite!(cpu, trixel::CpuBackend::default());
//! ```

pub mod oracle;
pub mod random;
pub mod suite;
pub mod zoo;

/// Makes a module `$name` with one test per check of [`suite`], each on the backend that `$backend` makes.
#[macro_export]
macro_rules! conformance_suite {
    ($name:ident, $backend:expr) => {
        $crate::conformance_suite!(@tests $name, $backend,
            zoo_conservative zoo_thin zoo_solid zoo_sliced
            random_small random_on_lattice random_degenerate random_large random_huge random_elongated random_far_outside
            random_in_cells random_in_cells_beside_far
            sliced_overlap solid_closed_soup huge_dims
            grid_is_overwritten other_grid_is_refused
            rival_cuda_voxelizer_64_aligned_cube rival_fluidx3d_323_lattice_terrain rival_open3d_6111_interior
            rival_voxsurf_10_cube rival_cinolib_189_faces_on_planes rival_cuda_voxelizer_10_beyond_1024
            rival_trimesh_subdivision_misses rival_cuda_voxelizer_59_unequal_dims rival_openvdb_151_anisotropic
            rival_openvdb_111_nested_shells
        );
    };
    // For a backend to which every single voxelization is dear: random triangles by the thousand in one grid instead of
    // one by one.
    (batched $name:ident, $backend:expr) => {
        $crate::conformance_suite!(@tests $name, $backend,
            zoo_conservative zoo_thin zoo_solid zoo_sliced
            random_huge random_in_cells
            solid_closed_soup huge_dims
            grid_is_overwritten other_grid_is_refused
            rival_cuda_voxelizer_64_aligned_cube rival_fluidx3d_323_lattice_terrain rival_open3d_6111_interior
            rival_voxsurf_10_cube rival_cinolib_189_faces_on_planes rival_cuda_voxelizer_10_beyond_1024
            rival_trimesh_subdivision_misses rival_cuda_voxelizer_59_unequal_dims rival_openvdb_151_anisotropic
            rival_openvdb_111_nested_shells
        );
    };
    // The same for a backend that only has mode sliced.
    (sliced $name:ident, $backend:expr) => {
        $crate::conformance_suite!(@tests $name, $backend,
            zoo_sliced random_in_cells solid_closed_soup huge_dims grid_is_overwritten other_grid_is_refused
        );
    };
    (@tests $name:ident, $backend:expr, $($check:ident)*) => {
        /// Conformance of one backend.
        #[cfg(test)]
        mod $name {
            use super::*;
            $(
                #[test]
                fn $check() {
                    $crate::conformance::suite::$check(&$backend);
                }
            )*
        }
    };
}
