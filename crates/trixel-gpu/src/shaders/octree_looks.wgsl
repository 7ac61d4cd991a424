// What nodes look like, and the voxels of the last level's.

@group(0) @binding(3) var<storage, read> leaves: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> sums: array<Sum>;
@group(0) @binding(5) var<storage, read_write> looks: array<vec4<u32>>;

@compute @workgroup_size(WORKGROUP)
fn write_node_looks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < level.cubes && has_node(i) {
        looks[level.start + mixed[i]] = look_of(sums[i]);
    }
}

// One invocation a cube of the last level.
@compute @workgroup_size(WORKGROUP)
fn write_voxel_looks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= level.cubes || !has_node(i) {
        return;
    }
    let first = first_look(i);
    let voxels = countOneBits(octants_of(i));
    for (var k = 0u; k < voxels; k++) {
        looks[first + k] = look_of(sum_of(leaves[masks[i].y + k]));
    }
}
