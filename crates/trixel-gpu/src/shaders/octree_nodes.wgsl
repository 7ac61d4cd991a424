// The nodes of one level of an octree. LEAVES is prepended: whether its octants are voxels with attributes.

@group(0) @binding(3) var<storage, read_write> nodes: array<vec2<u32>>;

@compute @workgroup_size(WORKGROUP)
fn write_nodes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= level.cubes || !has_node(i) {
        return;
    }
    var node = masks[i] + vec2<u32>(0u, level.below);
    if LEAVES {
        // Full octants were those without attributes; now they are those with voxels, as in any tree.
        node = vec2<u32>(octants_of(i) * 0x101u, first_look(i));
    }
    nodes[level.start + mixed[i]] = node;
}
