// The other levels of an octree: their octants are the cubes of the level below.

// Which octants of each cube hold any voxel, and above these eight bits, which are full.
@group(0) @binding(3) var<storage, read> masks_below: array<vec2<u32>>;
// How many cubes before each are neither empty nor full.
@group(0) @binding(4) var<storage, read> mixed_below: array<u32>;

fn is_full(child: u32) -> bool {
    return (masks_below[child].x >> 8u) == FULL;
}

fn mixed_before(child: u32) -> u32 {
    return mixed_below[child];
}
