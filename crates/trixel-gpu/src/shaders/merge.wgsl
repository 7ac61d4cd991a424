// Merges equal neighbours of a sorted list: C. Crassin & S. Green, 2012. Each invocation counts the entries of its block that
// differ from the one before; the counts summed up say where they go.

struct Merge {
    entries: u32,
}

@group(0) @binding(0) var<uniform> merge: Merge;
@group(0) @binding(1) var<storage, read> fragments: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> list: array<vec2<u32>>;

// The entries of one invocation: MERGE_BLOCK in lists/sort.rs.
const BLOCK: u32 = 64u;

fn is_first(i: u32) -> bool {
    return i == 0u || any(fragments[i] != fragments[max(i, 1u) - 1u]);
}

@compute @workgroup_size(WORKGROUP)
fn count_distinct(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = invocation(group, groups, local);
    var sum = 0u;
    for (var i = block * BLOCK; i < min((block + 1u) * BLOCK, merge.entries); i++) {
        sum += select(0u, 1u, is_first(i));
    }
    if block * BLOCK < merge.entries {
        counts[block] = sum;
    }
}

@compute @workgroup_size(WORKGROUP)
fn write_distinct(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = invocation(group, groups, local);
    if block * BLOCK >= merge.entries {
        return;
    }
    var place = counts[block];
    for (var i = block * BLOCK; i < min((block + 1u) * BLOCK, merge.entries); i++) {
        if is_first(i) {
            list[place] = fragments[i];
            place++;
        }
    }
}
