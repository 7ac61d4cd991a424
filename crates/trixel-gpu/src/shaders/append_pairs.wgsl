// Instead of `append.wgsl` where it matters which triangle a voxel is of: three words an entry.

struct Appended {
    count: atomic<u32>,
    // How many entries there is room for; the count goes on beyond it.
    capacity: u32,
    // Not 0 when the count has passed 2^32.
    wrapped: atomic<u32>,
    unused: u32,
    words: array<u32>,
}

@group(2) @binding(0) var<storage, read_write> appended: Appended;

// Appends the voxels of a column that a word's bits name, from z on.
fn append(column: vec2<u32>, z: u32, bits: u32) {
    let number = countOneBits(bits);
    var place = atomicAdd(&appended.count, number);
    if place + number < place {
        atomicStore(&appended.wrapped, 1u);
    }
    for (var rest = bits; rest != 0u; rest &= rest - 1u) {
        if place < appended.capacity {
            let entry = entry_of(vec3<u32>(column, z + firstTrailingBit(rest)));
            appended.words[3u * place] = entry.x;
            appended.words[3u * place + 1u] = entry.y;
            appended.words[3u * place + 2u] = painting;
        }
        place++;
    }
}
