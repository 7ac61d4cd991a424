// Every write goes to the voxels at once.

fn or_word(column: vec2<i32>, index: u32, bits: u32) {
    or_voxels(column, index, bits);
}

fn flip_word(column: vec2<i32>, index: u32, bits: u32) {
    flip_voxels(column, index, bits);
}
