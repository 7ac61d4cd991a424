// Counters of our own: pipeline statistics are wrong on some drivers. Each is two words, low first.

@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;

const COUNT_INVOCATIONS: u32 = 0u;
const COUNT_FRAGMENTS: u32 = 1u;
const COUNT_DISCARDED: u32 = 2u;
const COUNT_COLUMNS: u32 = 3u;
const COUNT_TESTS: u32 = 4u;
const COUNT_WRITTEN: u32 = 5u;
const COUNT_ATOMICS: u32 = 6u;
const COUNT_TOO_LARGE: u32 = 7u;
const COUNT_LANE_WORK: u32 = 8u;
const COUNT_LANE_SLOTS: u32 = 9u;

var<private> columns_here: u32 = 0u;
var<private> tests_here: u32 = 0u;
var<private> written_here: u32 = 0u;
var<private> atomics_here: u32 = 0u;

fn count(what: u32, amount: u32) {
    if amount != 0u {
        let before = atomicAdd(&counters[2u * what], amount);
        if before + amount < before {
            atomicAdd(&counters[2u * what + 1u], 1u);
        }
    }
}

fn count_column() {
    if COUNTING {
        columns_here++;
    }
}

fn count_voxel() {
    if COUNTING {
        tests_here++;
    }
}

fn count_write(voxels: u32) {
    if COUNTING {
        written_here += voxels;
        atomics_here++;
    }
}

// Adds what this invocation counted to the totals.
fn flush_counters() {
    if COUNTING {
        count(COUNT_COLUMNS, columns_here);
        count(COUNT_TESTS, tests_here);
        count(COUNT_WRITTEN, written_here);
        count(COUNT_ATOMICS, atomics_here);
    }
}

// Always counted, because its triangles are missing from the result: the caller must look.
fn count_too_large(flags: u32) {
    if (flags & TOO_LARGE) != 0u {
        count(COUNT_TOO_LARGE, 1u);
    }
}
