// Triangles for the rasterizer: turned to the plane of their columns and dilated, so that every column which they may meet
// becomes a fragment, to which they go along as flat varyings. DILATION is prepended.

const HASSELGREN_HULL: u32 = 0u;
const HASSELGREN_TRIANGLE: u32 = 1u;
const HERTEL: u32 = 2u;

const VERTICES: u32 = select(3u, 15u, DILATION == HASSELGREN_HULL);

// More than a rasterizer's rounding: the guaranteed 4 bits below the pixel are 1/16.
const MARGIN: f32 = 0.125;
// A vertex that would move further, in pixels, is one of a needle, whose bounding rectangle serves better.
const MAX_SHIFT: f32 = 64.0;

// A Triangle as flat varyings.
struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) ea_flags: vec4<i32>,
    @location(1) @interpolate(flat) eb_base: vec4<i32>,
    @location(2) @interpolate(flat) ec_base: vec4<i32>,
    @location(3) @interpolate(flat) ab_base: vec4<i32>,
    @location(4) @interpolate(flat) bc_extent: vec4<i32>,
    @location(5) @interpolate(flat) ca_extent: vec4<i32>,
    @location(6) @interpolate(flat) w0_extent: vec4<i32>,
    @location(7) @interpolate(flat) low_error: vec4<u32>,
    @location(8) @interpolate(flat) low: vec4<u32>,
    @location(9) @interpolate(flat) plane: vec4<u32>,
}

fn pack(t: Triangle) -> Varyings {
    var v: Varyings;
    v.ea_flags = vec4<i32>(t.ea, i32(t.flags));
    v.eb_base = vec4<i32>(t.eb, t.base.x);
    v.ec_base = vec4<i32>(t.ec, t.base.y);
    v.ab_base = vec4<i32>(t.ab_high, t.base.z);
    v.bc_extent = vec4<i32>(t.bc_high, t.extent.x);
    v.ca_extent = vec4<i32>(t.ca_high, t.extent.y);
    v.w0_extent = vec4<i32>(t.w0, t.extent.z);
    v.low_error = vec4<u32>(t.low_0.x, t.low_1.x, t.low_2.x, bitcast<u32>(t.error));
    v.low = vec4<u32>(t.low_0.y, t.low_1.y, t.low_2.y, 0u);
    v.plane = bitcast<vec4<u32>>(t.plane);
    return v;
}

fn unpack(v: Varyings) -> Triangle {
    var t: Triangle;
    t.ea = v.ea_flags.xyz;
    t.eb = v.eb_base.xyz;
    t.ec = v.ec_base.xyz;
    t.ab_high = v.ab_base.xyz;
    t.bc_high = v.bc_extent.xyz;
    t.ca_high = v.ca_extent.xyz;
    t.low_0 = vec2<u32>(v.low_error.x, v.low.x);
    t.low_1 = vec2<u32>(v.low_error.y, v.low.y);
    t.low_2 = vec2<u32>(v.low_error.z, v.low.z);
    t.base = vec3<i32>(v.eb_base.w, v.ec_base.w, v.ab_base.w);
    t.extent = vec3<i32>(v.bc_extent.w, v.ca_extent.w, v.w0_extent.w);
    t.w0 = v.w0_extent.xyz;
    t.plane = bitcast<vec4<f32>>(v.plane);
    t.error = bitcast<f32>(v.low_error.w);
    t.flags = u32(v.ea_flags.w);
    return t;
}

// The outward unit normal of an edge of a triangle that turns left.
fn outward(e: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(e.y, -e.x) / length(e);
}

// How far an edge moves outwards, so that every column which its mode may set has its centre inside.
fn edge_shift(n: vec2<f32>) -> f32 {
    if looks_along_z() {
        return MARGIN;
    }
    if DILATION == HERTEL {
        return 0.70710678 + MARGIN;
    }
    let m = abs(n);
    if MODE == THIN {
        return 0.5 * max(m.x, m.y) + MARGIN;
    }
    return 0.5 * (m.x + m.y) + MARGIN;
}

