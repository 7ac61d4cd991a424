// The place of a voxel in the list of all, from the bits and the sums of their blocks: the twin of `rank.rs`.

struct Locate {
    items: u32,
    ny: u32,
    column_words: u32,
    // The bits' first x, and how many there are.
    slab_x: u32,
    slab_nx: u32,
    // What is numbered begins here among the slab's voxels, or wraps to begin before them.
    first: u32,
    // Of the chunk.
    first_triangle: u32,
}

@group(0) @binding(0) var<uniform> locate: Locate;
@group(0) @binding(1) var<storage, read> voxels: array<u32>;
@group(0) @binding(2) var<storage, read> blocks: array<u32>;

// BLOCK_WORDS in lists/scan.rs.
const BLOCK_WORDS: u32 = 8u;

// How many voxels are set before a word.
fn before_word(word: u32) -> u32 {
    let block = word / BLOCK_WORDS;
    var sum = blocks[block];
    for (var i = block * BLOCK_WORDS; i < word; i++) {
        sum += countOneBits(voxels[i]);
    }
    return sum;
}

struct Place {
    number: u32,
    // Whether the voxel is set; if not, the number is that of the next.
    there: bool,
}

fn place_of(voxel: vec3<u32>) -> Place {
    let word = ((voxel.x - locate.slab_x) * locate.ny + voxel.y) * locate.column_words + (voxel.z >> 5u);
    let bits = voxels[word];
    let bit = 1u << (voxel.z & 31u);
    return Place(before_word(word) + countOneBits(bits & (bit - 1u)) - locate.first, (bits & bit) != 0u);
}
