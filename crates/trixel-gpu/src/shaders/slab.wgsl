// The finished bits of a slab: `voxels.wgsl` has their layout.

struct Slab {
    ny: u32,
    column_words: u32,
    // The slab's first x, and how many words it has.
    x: u32,
    words: u32,
    // Where the slab's voxels begin in the list, and how many they are.
    first: u32,
    voxels: u32,
}

@group(0) @binding(0) var<uniform> slab: Slab;
@group(0) @binding(1) var<storage, read> voxels: array<u32>;

// The lowest voxel of a word.
fn voxel_of_word(word: u32) -> vec3<u32> {
    let column = word / slab.column_words;
    return vec3<u32>(slab.x + column / slab.ny, column % slab.ny, (word % slab.column_words) * 32u);
}