// Where the two moved edges with these normals meet, seen from their common corner.
fn corner_shift(before: vec2<f32>, after: vec2<f32>) -> vec2<f32> {
    let d0 = edge_shift(before);
    let d1 = edge_shift(after);
    let turn = before.x * after.y - before.y * after.x;
    return vec2<f32>(d0 * after.y - d1 * before.y, before.x * d1 - after.x * d0) / turn;
}

// The quadrant of a direction, counted to the left.
fn quadrant(n: vec2<f32>) -> u32 {
    if n.x > 0.0 && n.y >= 0.0 {
        return 0u;
    }
    if n.x <= 0.0 && n.y > 0.0 {
        return 1u;
    }
    return select(3u, 2u, n.x < 0.0 && n.y <= 0.0);
}

fn square_corner(quadrant: u32) -> vec2<f32> {
    let half = select(0.5 + MARGIN, MARGIN, looks_along_z());
    return vec2<f32>(
        select(-half, half, quadrant == 0u || quadrant == 3u),
        select(-half, half, quadrant < 2u),
    );
}

// Corner i of the seven of the convex hull of three pixel-sized squares.
fn hull_corner(p: array<vec2<f32>, 3>, n: array<vec2<f32>, 3>, i: u32) -> vec2<f32> {
    let q0 = quadrant(n[0]);
    let q1 = quadrant(n[1]);
    let q2 = quadrant(n[2]);
    // Each corner of the triangle brings the square's corners from the quadrant of the edge before to that after.
    let turns_0 = (q0 - q2) & 3u;
    let turns_1 = (q1 - q0) & 3u;
    if i <= turns_0 {
        return p[0] + square_corner((q2 + i) & 3u);
    }
    let rest = i - turns_0 - 1u;
    if rest <= turns_1 {
        return p[1] + square_corner((q0 + rest) & 3u);
    }
    return p[2] + square_corner((q1 + rest - turns_1 - 1u) & 3u);
}

// Where a corner of the dilated triangle lies, in local columns.
fn dilated(t: Triangle, corner: u32) -> vec2<f32> {
    let e0 = vec2<f32>(vec2<i32>(t.ea.x, t.eb.x)) / f32(STEPS);
    let e1 = vec2<f32>(vec2<i32>(t.ea.y, t.eb.y)) / f32(STEPS);
    let e2 = vec2<f32>(vec2<i32>(t.ea.z, t.eb.z)) / f32(STEPS);
    let p0 = vec2<f32>(t.w0.xy) / f32(STEPS);
    let p1 = p0 + e0;
    let p2 = p0 - e2;
    if (t.flags & DEGENERATE) == 0u {
        let n0 = outward(e0);
        let n1 = outward(e1);
        let n2 = outward(e2);
        if DILATION == HASSELGREN_HULL {
            let fan = vec3<u32>(0u, corner / 3u + 1u, corner / 3u + 2u)[corner % 3u];
            return hull_corner(array(p0, p1, p2), array(n0, n1, n2), fan);
        }
        let s0 = corner_shift(n2, n0);
        let s1 = corner_shift(n0, n1);
        let s2 = corner_shift(n1, n2);
        let furthest = max(max(dot(s0, s0), dot(s1, s1)), dot(s2, s2));
        if furthest <= MAX_SHIFT * MAX_SHIFT {
            return select(select(p2 + s2, p1 + s1, corner == 1u), p0 + s0, corner == 0u);
        }
    }
    // The box, and as much again beyond it, in one triangle; the rest of a fan shrinks to a point.
    let rect = vec4<f32>(column_rect(t.base, t.extent, t.flags & AXIS_MASK));
    let size = rect.zw + 1.0 - rect.xy;
    let reach = vec2<f32>(select(0.0, 2.0, corner == 1u), select(0.0, 2.0, corner == 2u));
    return rect.xy - MARGIN + reach * (size + 2.0 * MARGIN);
}

// The column in the corner of the raster target.
fn window_corner(axis: u32) -> vec2<i32> {
    return swizzle(slab_low(), axis).xy + params.window;
}

// A pixel of the raster target in clip space.
fn clip_space(pixel: vec2<f32>, depth: f32) -> vec4<f32> {
    let unit = pixel / params.window_size;
    return vec4<f32>(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y, depth, 1.0);
}
