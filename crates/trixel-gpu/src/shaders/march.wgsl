// Rays to the first set voxel, exactly: the twin of `Octree::march` on rays of integers. `octree_cell.wgsl` or
// `brick_cell.wgsl` tells what is at a voxel.
//
// A ray's parameter t is a fraction whose denominator is one of the direction's components; fractions are compared by
// products of 64 bits, so that a ray through an edge or a corner takes the same way on every device.

struct March {
    // The cube that rays may meet is 2^height voxels wide.
    height: u32,
    // Where an octree has no nodes: whether every voxel is set.
    everything: u32,
    // Nodes of an octree, bricks of a map.
    nodes: u32,
    rays: u32,
}

// What is at a voxel: it is set, or nothing is in the cube of 2^level voxels around it.
struct Place {
    is_set: bool,
    level: u32,
}

// num / den along an axis, den above 0.
struct Fraction {
    num: i32,
    den: i32,
}

@group(0) @binding(0) var<uniform> tree: March;
// Six words a ray: the origin in steps, 256 a voxel, and the direction.
@group(0) @binding(1) var<storage, read> rays: array<i32>;
// Six words a ray: one of the four below, the voxel in two words as a list has it, the axis, and the parameter's fraction.
@group(0) @binding(2) var<storage, read_write> hits: array<u32>;

const NEW: u32 = 0u;
const HIT: u32 = 1u;
const MISSED: u32 = 2u;
// Goes on from the fraction in another dispatch.
const UNDECIDED: u32 = 3u;

// Cubes that a ray crosses in one dispatch. Each takes some 40 iterations of loops, of which some drivers finish 65535.
const STEPS: u32 = 1000u;

fn less(a: Fraction, b: Fraction) -> bool {
    return i64_is_negative(i64_sub(i64_mul(a.num, b.den), i64_mul(b.num, a.den)));
}

// Where the ray passes a plane, in voxels, of one axis.
fn passing(plane: i32, o: i32, d: i32) -> Fraction {
    let way = plane * 256 - o;
    return Fraction(select(way, -way, d < 0), abs(d));
}

// The voxel along one axis that the ray is in just behind t.
fn voxel_behind(t: Fraction, o: i32, d: i32) -> i32 {
    // In steps times den.
    var there = i64_add(i64_mul(o, t.den), i64_mul(d, t.num));
    if d < 0 {
        // On a boundary it enters the voxel below.
        there = i64_sub(there, vec2<u32>(1u, 0u));
    }
    if i64_is_negative(there) {
        return -1;
    }
    return i32(u64_divide(there, vec2<u32>(u32(t.den) * 256u, 0u)));
}

// The last entry and the first exit of a box.
struct Span {
    enters: Fraction,
    axis: u32,
    leaves: Fraction,
    meets: bool,
}

fn span_of(low: vec3<i32>, width: i32, o: vec3<i32>, d: vec3<i32>) -> Span {
    var s = Span(Fraction(0, 1), 0u, Fraction(0x7fffffff, 1), true);
    for (var i = 0u; i < 3u; i++) {
        if d[i] == 0 {
            s.meets = s.meets && o[i] >= low[i] * 256 && o[i] < (low[i] + width) * 256;
            continue;
        }
        let near = passing(select(low[i] + width, low[i], d[i] > 0), o[i], d[i]);
        let far = passing(select(low[i], low[i] + width, d[i] > 0), o[i], d[i]);
        if less(s.enters, near) {
            s.enters = near;
            s.axis = i;
        }
        if less(far, s.leaves) {
            s.leaves = far;
        }
    }
    s.meets = s.meets && less(s.enters, s.leaves);
    return s;
}

@compute @workgroup_size(WORKGROUP)
fn march_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let ray = invocation(group, groups, local);
    if ray >= tree.rays || hits[6u * ray] == HIT || hits[6u * ray] == MISSED {
        return;
    }
    let goes_on = hits[6u * ray] == UNDECIDED;
    hits[6u * ray] = MISSED;
    let o = vec3<i32>(rays[6u * ray], rays[6u * ray + 1u], rays[6u * ray + 2u]);
    let d = vec3<i32>(rays[6u * ray + 3u], rays[6u * ray + 4u], rays[6u * ray + 5u]);
    let size = 1i << tree.height;
    var span = span_of(vec3<i32>(0), size, o, d);
    if all(d == vec3<i32>(0)) || !span.meets {
        return;
    }
    if goes_on {
        span.enters = Fraction(bitcast<i32>(hits[6u * ray + 4u]), bitcast<i32>(hits[6u * ray + 5u]));
    }
    // The voxel behind the entry, and then behind the exit of each empty cube: a box that the ray crosses for certain.
    for (var step = 0u; step < STEPS; step++) {
        let t = span.enters;
        let v = vec3<i32>(
            voxel_behind(t, o.x, d.x),
            voxel_behind(t, o.y, d.y),
            voxel_behind(t, o.z, d.z),
        );
        if any(v < vec3<i32>(0)) || any(v >= vec3<i32>(size)) {
            return;
        }
        let place = place_of(vec3<u32>(v));
        if place.is_set {
            let own = span_of(v, 1, o, d);
            let entry = entry_of(vec3<u32>(v));
            hits[6u * ray] = HIT;
            hits[6u * ray + 1u] = entry.x;
            hits[6u * ray + 2u] = entry.y;
            hits[6u * ray + 3u] = own.axis;
            hits[6u * ray + 4u] = bitcast<u32>(own.enters.num);
            hits[6u * ray + 5u] = bitcast<u32>(own.enters.den);
            return;
        }
        let low = (v >> vec3<u32>(place.level)) << vec3<u32>(place.level);
        span.enters = span_of(low, 1i << place.level, o, d).leaves;
    }
    hits[6u * ray] = UNDECIDED;
    hits[6u * ray + 4u] = bitcast<u32>(span.enters.num);
    hits[6u * ray + 5u] = bitcast<u32>(span.enters.den);
}
