// The fragments that count, as pairs of voxel and triangle for sorting.

struct Gather {
    items: u32,
}

@group(0) @binding(0) var<uniform> gather: Gather;
// As `weigh.wgsl` leaves them.
@group(0) @binding(1) var<storage, read> fragments: array<u32>;
@group(0) @binding(2) var<storage, read_write> gathered: atomic<u32>;
@group(0) @binding(3) var<storage, read_write> pairs: array<vec2<u32>>;

@compute @workgroup_size(WORKGROUP)
fn gather_pairs(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= gather.items {
        return;
    }
    let at = 4u + 3u * i;
    let triangle = fragments[at + 2u];
    if triangle != 0xffffffffu {
        pairs[atomicAdd(&gathered, 1u)] = vec2<u32>(fragments[at], triangle);
    }
}

// How many triangles each voxel has; `pairs` takes the numbers, two a pair.
@group(0) @binding(4) var<storage, read> state: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn copy_counts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if 2u * i < gather.items {
        let odd = select(0u, state[(2u * i + 1u) * STATE_WORDS + 2u], 2u * i + 1u < gather.items);
        pairs[i] = vec2<u32>(state[2u * i * STATE_WORDS + 2u], odd);
    }
}
