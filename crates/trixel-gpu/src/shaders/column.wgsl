// One column of one triangle: the exact test, and the voxels that pass it.

// For three edges at once: n.p >= t, with n and t cut in halves of 16 bits so that nothing leaves 32.
fn edges_pass(na: vec3<i32>, nb: vec3<i32>, t_high: vec3<i32>, t_low: vec3<u32>, a: i32, b: i32) -> bool {
    if SMALL {
        return all(na * a + nb * b >= t_high);
    }
    let mask = vec3<i32>(0xffff);
    let shift = vec3<u32>(16u);
    let low = (na & mask) * a + (nb & mask) * b - vec3<i32>(t_low);
    let high = (na >> shift) * a + (nb >> shift) * b - t_high + (low >> shift);
    return all(high >= vec3<i32>(0));
}

fn ab_pass(t: Triangle, a: i32, b: i32) -> bool {
    let low = vec3<u32>(t.low_0.x, t.low_1.x, t.low_2.x) & vec3<u32>(0xffffu);
    return edges_pass(-t.eb, t.ea, t.ab_high, low, a, b);
}

fn bc_pass(t: Triangle, b: i32, c: i32) -> bool {
    let low = vec3<u32>(t.low_0.x, t.low_1.x, t.low_2.x) >> vec3<u32>(16u);
    let s = select(1, -1, (t.flags & NORMAL_A_NEGATIVE) != 0u);
    return edges_pass(-s * t.ec, s * t.eb, t.bc_high, low, b, c);
}

fn ca_pass(t: Triangle, c: i32, a: i32) -> bool {
    let low = vec3<u32>(t.low_0.y, t.low_1.y, t.low_2.y);
    let s = select(1, -1, (t.flags & NORMAL_B_NEGATIVE) != 0u);
    return edges_pass(-s * t.ea, s * t.ec, t.ca_high, low, c, a);
}

// The smallest c with N.(S p - w0 + shift) >= minimum (0 or 1), exactly. `guess` may be off by thousands.
//
// The first residual, exact but rounded to f32, moves the guess to within one of the answer; the second decides.
fn exact_ceil(t: Triangle, a: i32, b: i32, shift: vec3<i32>, minimum: u32, guess: i32) -> i32 {
    let na = cross_i64(t.eb.x, t.ec.x, t.eb.y, t.ec.y);
    let nb = cross_i64(t.ec.x, t.ea.x, t.ec.y, t.ea.y);
    let nc = cross_i64(t.ea.x, t.eb.x, t.ea.y, t.eb.y);
    let m = vec3<i32>(a, b, guess) * STEPS - t.w0 + shift;
    var f = i96_add(i96_add(i96_mul(na, m.x), i96_mul(nb, m.y)), i96_mul(nc, m.z));
    if minimum == 1u {
        f = i96_add(f, vec3<u32>(0xffffffffu));
    }
    let step = i32(ceil(-i96_to_f32(f) / (i64_to_f32(nc) * f32(STEPS))));
    f = i96_add(f, i96_mul(nc, step * STEPS));
    if i96_is_negative(f) {
        return guess + step + 1;
    }
    let previous = i96_add(f, i96_mul(nc, -STEPS));
    return guess + step - select(1, 0, i96_is_negative(previous));
}

