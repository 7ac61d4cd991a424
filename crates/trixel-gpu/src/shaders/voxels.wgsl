// Writing voxels: one bit each, packed along z, columns with y fastest.

@group(0) @binding(3) var<storage, read_write> voxels: array<atomic<u32>>;

fn column_start(column: vec2<i32>) -> u32 {
    return (u32(column.x - params.slab_x) * u32(params.dims.y) + u32(column.y)) * params.column_words;
}

// Most voxels are met by several triangles: looking first saves the atomic.
fn or_word(word: u32, bits: u32) {
    let missing = bits & ~atomicLoad(&voxels[word]);
    if missing != 0u {
        let before = atomicOr(&voxels[word], missing);
        count_write(countOneBits(missing & ~before));
    }
}

// Sets up to 32 voxels from z on; those above the grid must not be among the bits.
fn set_bits(column: vec2<i32>, z: i32, bits: u32) {
    let word = column_start(column) + (u32(z) >> 5u);
    let shift = u32(z) & 31u;
    or_word(word, bits << shift);
    if shift != 0u {
        let rest = bits >> (32u - shift);
        if rest != 0u {
            or_word(word + 1u, rest);
        }
    }
}

// Sets the voxels from z0 to z1.
fn set_run(column: vec2<i32>, z0: i32, z1: i32) {
    let start = column_start(column);
    let first = u32(z0) >> 5u;
    let last = u32(z1) >> 5u;
    for (var word = first; word <= last; word++) {
        var bits = 0xffffffffu;
        if word == first {
            bits &= 0xffffffffu << (u32(z0) & 31u);
        }
        if word == last {
            bits &= 0xffffffffu >> (31u - (u32(z1) & 31u));
        }
        or_word(start + word, bits);
    }
}

// Flips the parity from this voxel upwards; `fill.wgsl` carries it on.
fn toggle_voxel(voxel: vec3<i32>) {
    atomicXor(&voxels[column_start(voxel.xy) + (u32(voxel.z) >> 5u)], 1u << (u32(voxel.z) & 31u));
    count_write(1u);
}
