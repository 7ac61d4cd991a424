// Instead of `append.wgsl` where voxels only go to the bits.

fn append(column: vec2<u32>, z: u32, bits: u32) {
}
