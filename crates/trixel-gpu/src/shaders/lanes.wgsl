// How evenly columns are spread over the lanes that run in step: a share of 1 means that none waits for another.

// Lanes that are taken to run in step, as on most GPUs.
const LANES: u32 = 32u;

var<workgroup> lane_columns: array<u32, WORKGROUP>;

// Call at the end, by all invocations of a workgroup.
fn count_lanes(local: u32) {
    if COUNTING {
        lane_columns[local] = columns_here;
        workgroupBarrier();
        if local % LANES == 0u {
            var sum = 0u;
            var most = 0u;
            for (var lane = local; lane < local + LANES; lane++) {
                sum += lane_columns[lane];
                most = max(most, lane_columns[lane]);
            }
            count(COUNT_LANE_WORK, sum);
            count(COUNT_LANE_SLOTS, LANES * most);
        }
    }
}
