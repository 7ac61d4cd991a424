// Colours and directions as integers: the twin of `light.rs` and `vector.rs`.

// Full linear light, or an alpha of 1.
const FULL: u32 = 65535u;

// a * b of fractions of FULL, rounded.
fn multiply(a: u32, b: u32) -> u32 {
    let product = a * b + 32768u;
    return (product + (product >> 16u)) >> 16u;
}

fn times(a: vec4<u32>, b: vec4<u32>) -> vec4<u32> {
    return vec4<u32>(multiply(a.x, b.x), multiply(a.y, b.y), multiply(a.z, b.z), multiply(a.w, b.w));
}

fn linear_of_srgb(byte: u32) -> u32 {
    return (tables[work.linear_at + (byte >> 1u)] >> ((byte & 1u) * 16u)) & 0xffffu;
}

fn srgb_of_linear(value: u32) -> u32 {
    return (tables[work.srgb_at + (value >> 2u)] >> ((value & 3u) * 8u)) & 0xffu;
}

// The 8-bit sRGB colour, with alpha, of a linear one.
fn encode(color: vec4<u32>) -> u32 {
    let alpha = (color.w * 255u + 32767u) / 65535u;
    return srgb_of_linear(color.x) | (srgb_of_linear(color.y) << 8u) | (srgb_of_linear(color.z) << 16u) | (alpha << 24u);
}

// Three components of 64 bits.
struct Vector {
    x: vec2<u32>,
    y: vec2<u32>,
    z: vec2<u32>,
}

// On the 15 highest bits.
fn scaled(c: vec2<u32>, bits: u32) -> i32 {
    if bits > 15u {
        return bitcast<i32>(i64_shift_right(c, bits - 15u).x);
    }
    return bitcast<i32>(c.x << (15u - bits));
}

fn unit(c: i32, length: u32) -> i32 {
    let part = i32((u32(abs(c)) * 32768u + length / 2u) / length);
    return select(part, -part, c < 0);
}

// The vector of length 2^15 along `v`, rounded; w is 0 when `v` is 0.
fn normalized(v: Vector) -> vec4<i32> {
    let x = i64_abs(v.x);
    let y = i64_abs(v.y);
    let z = i64_abs(v.z);
    var largest = select(x, y, u64_less(x, y));
    largest = select(largest, z, u64_less(largest, z));
    if i64_is_zero(largest) {
        return vec4<i32>(0);
    }
    let bits = u64_bits(largest);
    let c = vec3<i32>(scaled(v.x, bits), scaled(v.y, bits), scaled(v.z, bits));
    let length = u64_root(vec2<u32>(u32(c.x * c.x) + u32(c.y * c.y) + u32(c.z * c.z), 0u));
    return vec4<i32>(unit(c.x, length), unit(c.y, length), unit(c.z, length), 1);
}

// The bits of a direction's float, exact.
fn direction_word(c: i32) -> u32 {
    return bitcast<u32>(f32(c) * 0x1p-15);
}
