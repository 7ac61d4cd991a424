// Instead of `append.wgsl` where voxels only go to the bits.

// The triangle at hand, counted over all chunks of the mesh.
var<private> owner: u32;

fn append(column: vec2<u32>, z: u32, bits: u32) {
}
