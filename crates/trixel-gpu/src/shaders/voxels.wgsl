// Writing voxels: one bit each, packed along z, columns with y fastest. SINK is prepended: where they go.

const TO_BITS: u32 = 0u;
// To the bits, and whoever sets one appends the voxel to a list.
const TO_LIST: u32 = 1u;
// To a list alone, once for every triangle.
const TO_FRAGMENTS: u32 = 2u;
// To a list alone, with the triangle.
const TO_PAIRS: u32 = 3u;

@group(0) @binding(3) var<storage, read_write> voxels: array<atomic<u32>>;

fn column_start(column: vec2<i32>) -> u32 {
    return (u32(column.x - params.slab_x) * u32(params.dims.y) + u32(column.y)) * params.column_words;
}

// Sets the voxels of a column that the bits of its word `index` name.
fn or_word(column: vec2<i32>, index: u32, bits: u32) {
    if SINK == TO_FRAGMENTS || SINK == TO_PAIRS {
        append(vec2<u32>(column), 32u * index, bits);
        count_write(countOneBits(bits));
        return;
    }
    let word = column_start(column) + index;
    // Most voxels are met by several triangles: looking first saves the atomic.
    let missing = bits & ~atomicLoad(&voxels[word]);
    if missing != 0u {
        let own = missing & ~atomicOr(&voxels[word], missing);
        count_write(countOneBits(own));
        if SINK == TO_LIST {
            append(vec2<u32>(column), 32u * index, own);
        }
    }
}

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

// Flips the parity from this voxel upwards; `fill.wgsl` carries it on.
fn toggle_voxel(voxel: vec3<i32>) {
    atomicXor(&voxels[column_start(voxel.xy) + (u32(voxel.z) >> 5u)], 1u << (u32(voxel.z) & 31u));
    count_write(1u);
}
