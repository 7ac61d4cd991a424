// One invocation a pair of voxel and triangle, where every triangle keeps a row of its own. Only of the chunk's triangles.

@group(0) @binding(1) var<storage, read> pairs: array<vec2<u32>>;

@compute @workgroup_size(WORKGROUP)
fn write_fragment_rows(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= work.items {
        return;
    }
    let pair = pairs[i];
    if pair.y - work.first_triangle >= work.triangles {
        return;
    }
    let p = patch_of(pair.y);
    let w = weights_at(nearest_of(corners_of(p)), voxel_at(pair.x));
    put_row(i, row_of(p, pair.y, w));
}
