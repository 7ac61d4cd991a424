// One triangle made ready: what [HCV] figures 6.1 and 6.2 compute before their loops, in integers.
//
// All coordinates are swizzled to (a, b, c) with columns along c, and local: voxel indices count from `base`, the low
// corner of the triangle's box of voxels. Extents below 2^29 steps (MAX_EXTENT in limits.rs) keep every 32-bit number
// here in range. Where SMALL, they are below 2^22 (64 voxels), and fewer numbers need to be cut in halves. Where FLAT, the box
// is known to be one voxel thick, and the columns run across it.

struct Triangle {
    // Components of the three edges; edge k starts at corner k.
    ea: vec3<i32>,
    eb: vec3<i32>,
    ec: vec3<i32>,
    // Thresholds t of `n.p >= t` for the three edges in a projection, as t = high * 2^16 + low; where SMALL, all of t.
    ab_high: vec3<i32>,
    bc_high: vec3<i32>,
    ca_high: vec3<i32>,
    // ab in the low half of x, bc in its high half; ca in y.
    low_0: vec2<u32>,
    low_1: vec2<u32>,
    low_2: vec2<u32>,
    base: vec3<i32>,
    // The highest local voxel of the box.
    extent: vec3<i32>,
    // Corner 0, local, in steps.
    w0: vec3<i32>,
    // The lowest voxel of column (a, b) is ceil(plane.x - plane.z a - plane.w b), the highest floor(plane.y - ...).
    plane: vec4<f32>,
    // How far those two real numbers may be off.
    error: f32,
    // The axis of the columns, and the bits below.
    flags: u32,
}

const AXIS_MASK: u32 = 3u;
const NORMAL_A_NEGATIVE: u32 = 4u;
const NORMAL_B_NEGATIVE: u32 = 8u;
const DEGENERATE: u32 = 16u;
// Sets nothing: outside of the slab, or seen edge-on by a mode that looks along z.
const EMPTY: u32 = 32u;
const TOO_LARGE: u32 = 64u;

// What is cheap to know, and enough to judge a triangle's size.
struct Shape {
    // Swizzled corners, turning left in (a, b).
    v0: vec3<i32>,
    v1: vec3<i32>,
    v2: vec3<i32>,
    // The normal; n_c is not negative.
    na: vec2<u32>,
    nb: vec2<u32>,
    nc: vec2<u32>,
    base: vec3<i32>,
    extent: vec3<i32>,
    flags: u32,
}

fn looks_along_z() -> bool {
    return MODE == SOLID || MODE == SLICED;
}

fn overlap_voxels() -> i32 {
    return select(0, (params.overlap + STEPS - 1) >> 16u, MODE == SLICED);
}

fn cross_i64(a0: i32, b0: i32, a1: i32, b1: i32) -> vec2<u32> {
    return i64_sub(i64_mul(a0, b1), i64_mul(b0, a1));
}

fn shape_of(t: Corners) -> Shape {
    var s: Shape;
    let low = min(min(t.v0, t.v1), t.v2);
    let high = max(max(t.v0, t.v1), t.v2);
    let grow = select(0, STEPS / 2, MODE == SHELL);
    let base = (low - grow - 1) >> vec3<u32>(16u);
    let top = (high + grow) >> vec3<u32>(16u);
    // A solid's triangle below the grid still toggles its columns, all of them from the bottom.
    let reach = overlap_voxels();
    let outside = any(base.xy > slab_high().xy) || any(top.xy < slab_low().xy) || base.z - reach > slab_high().z
        || (MODE != SOLID && top.z + reach < 0);
    if outside {
        s.flags = EMPTY;
        return s;
    }
    if any(bitcast<vec3<u32>>(high - low) >= vec3<u32>(MAX_EXTENT)) {
        s.flags = EMPTY | TOO_LARGE;
        return s;
    }
    let e0 = t.v1 - t.v0;
    let e1 = t.v2 - t.v1;
    let nx = cross_i64(e0.y, e0.z, e1.y, e1.z);
    let ny = cross_i64(e0.z, e0.x, e1.z, e1.x);
    let nz = cross_i64(e0.x, e0.y, e1.x, e1.y);
    var axis = 2u;
    var flags = 0u;
    if looks_along_z() {
        if i64_is_zero(nz) {
            s.flags = EMPTY;
            return s;
        }
    } else if i64_is_zero(nx | ny | nz) {
        // A segment or a point: b is the axis along which it is longest, so that one column meets little of it.
        let size = high - low;
        flags = DEGENERATE;
        axis = 0u;
        if size.x >= size.y && size.x >= size.z {
            axis = 1u;
        } else if size.y >= size.z {
            axis = 2u;
        }
    } else {
        let x = i64_abs(nx);
        let y = i64_abs(ny);
        let z = i64_abs(nz);
        if u64_less(z, x) || u64_less(z, y) {
            axis = select(0u, 1u, u64_less(x, y));
        }
    }
    if FLAT {
        let size = top - base;
        axis = select(select(2u, 1u, size.y == 0), 0u, size.x == 0);
    }
    s.v0 = swizzle(t.v0, axis);
    s.v1 = swizzle(t.v1, axis);
    s.v2 = swizzle(t.v2, axis);
    s.na = select(select(nx, ny, axis == 0u), nz, axis == 1u);
    s.nb = select(select(ny, nz, axis == 0u), nx, axis == 1u);
    s.nc = select(select(nz, nx, axis == 0u), ny, axis == 1u);
    if i64_is_negative(s.nc) {
        let v = s.v1;
        s.v1 = s.v2;
        s.v2 = v;
        s.na = i64_neg(s.na);
        s.nb = i64_neg(s.nb);
        s.nc = i64_neg(s.nc);
    }
    s.base = swizzle(base, axis);
    s.extent = swizzle(top, axis) - s.base;
    s.flags = flags | axis | select(0u, NORMAL_A_NEGATIVE, i64_is_negative(s.na))
        | select(0u, NORMAL_B_NEGATIVE, i64_is_negative(s.nb));
    return s;
}

