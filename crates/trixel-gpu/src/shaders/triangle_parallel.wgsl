// [HCV] 3.1: one invocation a triangle, which loops over the columns of the triangle's box.
//
// One dispatch takes `max_columns` columns of a triangle at most, because some drivers end long loops silently. What is
// left goes to a list, and further dispatches take their share of it from there.

@group(1) @binding(0) var<storage, read_write> list: array<u32>;
@group(1) @binding(1) var<storage, read_write> listed: atomic<u32>;

fn defer(triangle: u32) {
    list[atomicAdd(&listed, 1u)] = triangle;
}

// All triangles; those with columns left, or too large for the hybrid's cutoff, are listed.
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
    if HYBRID {
        if columns > params.max_columns || size_of(shape) >= params.cutoff {
            defer(i);
            return;
        }
    } else if columns > params.max_columns {
        defer(i);
    }
    voxelize_columns(triangle_of(shape), 0u);
    flush_counters();
}
