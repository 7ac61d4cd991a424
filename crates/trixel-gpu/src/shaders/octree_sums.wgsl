// One level of an octree's averages: what each cube's octants add up to. `octree_sums_of_leaves.wgsl` or
// `octree_sums_of_cubes.wgsl` tells what is below.

@group(0) @binding(4) var<storage, read_write> sums: array<Sum>;

// One invocation an entry of the level below; the first of each cube adds the others, so that nothing is added by two.
@compute @workgroup_size(WORKGROUP)
fn sum_octants(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= sparse.entries || !is_first(i) {
        return;
    }
    var sum = sum_below(i);
    let end = end_of_eight(i);
    for (var child = i + 1u; child < end; child++) {
        sum = plus(sum, sum_below(child));
    }
    sums[begun[i]] = sum;
}