// The columns of the triangle's box within the slab: local (a, b) from .xy to .zw, none if .z < .x or .w < .y.
fn column_rect(base: vec3<i32>, extent: vec3<i32>, axis: u32) -> vec4<i32> {
    let low = max(swizzle(slab_low(), axis) - base, vec3<i32>(0));
    let high = min(swizzle(slab_high(), axis) - base, extent);
    return vec4<i32>(low.xy, high.xy);
}

// Whether SMALL arithmetic suffices.
fn is_small(extent: vec3<i32>) -> bool {
    return all(extent < vec3<i32>(64));
}

fn rect_columns(rect: vec4<i32>) -> u32 {
    let size = max(rect.zw - rect.xy + 1, vec2<i32>(0));
    return u32(size.x) * u32(size.y);
}

// t of `n.p >= t` for the edge with inward normal (na, nb) through (va, vb): DESIGN section 1. As (high, low) halves, or
// where SMALL whole in the first.
fn edge_threshold(na: i32, nb: i32, va: i32, vb: i32) -> vec2<i32> {
    // t = ceil((nv - reach S / 2) / S): of nv + round - reach S / 2, the bits above the 16 lowest.
    var reach = na + nb;
    var round = STEPS - 1;
    if MODE == CONSERVATIVE {
        reach = 2 * (max(na, 0) + max(nb, 0));
    } else if MODE == SHELL {
        reach += 2 * (abs(na) + abs(nb));
    } else if MODE == THIN {
        reach += max(abs(na), abs(nb));
    } else if !(na > 0 || (na == 0 && nb > 0)) {
        // The centre on this edge is outside.
        round = STEPS;
    }
    if SMALL {
        // Every number is cut at 16 bits; only products of two low halves need all 32.
        let a = u32(na & 0xffff) * u32(va & 0xffff);
        let b = u32(nb & 0xffff) * u32(vb & 0xffff);
        let low = i32(a & 0xffffu) + i32(b & 0xffffu) + (((-reach) & 1) << 15u) + round;
        let high = i32(a >> 16u) + i32(b >> 16u) + (na >> 16u) * (va & 0xffff) + (nb >> 16u) * (vb & 0xffff);
        let whole = na * (va >> 16u) + nb * (vb >> 16u) + ((-reach) >> 1u);
        return vec2<i32>(whole + high + (low >> 16u), 0);
    }
    var t = i64_add(i64_mul(na, va), i64_mul(nb, vb));
    t = i64_add(t, vec2<u32>(u32(round), 0u));
    t = i64_sub(t, vec2<u32>(bitcast<u32>(reach) << 15u, bitcast<u32>(reach >> 17u)));
    return vec2<i32>(bitcast<i32>(t.y), i32(t.x >> 16u));
}

