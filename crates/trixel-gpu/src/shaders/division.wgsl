// Shifts, quotients and roots of wide integers, exact: floats only give a first guess.

fn i64_at_most(a: vec2<u32>, b: vec2<u32>) -> bool {
    return !i64_is_negative(i64_sub(b, a));
}

fn i64_is_positive(a: vec2<u32>) -> bool {
    return !i64_is_negative(a) && !i64_is_zero(a);
}

// How many bits a number has that is not negative.
fn u64_bits(a: vec2<u32>) -> u32 {
    return select(32u - countLeadingZeros(a.x), 64u - countLeadingZeros(a.y), a.y != 0u);
}

// a / 2^n, rounded down, for n below 64.
fn i64_shift_right(a: vec2<u32>, n: u32) -> vec2<u32> {
    let high = bitcast<i32>(a.y);
    let m = n & 31u;
    let sign = bitcast<u32>(high >> 31u);
    let moved = bitcast<u32>(high >> m);
    let low = (a.x >> m) | select(a.y << ((32u - m) & 31u), 0u, m == 0u);
    return select(vec2<u32>(low, moved), vec2<u32>(moved, sign), n >= 32u);
}

// The lowest word of a / 2^n for a 96-bit number that is not negative and n below 96.
fn u96_shift_right(a: vec3<u32>, n: u32) -> u32 {
    var pair = a.xy;
    if n >= 64u {
        pair = vec2<u32>(a.z, 0u);
    } else if n >= 32u {
        pair = a.yz;
    }
    let m = n & 31u;
    return (pair.x >> m) | select(pair.y << ((32u - m) & 31u), 0u, m == 0u);
}

// The lowest 64 bits of a * b.
fn u64_times(a: vec2<u32>, b: u32) -> vec2<u32> {
    let low = mul_u32(a.x, b);
    return vec2<u32>(low.x, low.y + a.y * b);
}

fn u64_to_f32(a: vec2<u32>) -> f32 {
    return f32(a.y) * 4294967296.0 + f32(a.x);
}

// floor(n / d) below 2^32, for n and d below 2^62 and d above 0. The guess is within 2^-20 of the quotient, what it leaves
// is divided once more, and after that at most 2 are missing.
fn u64_divide(n: vec2<u32>, d: vec2<u32>) -> u32 {
    let divisor = u64_to_f32(d);
    // The largest float below 2^32.
    var q = u32(clamp(u64_to_f32(n) / divisor, 0.0, 4294967040.0));
    let left = i64_sub(n, u64_times(d, q));
    q = bitcast<u32>(bitcast<i32>(q) + i32(floor(i64_to_f32(left) / divisor)));
    var rest = i64_sub(n, u64_times(d, q));
    for (var i = 0u; i < 2u; i++) {
        if i64_is_negative(rest) {
            rest = i64_add(rest, d);
            q -= 1u;
        }
    }
    for (var i = 0u; i < 2u; i++) {
        if i64_at_most(d, rest) {
            rest = i64_sub(rest, d);
            q += 1u;
        }
    }
    return q;
}

// floor(a / b) for b above 0.
fn floor_divide(a: i32, b: i32) -> i32 {
    let q = a / b;
    return select(q, q - 1, a < q * b);
}

// floor(sqrt(n)) for n below 2^62.
fn u64_root(n: vec2<u32>) -> u32 {
    var root = u32(sqrt(u64_to_f32(n)));
    // The guess is within 2^-20.
    for (var i = 0u; i < 4096u; i++) {
        if u64_less(n, mul_u32(root, root)) {
            root -= 1u;
        } else if !u64_less(n, mul_u32(root + 1u, root + 1u)) {
            root += 1u;
        } else {
            break;
        }
    }
    return root;
}
