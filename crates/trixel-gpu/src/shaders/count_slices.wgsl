// For `sliced`: how many slices each triangle may meet.

@group(1) @binding(0) var<storage, read_write> slices: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn count_slices(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < params.triangles {
        let met = slices_of(look_at(i).shape);
        slices[i] = u32(max(met.y - met.x + 1, 0));
    }
}
