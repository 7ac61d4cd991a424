// Integers wider than WGSL has, in two's complement, low word first: 64 bits in a vec2<u32>, 96 in a vec3<u32>.
// The tier's product is prepended.

fn i64_from(a: i32) -> vec2<u32> {
    return vec2<u32>(bitcast<u32>(a), bitcast<u32>(a >> 31u));
}

fn i64_add(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn i64_sub(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(a.x - b.x, a.y - b.y - select(0u, 1u, a.x < b.x));
}

fn i64_mul(a: i32, b: i32) -> vec2<u32> {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let p = mul_u32(ua, ub);
    return vec2<u32>(p.x, p.y - select(0u, ub, a < 0) - select(0u, ua, b < 0));
}

fn i64_is_negative(a: vec2<u32>) -> bool {
    return bitcast<i32>(a.y) < 0;
}

fn i64_is_zero(a: vec2<u32>) -> bool {
    return (a.x | a.y) == 0u;
}

fn i64_neg(a: vec2<u32>) -> vec2<u32> {
    return i64_sub(vec2<u32>(0u, 0u), a);
}

fn i64_abs(a: vec2<u32>) -> vec2<u32> {
    return select(a, i64_neg(a), i64_is_negative(a));
}

// a < b, both taken as unsigned.
fn u64_less(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

// Within 2^-22 of the value: through the magnitude, because the words of a small negative number cancel.
fn i64_to_f32(a: vec2<u32>) -> f32 {
    let m = i64_abs(a);
    let f = f32(m.y) * 4294967296.0 + f32(m.x);
    return select(f, -f, i64_is_negative(a));
}

fn i96_add(a: vec3<u32>, b: vec3<u32>) -> vec3<u32> {
    let x = a.x + b.x;
    let carry_x = select(0u, 1u, x < a.x);
    let y = a.y + b.y;
    let carry_y = select(0u, 1u, y < a.y);
    let y_all = y + carry_x;
    let carry = carry_y + select(0u, 1u, y_all < y);
    return vec3<u32>(x, y_all, a.z + b.z + carry);
}

fn i96_neg(a: vec3<u32>) -> vec3<u32> {
    return i96_add(~a, vec3<u32>(1u, 0u, 0u));
}

fn i96_is_negative(a: vec3<u32>) -> bool {
    return bitcast<i32>(a.z) < 0;
}

fn i96_mul(a: vec2<u32>, b: i32) -> vec3<u32> {
    let m = bitcast<u32>(b);
    let low = mul_u32(a.x, m);
    let high = mul_u32(a.y, m);
    let y = low.y + high.x;
    var product = vec3<u32>(low.x, y, high.y + select(0u, 1u, y < low.y));
    // The words were multiplied as unsigned numbers: take away what the sign bits were wrongly worth.
    let minus_a = i64_sub(product.yz, a);
    product = select(product, vec3<u32>(product.x, minus_a), b < 0);
    product.z -= select(0u, m, i64_is_negative(a));
    return product;
}

// Within 2^-21 of the value.
fn i96_to_f32(a: vec3<u32>) -> f32 {
    let negative = i96_is_negative(a);
    let m = select(a, i96_neg(a), negative);
    let f = (f32(m.z) * 4294967296.0 + f32(m.y)) * 4294967296.0 + f32(m.x);
    return select(f, -f, negative);
}

// The lowest 96 bits of a product.
fn i96_product(a: vec2<u32>, b: vec2<u32>) -> vec3<u32> {
    var product = vec3<u32>(mul_u32(a.x, b.x), a.y * b.y);
    product = i96_add(product, vec3<u32>(0u, mul_u32(a.x, b.y)));
    product = i96_add(product, vec3<u32>(0u, mul_u32(a.y, b.x)));
    // As in i96_mul.
    product.z -= select(0u, b.x, i64_is_negative(a)) + select(0u, a.x, i64_is_negative(b));
    return product;
}

fn i96_sub(a: vec3<u32>, b: vec3<u32>) -> vec3<u32> {
    return i96_add(a, i96_neg(b));
}
