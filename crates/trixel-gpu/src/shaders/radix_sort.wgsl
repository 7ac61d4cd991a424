// One pass of a stable radix sort, by four bits of the keys: each invocation counts the digits of its own entries, the counts
// are summed up digit by digit (`scan.wgsl`), and each invocation then moves its entries in order. No atomics, so nothing
// depends on the order of invocations.

struct Sort {
    entries: u32,
    // Invocations that have entries.
    blocks: u32,
    // The lowest bit of the digit.
    shift: u32,
    y_bits: u32,
    z_bits: u32,
}

@group(0) @binding(0) var<uniform> sort: Sort;
@group(0) @binding(1) var<storage, read> unsorted: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sorted: array<vec2<u32>>;

const DIGITS: u32 = 16u;
// The entries of one invocation: SORT_BLOCK in lists/sort.rs.
const BLOCK: u32 = 64u;

// Each invocation has a column of its own.
var<workgroup> tallies: array<u32, DIGITS * WORKGROUP>;

fn digit_of(entry: vec2<u32>) -> u32 {
    let key = key_of(entry, sort.y_bits, sort.z_bits);
    // Digits are aligned: none spans both words.
    return (select(key.x, key.y, sort.shift >= 32u) >> (sort.shift & 31u)) & (DIGITS - 1u);
}

@compute @workgroup_size(WORKGROUP)
fn count_digits(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = invocation(group, groups, local);
    if block >= sort.blocks {
        return;
    }
    for (var digit = 0u; digit < DIGITS; digit++) {
        tallies[digit * WORKGROUP + local] = 0u;
    }
    for (var i = block * BLOCK; i < min((block + 1u) * BLOCK, sort.entries); i++) {
        tallies[digit_of(unsorted[i]) * WORKGROUP + local]++;
    }
    for (var digit = 0u; digit < DIGITS; digit++) {
        counts[digit * sort.blocks + block] = tallies[digit * WORKGROUP + local];
    }
}

@compute @workgroup_size(WORKGROUP)
fn move_entries(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = invocation(group, groups, local);
    if block >= sort.blocks {
        return;
    }
    for (var digit = 0u; digit < DIGITS; digit++) {
        tallies[digit * WORKGROUP + local] = counts[digit * sort.blocks + block];
    }
    for (var i = block * BLOCK; i < min((block + 1u) * BLOCK, sort.entries); i++) {
        let entry = unsorted[i];
        let place = digit_of(entry) * WORKGROUP + local;
        sorted[tallies[place]] = entry;
        tallies[place]++;
    }
}
