// The triangles of one case, one invocation each, by code for that case: `voxelize_case`. CASE is prepended.

@group(1) @binding(0) var<storage, read> before: array<u32>;
@group(1) @binding(1) var<storage, read> total: u32;
@group(1) @binding(2) var<storage, read> sorted: array<u32>;

fn take_sorted(i: u32) {
    let blocks = (params.triangles + WORKGROUP - 1u) / WORKGROUP;
    let start = before[CASE * blocks];
    var end = total;
    if CASE < 3u {
        end = before[(CASE + 1u) * blocks];
    }
    if i >= end - start {
        return;
    }
    if COUNTING {
        count(COUNT_INVOCATIONS, 1u);
    }
    painting = sorted[start + i];
    voxelize_case(corners(painting));
    flush_counters();
}

@compute @workgroup_size(WORKGROUP)
fn case_sorted(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    take_sorted(invocation(group, groups, local));
    count_lanes(local);
}
