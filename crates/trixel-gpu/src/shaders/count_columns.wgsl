// For `balanced`: how many columns each triangle's box has.

@group(1) @binding(0) var<storage, read_write> columns: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn count_columns(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= params.triangles {
        return;
    }
    if COUNTING {
        count(COUNT_INVOCATIONS, 1u);
    }
    let shape = shape_of(corners(i));
    count_too_large(shape.flags);
    var n = 0u;
    if (shape.flags & EMPTY) == 0u {
        n = rect_columns(column_rect(shape.base, shape.extent, shape.flags & AXIS_MASK));
    }
    columns[i] = n;
}
