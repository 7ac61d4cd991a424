// One invocation a pair of triangle and column: the even distribution of work that [HCV] chapter 5 leaves for later.

// How many pairs there are.
@group(1) @binding(1) var<storage, read> total: u32;

// The first invocation of each triangle in a workgroup makes it ready for the others.
var<workgroup> ready: array<Triangle, WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn balanced(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let pair = invocation(group, groups, local);
    let there = pair < total;
    var column = 0u;
    if there {
        if COUNTING {
            count(COUNT_INVOCATIONS, 1u);
        }
        let triangle = triangle_of_pair(pair);
        painting = triangle;
        column = pair - before[triangle];
        if column == 0u || local == 0u {
            ready[local] = triangle_of(shape_of(corners(triangle)));
        }
    }
    workgroupBarrier();
    if there {
        let t = ready[local - min(local, column)];
        let rect = column_rect(t.base, t.extent, t.flags & AXIS_MASK);
        let width = u32(rect.z - rect.x + 1);
        _ = voxelize_column(t, rect.x + i32(column % width), rect.y + i32(column / width));
        flush_counters();
    }
    count_lanes(local);
}
