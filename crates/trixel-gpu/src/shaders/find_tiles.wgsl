// For `tiled`: where in the sorted pairs a workgroup's share begins, at each tile and at each multiple of SHARE, so that no
// loop gets long. SHARE is prepended.

struct Round {
    first: u32,
    length: u32,
    none: u32,
}

struct Shares {
    // 64 for each share: invocations.
    invocations: atomic<u32>,
    // How many pairs there are.
    pairs: u32,
    starts: array<u32>,
}

@group(0) @binding(0) var<storage, read> round: Round;
@group(0) @binding(1) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> shares: Shares;

@compute @workgroup_size(WORKGROUP)
fn find_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i == 0u {
        shares.pairs = round.length;
    }
    if i >= round.length {
        return;
    }
    let tile = pairs[i].x;
    if tile == round.none {
        return;
    }
    if i % SHARE == 0u || pairs[max(i, 1u) - 1u].x != tile {
        shares.starts[atomicAdd(&shares.invocations, WORKGROUP) / WORKGROUP] = i;
    }
}
