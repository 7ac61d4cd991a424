// [HCV] 3.1: one invocation a triangle, which loops over the columns of the triangle's box.
//
// Here the small ones; the others go to a list. Further dispatches take the list from there, `max_columns` columns of each
// triangle at a time, because some drivers end long loops silently; or, in the hybrid, the rasterizer takes it.

@group(1) @binding(0) var<storage, read_write> list: array<u32>;
// VERTICES times the list's length: 1 is prepended, or in the hybrid what makes this the vertex count of its draw.
@group(1) @binding(1) var<storage, read_write> listed: atomic<u32>;

fn take_triangle(i: u32) {
    if i >= params.triangles {
        return;
    }
    let look = look_at(i);
    if look.columns == 0u {
        return;
    }
    if !fits_one_invocation(look) || (HYBRID && size_of(look.shape) >= params.cutoff) {
        list[atomicAdd(&listed, VERTICES) / VERTICES] = i;
        return;
    }
    painting = i;
    voxelize_columns(triangle_of(look.shape), 0u);
    flush_counters();
}

@compute @workgroup_size(WORKGROUP)
fn triangle_parallel(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    take_triangle(invocation(group, groups, local));
    count_lanes(local);
}
