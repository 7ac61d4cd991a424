// Second half of the sort by case: the counts, summed up, say where each triangle goes.

@group(1) @binding(0) var<storage, read> cases: array<u32>;
@group(1) @binding(1) var<storage, read> before: array<u32>;
@group(1) @binding(2) var<storage, read_write> sorted: array<u32>;

const NOTHING: u32 = 4u;

@compute @workgroup_size(WORKGROUP)
fn sort_cases(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= params.triangles {
        return;
    }
    let own = cases[i] & 0xffu;
    if own != NOTHING {
        let blocks = (params.triangles + WORKGROUP - 1u) / WORKGROUP;
        sorted[before[own * blocks + i / WORKGROUP] + (cases[i] >> 8u)] = i;
    }
}
