// [HCV] 3.1: one invocation a triangle, which loops over the columns of the triangle's box.
//
// Here the small ones; the others go to a list. Further dispatches take the list from there, `max_columns` columns of each
// triangle at a time, because some drivers end long loops silently; or, in the hybrid, the rasterizer takes it.

@group(1) @binding(0) var<storage, read_write> list: array<u32>;
@group(1) @binding(1) var<storage, read_write> listed: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn triangle_parallel(
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
    if (shape.flags & EMPTY) != 0u {
        return;
    }
    let rect = column_rect(shape.base, shape.extent, shape.flags & AXIS_MASK);
    let columns = rect_columns(rect);
    if columns == 0u {
        return;
    }
    let fits = columns <= params.max_columns && is_small(shape.extent);
    if !fits || (HYBRID && size_of(shape) >= params.cutoff) {
        list[atomicAdd(&listed, 1u)] = i;
        return;
    }
    voxelize_columns(triangle_of(shape), 0u);
    flush_counters();
}
