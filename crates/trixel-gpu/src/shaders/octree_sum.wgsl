// Sums of attributes, in integers, so that no order shows: the twin of `Sum` in `octree.rs`.

struct Sum {
    // Linear light times alpha, and alpha: 16 bits a voxel.
    r: vec2<u32>,
    g: vec2<u32>,
    b: vec2<u32>,
    a: vec2<u32>,
    x: vec2<u32>,
    y: vec2<u32>,
    z: vec2<u32>,
    // Those that have attributes; a list has fewer than 2^30.
    voxels: u32,
}

fn nothing() -> Sum {
    let zero = vec2<u32>(0u);
    return Sum(zero, zero, zero, zero, zero, zero, zero, 0u);
}

// Of one voxel.
fn sum_of(leaf: vec4<u32>) -> Sum {
    if is_bare(leaf) {
        return nothing();
    }
    let alpha = (leaf.x >> 24u) * 257u;
    let r = multiply(linear_of_srgb(leaf.x & 0xffu), alpha);
    let g = multiply(linear_of_srgb((leaf.x >> 8u) & 0xffu), alpha);
    let b = multiply(linear_of_srgb((leaf.x >> 16u) & 0xffu), alpha);
    let n = normal_of(leaf);
    return Sum(
        vec2<u32>(r, 0u),
        vec2<u32>(g, 0u),
        vec2<u32>(b, 0u),
        vec2<u32>(alpha, 0u),
        i64_from(n.x),
        i64_from(n.y),
        i64_from(n.z),
        1u,
    );
}

fn plus(s: Sum, t: Sum) -> Sum {
    return Sum(
        i64_add(s.r, t.r),
        i64_add(s.g, t.g),
        i64_add(s.b, t.b),
        i64_add(s.a, t.a),
        i64_add(s.x, t.x),
        i64_add(s.y, t.y),
        i64_add(s.z, t.z),
        s.voxels + t.voxels,
    );
}

// n / d, rounded.
fn rounded(n: vec2<u32>, d: vec2<u32>) -> u32 {
    return min(u64_divide(i64_add(n, i64_shift_right(d, 1u)), d), FULL);
}

fn straight(c: vec2<u32>, alpha: vec2<u32>) -> u32 {
    return rounded(u64_times(c, FULL), alpha);
}

// Colour and normal as `Look` has them, the bits of floats: the average.
fn look_of(sum: Sum) -> vec4<u32> {
    if sum.voxels == 0u {
        return vec4<u32>(0u);
    }
    // Where all is transparent, all the light is 0.
    let shown = select(sum.a, vec2<u32>(1u, 0u), i64_is_zero(sum.a));
    let alpha = rounded(sum.a, vec2<u32>(sum.voxels, 0u));
    let color = vec4<u32>(straight(sum.r, shown), straight(sum.g, shown), straight(sum.b, shown), alpha);
    let n = normalized(Vector(sum.x, sum.y, sum.z));
    return vec4<u32>(encode(color), direction_word(n.x), direction_word(n.y), direction_word(n.z));
}
