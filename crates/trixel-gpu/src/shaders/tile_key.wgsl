// What pairs of tile and triangle are sorted by: the tile.

fn key_of(entry: vec2<u32>, y_bits: u32, z_bits: u32) -> vec2<u32> {
    return vec2<u32>(entry.x, 0u);
}
