// A tile in the workgroup's own memory: TILE_SHIFT says that a column of it is one word.

var<workgroup> tile_words: array<atomic<u32>, TILE_WORDS>;

fn tile_word(column: vec2<i32>) -> u32 {
    let side = (vec2<i32>(1) << TILE_SHIFT.xy) - 1;
    let at = vec2<u32>(column & side);
    return (at.x << TILE_SHIFT.y) | at.y;
}

// The column of a word, from the tile's corner: the way back.
fn column_of(word: u32) -> vec2<u32> {
    return vec2<u32>(word >> TILE_SHIFT.y, word & ((1u << TILE_SHIFT.y) - 1u));
}

fn or_word(column: vec2<i32>, index: u32, bits: u32) {
    let word = tile_word(column);
    atomicOr(&tile_words[word], bits);
    paint(word, bits);
}

fn flip_word(column: vec2<i32>, index: u32, bits: u32) {
    atomicXor(&tile_words[tile_word(column)], bits);
}
