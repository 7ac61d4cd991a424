// The point of a triangle nearest to a voxel's centre, and its distance: the twin of `nearest.rs`, which has the definition.
// Triangles are shorter than 2^29 steps (MAX_EXTENT in limits.rs), so that 64 and 96 bits hold what follows.

// The weight of the whole.
const ONE: u32 = 65536u;

struct Nearest {
    // Corners in steps from the low corner of voxel `base`.
    v0: vec3<i32>,
    v1: vec3<i32>,
    v2: vec3<i32>,
    base: vec3<i32>,
    shift: u32,
}

fn nearest_of(t: Corners) -> Nearest {
    let low = min(min(t.v0, t.v1), t.v2);
    let extent = max(max(t.v0, t.v1), t.v2) - low;
    let longest = max(max(extent.x, extent.y), extent.z);
    let bits = i32(32u - countLeadingZeros(u32(longest)));
    let base = low >> vec3<u32>(16u);
    let corner = base * 65536;
    return Nearest(t.v0 - corner, t.v1 - corner, t.v2 - corner, base, u32(clamp(bits - 13, 2, 9)));
}

fn dot_i64(u: vec3<i32>, v: vec3<i32>) -> vec2<u32> {
    return i64_add(i64_add(i64_mul(u.x, v.x), i64_mul(u.y, v.y)), i64_mul(u.z, v.z));
}

fn i96_from(a: vec2<u32>) -> vec3<u32> {
    return vec3<u32>(a, select(0u, 0xffffffffu, i64_is_negative(a)));
}

// part / whole in weights, rounded; 0 when the whole is not positive.
fn ratio_96(part: vec3<u32>, whole: vec3<u32>) -> u32 {
    if i96_is_negative(whole) || all(whole == vec3<u32>(0u)) || i96_is_negative(part) {
        return 0u;
    }
    if i96_is_negative(i96_sub(whole, part)) {
        return ONE;
    }
    let bits = select(u64_bits(whole.xy), 96u - countLeadingZeros(whole.z), whole.z != 0u);
    let shift = max(bits, 31u) - 31u;
    let divisor = u96_shift_right(whole, shift);
    var rest = u96_shift_right(part, shift);
    // One bit of the quotient after the other; the last one rounds.
    var quotient = rest / divisor;
    rest -= quotient * divisor;
    for (var i = 0u; i < 17u; i++) {
        rest <<= 1u;
        let bit = select(0u, 1u, rest >= divisor);
        rest -= bit * divisor;
        quotient = (quotient << 1u) | bit;
    }
    return min((quotient + 1u) >> 1u, ONE);
}

fn ratio(part: vec2<u32>, whole: vec2<u32>) -> u32 {
    return ratio_96(i96_from(part), i96_from(whole));
}

fn round_to(v: vec3<i32>, shift: u32) -> vec3<i32> {
    return (v + vec3<i32>(1 << (shift - 1u))) >> vec3<u32>(shift);
}

// The weights of the point nearest to a voxel's centre.
fn weights_at(n: Nearest, voxel: vec3<i32>) -> vec3<u32> {
    let a = round_to(n.v0, n.shift);
    let ab = round_to(n.v1, n.shift) - a;
    let ac = round_to(n.v2, n.shift) - a;
    let ap = ((voxel - n.base) << vec3<u32>(16u - n.shift)) + vec3<i32>(1 << (15u - n.shift)) - a;
    let ab_ab = dot_i64(ab, ab);
    let ab_ac = dot_i64(ab, ac);
    let ac_ac = dot_i64(ac, ac);
    let zero = vec2<u32>(0u);
    let a1 = dot_i64(ab, ap);
    let a2 = dot_i64(ac, ap);
    let b1 = i64_sub(a1, ab_ab);
    let b2 = i64_sub(a2, ab_ac);
    let c1 = i64_sub(a1, ab_ac);
    let c2 = i64_sub(a2, ac_ac);
    if i64_at_most(a1, zero) && i64_at_most(a2, zero) {
        return vec3<u32>(ONE, 0u, 0u);
    }
    if i64_at_most(zero, b1) && i64_at_most(b2, b1) {
        return vec3<u32>(0u, ONE, 0u);
    }
    if i64_at_most(zero, c2) && i64_at_most(c1, c2) {
        return vec3<u32>(0u, 0u, ONE);
    }
    let zero_96 = vec3<u32>(0u);
    let for_c = i96_sub(i96_product(a1, b2), i96_product(b1, a2));
    let c_outside = i96_is_negative(for_c) || all(for_c == zero_96);
    if c_outside && i64_at_most(zero, a1) && i64_at_most(b1, zero) && i64_is_positive(ab_ab) {
        let b = ratio(a1, ab_ab);
        return vec3<u32>(ONE - b, b, 0u);
    }
    let for_b = i96_sub(i96_product(c1, a2), i96_product(a1, c2));
    let b_outside = i96_is_negative(for_b) || all(for_b == zero_96);
    if b_outside && i64_at_most(zero, a2) && i64_at_most(c2, zero) && i64_is_positive(ac_ac) {
        let c = ratio(a2, ac_ac);
        return vec3<u32>(ONE - c, 0u, c);
    }
    let for_a = i96_sub(i96_product(b1, c2), i96_product(c1, b2));
    let a_outside = i96_is_negative(for_a) || all(for_a == zero_96);
    let towards_c = i64_sub(b2, b1);
    let towards_b = i64_sub(c1, c2);
    if a_outside && i64_at_most(zero, towards_c) && i64_at_most(zero, towards_b) {
        let c = ratio(towards_c, i64_add(towards_c, towards_b));
        return vec3<u32>(0u, ONE - c, c);
    }
    let whole = i96_add(i96_add(for_a, for_b), for_c);
    let b = ratio_96(for_b, whole);
    let c = min(ratio_96(for_c, whole), ONE - b);
    return vec3<u32>(ONE - b - c, b, c);
}

fn squared_offset(w: vec3<u32>, q: vec3<i32>) -> u32 {
    var sum = i64_add(i64_add(i64_mul(i32(w.x), q.x), i64_mul(i32(w.y), q.y)), i64_mul(i32(w.z), q.z));
    sum = i64_shift_right(i64_add(sum, vec2<u32>(1u << 19u, 0u)), 20u);
    let offset = u32(abs(bitcast<i32>(sum.x)));
    return select(offset * offset, 0xffffffffu, offset >= 65536u);
}

fn add_saturated(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, a + b < a);
}

// The squared distance of that point from the centre, in (2^-12 voxels)^2; 2^32 - 1 from 16 voxels on.
fn distance_at(n: Nearest, voxel: vec3<i32>, w: vec3<u32>) -> u32 {
    let centre = (voxel - n.base) * 65536 + 32768;
    let p = n.v0 - centre;
    let q = n.v1 - centre;
    let r = n.v2 - centre;
    let x = squared_offset(w, vec3<i32>(p.x, q.x, r.x));
    let y = squared_offset(w, vec3<i32>(p.y, q.y, r.y));
    let z = squared_offset(w, vec3<i32>(p.z, q.z, r.z));
    return add_saturated(add_saturated(x, y), z);
}
