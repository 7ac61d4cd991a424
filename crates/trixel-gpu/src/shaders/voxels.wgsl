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
fn or_voxels(column: vec2<i32>, index: u32, bits: u32) {
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

// Flips them: toggles of parity, which `fill.wgsl` carries on.
fn flip_voxels(column: vec2<i32>, index: u32, bits: u32) {
    atomicXor(&voxels[column_start(column) + index], bits);
    count_write(countOneBits(bits));
}
