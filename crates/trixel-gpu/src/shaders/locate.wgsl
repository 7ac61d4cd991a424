// The place of a fragment's voxel in the list, from the bits and the sums of their blocks: the twin of `rank.rs`.

struct Locate {
    items: u32,
    ny: u32,
    column_words: u32,
    // The first x of the bits, and where the batch begins among the slab's voxels.
    slab_x: u32,
    batch_first: u32,
    // Of the chunk.
    first_triangle: u32,
}

@group(0) @binding(0) var<uniform> locate: Locate;
@group(0) @binding(1) var<storage, read> voxels: array<u32>;
@group(0) @binding(2) var<storage, read> blocks: array<u32>;
// Three words each after four others: a voxel and a triangle's place in its chunk; then the voxel's place in the batch, one
// word free, and the triangle's number, NOTHING where it does not count.
@group(0) @binding(3) var<storage, read_write> fragments: array<u32>;

const NOTHING: u32 = 0xffffffffu;
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

@compute @workgroup_size(WORKGROUP)
fn locate_fragments(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= locate.items {
        return;
    }
    let at = 4u + 3u * i;
    let voxel = voxel_of(vec2<u32>(fragments[at], fragments[at + 1u]));
    let word = ((voxel.x - locate.slab_x) * locate.ny + voxel.y) * locate.column_words + (voxel.z >> 5u);
    let bits = voxels[word];
    let bit = 1u << (voxel.z & 31u);
    let triangle = fragments[at + 2u] + locate.first_triangle;
    // A solid's shell reaches beyond its voxels.
    fragments[at + 2u] = select(NOTHING, triangle, (bits & bit) != 0u);
    fragments[at] = before_word(word) + countOneBits(bits & (bit - 1u)) - locate.batch_first;
}

// How many of a slab's voxels come before each plane of constant x; `fragments` takes the numbers.
@compute @workgroup_size(WORKGROUP)
fn count_before_planes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < locate.items {
        fragments[i] = before_word(i * locate.ny * locate.column_words);
    }
}
