// An exclusive prefix sum, in blocks: `scan_blocks` replaces each block by its prefix sums and gives the blocks' totals,
// which are scanned likewise; `add_totals` then adds them. Sums saturate, so that an overflow shows.

struct Length {
    elements: u32,
}

@group(0) @binding(0) var<uniform> length: Length;
@group(0) @binding(1) var<storage, read_write> data: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

const THREADS: u32 = 256u;
const PER_THREAD: u32 = 4u;

var<workgroup> sums: array<u32, THREADS>;

fn add(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, a + b < a);
}

fn load(i: u32) -> u32 {
    if i < length.elements {
        return data[i];
    }
    return 0u;
}

fn store(i: u32, value: u32) {
    if i < length.elements {
        data[i] = value;
    }
}

@compute @workgroup_size(THREADS)
fn scan_blocks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = group.y * groups.x + group.x;
    let start = (block * THREADS + local) * PER_THREAD;
    let v = vec4<u32>(load(start), load(start + 1u), load(start + 2u), load(start + 3u));
    let own = add(add(v.x, v.y), add(v.z, v.w));
    sums[local] = own;
    for (var reach = 1u; reach < THREADS; reach <<= 1u) {
        workgroupBarrier();
        var before = 0u;
        if local >= reach {
            before = sums[local - reach];
        }
        workgroupBarrier();
        sums[local] = add(sums[local], before);
    }
    workgroupBarrier();
    var sum = 0u;
    if local > 0u {
        sum = sums[local - 1u];
    }
    store(start, sum);
    sum = add(sum, v.x);
    store(start + 1u, sum);
    sum = add(sum, v.y);
    store(start + 2u, sum);
    store(start + 3u, add(sum, v.z));
    // A dispatch of two dimensions may have workgroups too many.
    if local == THREADS - 1u && (block == 0u || block * THREADS * PER_THREAD < length.elements) {
        totals[block] = sums[local];
    }
}

@compute @workgroup_size(THREADS)
fn add_totals(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = group.y * groups.x + group.x;
    let start = (block * THREADS + local) * PER_THREAD;
    let before = totals[block];
    for (var i = start; i < start + PER_THREAD; i++) {
        store(i, add(load(i), before));
    }
}