// The lowest and highest voxel that the plane allows in a column, within low..high.
fn depth_range(t: Triangle, a: i32, b: i32, low: i32, high: i32) -> vec2<i32> {
    let slope = t.plane.z * f32(a) + t.plane.w * f32(b);
    let degenerate = (t.flags & DEGENERATE) != 0u;
    let a_negative = (t.flags & NORMAL_A_NEGATIVE) != 0u;
    let b_negative = (t.flags & NORMAL_B_NEGATIVE) != 0u;
    let floor_low = f32(low - 1);
    let ceil_high = f32(high + 1);

    let lower = t.plane.x - slope;
    var first = i32(clamp(ceil(lower - t.error), floor_low + 1.0, ceil_high));
    let first_other = i32(clamp(ceil(lower + t.error), floor_low + 1.0, ceil_high));
    if first != first_other && !degenerate {
        let shift = lower_shift(!a_negative, !b_negative);
        first = clamp(exact_ceil(t, a, b, shift, 0u, first), low, high + 1);
    }
    if MODE == SOLID {
        return vec2<i32>(first, first);
    }
    let upper = t.plane.y - slope;
    var last = i32(clamp(floor(upper + t.error), floor_low, ceil_high - 1.0));
    let last_other = i32(clamp(floor(upper - t.error), floor_low, ceil_high - 1.0));
    if last != last_other && !degenerate {
        let shift = upper_shift(a_negative, b_negative);
        last = clamp(exact_ceil(t, a, b, shift, 1u, last) - 1, low - 1, high);
    }
    return vec2<i32>(first, last);
}

// Sets, or in mode solid toggles, what the triangle covers of its column (a, b); false if that is nothing.
fn voxelize_column(t: Triangle, a: i32, b: i32) -> bool {
    count_column();
    if !ab_pass(t, a, b) {
        return false;
    }
    let axis = t.flags & AXIS_MASK;
    let slab_from = swizzle(slab_low(), axis).z - t.base.z;
    let slab_to = swizzle(slab_high(), axis).z - t.base.z;
    if MODE == SOLID {
        // What lies below the grid still toggles the whole column, from the grid's lowest voxel on.
        let first = max(depth_range(t, a, b, 0, t.extent.z + 1).x, -t.base.z);
        if first < slab_from || first > slab_to {
            return false;
        }
        toggle_voxel(t.base + vec3<i32>(a, b, first));
        return true;
    }
    let reach = overlap_voxels();
    let low = max(-reach, slab_from);
    let high = min(t.extent.z + reach, slab_to);
    if low > high {
        return false;
    }
    let range = depth_range(t, a, b, low, high);
    if range.x > range.y {
        return false;
    }
    if MODE == SLICED {
        set_run(t.base.xy + vec2<i32>(a, b), t.base.z + range.x, t.base.z + range.y);
        return true;
    }
    if MODE == SHELL {
        // Thrice the width of the cubes above each other at most, and one more for the rounding.
        var met = false;
        for (var c = range.x; c <= range.y; c++) {
            if visit(t, a, b, c, range.y) == 1u {
                set_across(t.base + vec3<i32>(a, b, c), axis, 1u, 0);
                met = true;
            }
        }
        return met;
    }
    // The plane of the dominant axis leaves at most four.
    var bits = visit(t, a, b, range.x, range.y) | visit(t, a, b, range.x + 1, range.y) << 1u;
    if range.x + 2 <= range.y {
        bits |= visit(t, a, b, range.x + 2, range.y) << 2u | visit(t, a, b, range.x + 3, range.y) << 3u;
    }
    if bits == 0u {
        return false;
    }
    let voxel = t.base + vec3<i32>(a, b, range.x);
    if axis == 2u {
        set_bits(voxel.xy, voxel.z, bits);
    } else {
        set_across(voxel, axis, bits, 0);
        set_across(voxel, axis, bits, 1);
        set_across(voxel, axis, bits, 2);
        set_across(voxel, axis, bits, 3);
    }
    return true;
}

// 1 if the voxel passes the two projections that are left, else 0.
fn visit(t: Triangle, a: i32, b: i32, c: i32, last: i32) -> u32 {
    if c > last {
        return 0u;
    }
    count_voxel();
    return select(0u, 1u, bc_pass(t, b, c) && ca_pass(t, c, a));
}

fn set_across(voxel: vec3<i32>, axis: u32, bits: u32, i: i32) {
    if (bits >> u32(i) & 1u) == 1u {
        let v = unswizzle(voxel + vec3<i32>(0, 0, i), axis);
        set_bits(v.xy, v.z, 1u);
    }
}
