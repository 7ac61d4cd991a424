// For `balanced`: how many columns each triangle's box has.

@group(1) @binding(0) var<storage, read_write> columns: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn count_columns(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < params.triangles {
        columns[i] = look_at(i).columns;
    }
}
