// The nodes of one level of an octree, once it is known where the levels begin.

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
@group(0) @binding(3) var<storage, read_write> nodes: array<vec2<u32>>;

@compute @workgroup_size(WORKGROUP)
fn write_nodes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    // Full cubes have no node.
    if i < level.cubes && (masks[i].x >> 8u) != 0xffu {
        nodes[level.start + mixed[i]] = masks[i] + vec2<u32>(0u, level.below);
    }
}
