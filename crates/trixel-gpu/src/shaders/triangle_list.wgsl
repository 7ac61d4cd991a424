// The same for the triangles of a list: later shares of large ones, or the small ones of a classification.

@group(1) @binding(0) var<storage, read> list: array<u32>;
@group(1) @binding(1) var<storage, read> listed: u32;

fn take_listed(i: u32) {
    if i >= listed {
        return;
    }
    if COUNTING {
        count(COUNT_INVOCATIONS, 1u);
    }
    let shape = shape_of(corners(list[i]));
    if (shape.flags & EMPTY) == 0u {
        painting = list[i];
        voxelize_columns(triangle_of(shape), params.first_column);
        flush_counters();
    }
}

@compute @workgroup_size(WORKGROUP)
fn triangle_list(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    take_listed(invocation(group, groups, local));
    count_lanes(local);
}
