// One level of a sparse octree: the twin of `octree.rs`, which has the definition of the nodes. What is below it, voxels or
// cubes, is told by `octree_on_voxels.wgsl`, `octree_on_leaves.wgsl` or `octree_on_cubes.wgsl`.

const FULL: u32 = 0xffu;

@group(0) @binding(5) var<storage, read_write> cubes: array<vec2<u32>>;
// Of this level's cubes: the octants with voxels, above them the full ones, and what `mixed_before` says of the first child.
@group(0) @binding(6) var<storage, read_write> masks: array<vec2<u32>>;
// 1 for the cubes of this level that are neither empty nor full.
@group(0) @binding(7) var<storage, read_write> mixed: array<u32>;

// One invocation an entry of the level below; the first of each cube gathers the others.
@compute @workgroup_size(WORKGROUP)
fn gather_octants(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= sparse.entries || !is_first(i) {
        return;
    }
    var octants = 0u;
    let end = end_of_eight(i);
    for (var child = i; child < end; child++) {
        let half = voxel_of(list[child]) & vec3<u32>(1u);
        let octant = (half.x << 2u) | (half.y << 1u) | half.z;
        octants |= 1u << octant;
        if is_full(child) {
            octants |= 0x100u << octant;
        }
    }
    let place = begun[i];
    cubes[place] = entry_of(cube_of(i));
    masks[place] = vec2<u32>(octants, mixed_before(i));
    mixed[place] = select(1u, 0u, (octants >> 8u) == FULL);
}
