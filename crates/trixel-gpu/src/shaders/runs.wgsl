// Bits, runs and toggles of a column, word by word. Where the words are is told by `direct` or `tile_memory`.

// Sets up to 32 voxels from z on; those above the grid must not be among the bits.
fn set_bits(column: vec2<i32>, z: i32, bits: u32) {
    let index = u32(z) >> 5u;
    let shift = u32(z) & 31u;
    or_word(column, index, bits << shift);
    if shift != 0u {
        let rest = bits >> (32u - shift);
        if rest != 0u {
            or_word(column, index + 1u, rest);
        }
    }
}

// Sets the voxels from z0 to z1.
fn set_run(column: vec2<i32>, z0: i32, z1: i32) {
    let first = u32(z0) >> 5u;
    let last = u32(z1) >> 5u;
    for (var index = first; index <= last; index++) {
        var bits = 0xffffffffu;
        if index == first {
            bits &= 0xffffffffu << (u32(z0) & 31u);
        }
        if index == last {
            bits &= 0xffffffffu >> (31u - (u32(z1) & 31u));
        }
        or_word(column, index, bits);
    }
}

// Flips the parity from this voxel upwards.
fn toggle_voxel(voxel: vec3<i32>) {
    flip_word(voxel.xy, u32(voxel.z) >> 5u, 1u << (u32(voxel.z) & 31u));
}
