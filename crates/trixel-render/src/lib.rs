//! Pictures of voxel volumes.
