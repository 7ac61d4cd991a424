// What each voxel of a list along the Morton curve has: rows of attributes are in the order of x, y, z. In front of it stand
// WANT_... and where in a row (ROW_WORDS words) the parts are.

struct Leaves {
    entries: u32,
    // The voxels, in the order of rows, whose rows are bound.
    first_voxel: u32,
    voxels: u32,
}

@group(0) @binding(0) var<uniform> search: Leaves;
@group(0) @binding(1) var<storage, read> list: array<vec2<u32>>;
// The same voxels by x, y, z.
@group(0) @binding(2) var<storage, read> sorted: array<vec2<u32>>;
// The row that stands for each of these voxels, NOTHING where there is none.
@group(0) @binding(3) var<storage, read> rows_of: array<u32>;
@group(0) @binding(4) var<storage, read> rows: array<u32>;
@group(0) @binding(5) var<storage, read_write> leaves: array<vec4<u32>>;

const NOTHING: u32 = 0xffffffffu;

fn before(a: vec2<u32>, b: vec2<u32>) -> bool {
    // x above y, and then z.
    let p = (a.x << 16u) | (a.x >> 16u);
    let q = (b.x << 16u) | (b.x >> 16u);
    return p < q || (p == q && a.y < b.y);
}

fn place_of(entry: vec2<u32>) -> u32 {
    var low = 0u;
    var high = search.entries;
    while low < high {
        let middle = low + (high - low) / 2u;
        if before(sorted[middle], entry) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

fn component(at: u32) -> i32 {
    return i32(bitcast<f32>(rows[at]) * 32768.0);
}

@compute @workgroup_size(WORKGROUP)
fn find_leaves(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= search.entries {
        return;
    }
    let place = place_of(list[i]);
    if place - search.first_voxel >= search.voxels || rows_of[place] == NOTHING {
        return;
    }
    let at = rows_of[place] * ROW_WORDS;
    var color = 0xffffffffu;
    if WANT_COLOR {
        color = rows[at + ROW_COLOR];
    }
    var normal = vec3<i32>(0);
    if WANT_NORMAL {
        normal = vec3<i32>(component(at + ROW_NORMAL), component(at + ROW_NORMAL + 1u), component(at + ROW_NORMAL + 2u));
    }
    leaves[i] = leaf_of(color, normal);
}