fn triangle_of(s: Shape) -> Triangle {
    var t: Triangle;
    t.base = s.base;
    t.extent = s.extent;
    t.flags = s.flags;
    let w0 = s.v0 - s.base * STEPS;
    let w1 = s.v1 - s.base * STEPS;
    let w2 = s.v2 - s.base * STEPS;
    t.w0 = w0;
    t.ea = vec3<i32>(w1.x - w0.x, w2.x - w1.x, w0.x - w2.x);
    t.eb = vec3<i32>(w1.y - w0.y, w2.y - w1.y, w0.y - w2.y);
    t.ec = vec3<i32>(w1.z - w0.z, w2.z - w1.z, w0.z - w2.z);

    let ab_0 = edge_threshold(-t.eb.x, t.ea.x, w0.x, w0.y);
    let ab_1 = edge_threshold(-t.eb.y, t.ea.y, w1.x, w1.y);
    let ab_2 = edge_threshold(-t.eb.z, t.ea.z, w2.x, w2.y);
    t.ab_high = vec3<i32>(ab_0.x, ab_1.x, ab_2.x);
    var low = vec3<u32>(u32(ab_0.y), u32(ab_1.y), u32(ab_2.y));
    if !looks_along_z() {
        let sa = select(1, -1, (t.flags & NORMAL_A_NEGATIVE) != 0u);
        let bc_0 = edge_threshold(-sa * t.ec.x, sa * t.eb.x, w0.y, w0.z);
        let bc_1 = edge_threshold(-sa * t.ec.y, sa * t.eb.y, w1.y, w1.z);
        let bc_2 = edge_threshold(-sa * t.ec.z, sa * t.eb.z, w2.y, w2.z);
        t.bc_high = vec3<i32>(bc_0.x, bc_1.x, bc_2.x);
        low |= vec3<u32>(u32(bc_0.y), u32(bc_1.y), u32(bc_2.y)) << vec3<u32>(16u);
        let sb = select(1, -1, (t.flags & NORMAL_B_NEGATIVE) != 0u);
        let ca_0 = edge_threshold(-sb * t.ea.x, sb * t.ec.x, w0.z, w0.x);
        let ca_1 = edge_threshold(-sb * t.ea.y, sb * t.ec.y, w1.z, w1.x);
        let ca_2 = edge_threshold(-sb * t.ea.z, sb * t.ec.z, w2.z, w2.x);
        t.ca_high = vec3<i32>(ca_0.x, ca_1.x, ca_2.x);
        t.low_0.y = u32(ca_0.y);
        t.low_1.y = u32(ca_1.y);
        t.low_2.y = u32(ca_2.y);
    }
    t.low_0.x = low.x;
    t.low_1.x = low.y;
    t.low_2.x = low.z;

    // The plane as c = W_c + g_a (W_a - a) + g_b (W_b - b), in voxels, moved to the corner of the voxel that decides.
    var ga = 0.0;
    var gb = 0.0;
    if (t.flags & DEGENERATE) == 0u {
        let nc = i64_to_f32(s.nc);
        ga = i64_to_f32(s.na) / nc;
        gb = i64_to_f32(s.nb) / nc;
    } else {
        // Along the longest edge; the slab of width b..b+1 bounds the depth as a plane would.
        let size = abs(t.eb);
        var e = vec2<i32>(t.eb.z, t.ec.z);
        if size.x >= size.y && size.x >= size.z {
            e = vec2<i32>(t.eb.x, t.ec.x);
        } else if size.y >= size.z {
            e = vec2<i32>(t.eb.y, t.ec.y);
        }
        if e.x != 0 {
            gb = -f32(e.y) / f32(e.x);
        }
        t.flags &= ~(NORMAL_A_NEGATIVE | NORMAL_B_NEGATIVE);
    }
    let w = vec3<f32>(w0) / f32(STEPS);
    let lower = vec3<f32>(lower_shift(ga > 0.0, gb > 0.0)) / f32(STEPS);
    let upper = vec3<f32>(upper_shift(ga < 0.0, gb < 0.0)) / f32(STEPS);
    t.plane.x = w.z - lower.z + ga * (w.x - lower.x) + gb * (w.y - lower.y);
    t.plane.y = w.z - upper.z + ga * (w.x - upper.x) + gb * (w.y - upper.y);
    t.plane.z = ga;
    t.plane.w = gb;
    // Every term is within 2^-20 of itself, and none is larger than this sum (three voxels spare for the shifts).
    let reach = vec3<f32>(t.extent + 4);
    t.error = (abs(ga) * reach.x + abs(gb) * reach.y + reach.z + f32(overlap_voxels())) * 0x1p-18;
    return t;
}

// The point of a voxel, in steps from its low corner, at which the plane decides the lowest voxel of a column:
// the smallest c with N.(S p - w0 + shift) >= 0.
fn lower_shift(a_positive: bool, b_positive: bool) -> vec3<i32> {
    let half = STEPS / 2;
    switch MODE {
        case CONSERVATIVE: { return vec3<i32>(select(0, STEPS, a_positive), select(0, STEPS, b_positive), STEPS); }
        case THIN: { return vec3<i32>(half, half, STEPS); }
        case SOLID: { return vec3<i32>(half, half, half); }
        case SHELL: {
            let reach = STEPS + half;
            return vec3<i32>(select(-half, reach, a_positive), select(-half, reach, b_positive), reach);
        }
        default: { return vec3<i32>(half, half, STEPS + params.overlap); }
    }
}

// Likewise the highest: the largest c with N.(S p - w0 + shift) <= 0.
fn upper_shift(a_negative: bool, b_negative: bool) -> vec3<i32> {
    let half = STEPS / 2;
    switch MODE {
        case CONSERVATIVE: { return vec3<i32>(select(0, STEPS, a_negative), select(0, STEPS, b_negative), 0); }
        case THIN: { return vec3<i32>(half, half, 0); }
        case SOLID: { return vec3<i32>(half, half, half); }
        case SHELL: {
            let reach = STEPS + half;
            return vec3<i32>(select(-half, reach, a_negative), select(-half, reach, b_negative), -half);
        }
        default: { return vec3<i32>(half, half, -params.overlap); }
    }
}
