// Instead of `claim.wgsl` where nobody asks which triangle a voxel is of.

fn claim(voxel: vec3<i32>, triangle: u32) {
}
