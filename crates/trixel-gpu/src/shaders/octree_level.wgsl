// One level of an octree, once it is known where the levels' nodes begin.

struct Level {
    cubes: u32,
    // Where the nodes of this level and of the one below begin.
    start: u32,
    below: u32,
}

@group(0) @binding(0) var<uniform> level: Level;
// As `octree.wgsl` leaves them, `mixed` summed up.
@group(0) @binding(1) var<storage, read> masks: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> mixed: array<u32>;

// Full cubes have none.
fn has_node(cube: u32) -> bool {
    return (masks[cube].x >> 8u) != 0xffu;
}

fn octants_of(cube: u32) -> u32 {
    return masks[cube].x & 0xffu;
}

// Where the looks of a cube's voxels begin, on the last level of an octree with attributes: before them come all voxels of the
// list but those of full cubes, eight each.
fn first_look(cube: u32) -> u32 {
    return masks[cube].y - 8u * (cube - mixed[cube]);
}
