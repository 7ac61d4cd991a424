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
    let look = look_at(i);
    if look.columns == 0u {
        return;
    }
    if !fits_one_invocation(look) || size_of(look.shape) >= params.cutoff {
        large[atomicAdd(&large_count, 1u)] = i;
    } else {
        small[atomicAdd(&small_count, 1u)] = i;
    }
}
