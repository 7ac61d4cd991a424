// Tiles of the grid, counted from its corner: TILE_SHIFT, the logarithms of their sides, is prepended. A slab has the tiles
// that it meets.

struct TileBox {
    low: vec3<i32>,
    size: vec3<u32>,
}

fn first_tile() -> vec3<i32> {
    return vec3<i32>(params.slab_x >> TILE_SHIFT.x, 0, 0);
}

// How many tiles the slab has along each axis.
fn slab_tiles() -> vec3<u32> {
    let last = vec3<i32>(params.slab_x + params.slab_nx - 1, params.dims.yz - 1) >> TILE_SHIFT;
    return vec3<u32>(last - first_tile() + 1);
}

// Tiles by number, z fastest.
fn tile_number(tile: vec3<i32>) -> u32 {
    let tiles = slab_tiles();
    let t = vec3<u32>(tile - first_tile());
    return (t.x * tiles.y + t.y) * tiles.z + t.z;
}

fn tile_numbered(number: u32) -> vec3<i32> {
    let tiles = slab_tiles();
    let column = number / tiles.z;
    return first_tile() + vec3<i32>(vec3<u32>(column / tiles.y, column % tiles.y, number % tiles.z));
}
