// [SS] M. Schwarz & H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010, section 4: sorts triangles by
// whether their boxes of voxels extend along one, two or three axes. Theirs are nine cases, three of them for each axis;
// [HCV]'s swizzle leaves three. What a single invocation cannot loop over is a fourth.
//
// First half of the sort: how many of each case a workgroup has, and the place of each triangle among its own.

// The case, and the number of equal ones before it in the workgroup, shifted by 8.
@group(1) @binding(0) var<storage, read_write> cases: array<u32>;
// For each case, one number a workgroup.
@group(1) @binding(1) var<storage, read_write> counts: array<u32>;

const LINE: u32 = 0u;
const FLAT_BOX: u32 = 1u;
const DEEP: u32 = 2u;
const LONG: u32 = 3u;
const NOTHING: u32 = 4u;

// Counts of the four cases in a byte each: 64 fit.
var<workgroup> tallies: array<u32, WORKGROUP>;

fn case_of(i: u32) -> u32 {
    if i >= params.triangles {
        return NOTHING;
    }
    let look = look_at(i);
    if look.columns == 0u {
        return NOTHING;
    }
    if !fits_one_invocation(look) {
        return LONG;
    }
    let axes = vec3<u32>(look.shape.extent > vec3<i32>(0));
    return max(axes.x + axes.y + axes.z, 1u) - 1u;
}

@compute @workgroup_size(WORKGROUP)
fn classify_cases(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    let own = case_of(i);
    var sum = select(0u, 1u << (8u * (own & 3u)), own != NOTHING);
    tallies[local] = sum;
    for (var reach = 1u; reach < WORKGROUP; reach <<= 1u) {
        workgroupBarrier();
        var lower = 0u;
        if local >= reach {
            lower = tallies[local - reach];
        }
        workgroupBarrier();
        sum += lower;
        tallies[local] = sum;
    }
    if i < params.triangles {
        let up_to_here = (sum >> (8u * (own & 3u))) & 0xffu;
        cases[i] = own | ((max(up_to_here, 1u) - 1u) << 8u);
    }
    let blocks = (params.triangles + WORKGROUP - 1u) / WORKGROUP;
    let block = i / WORKGROUP;
    if local == WORKGROUP - 1u && block < blocks {
        for (var c = 0u; c < NOTHING; c++) {
            counts[c * blocks + block] = (sum >> (8u * c)) & 0xffu;
        }
    }
}
