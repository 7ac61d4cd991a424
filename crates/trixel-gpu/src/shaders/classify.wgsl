// [HCV] figure 3.11: sorts the triangles into the small and the large, before anything is voxelized.

@group(1) @binding(0) var<storage, read_write> small: array<u32>;
@group(1) @binding(1) var<storage, read_write> small_count: atomic<u32>;
@group(1) @binding(2) var<storage, read_write> large: array<u32>;
@group(1) @binding(3) var<storage, read_write> large_count: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn classify(
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
    let columns = rect_columns(column_rect(shape.base, shape.extent, shape.flags & AXIS_MASK));
    let fits = columns <= params.max_columns && is_small(shape.extent);
    if !fits || size_of(shape) >= params.cutoff {
        large[atomicAdd(&large_count, 1u)] = i;
    } else if columns > 0u {
        small[atomicAdd(&small_count, 1u)] = i;
    }
}
