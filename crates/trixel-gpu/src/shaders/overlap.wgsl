// How much of a triangle lies inside a voxel: the twin of `overlap.rs`, which has the definition.

const OVERLAP_WIDTH: i32 = 1024;
// MOST_CORNERS of `overlap.rs`.
const MOST_CORNERS: u32 = 12u;

struct Polygon {
    corners: array<vec3<i32>, 12>,
    count: u32,
}

// floor(way * part / whole), for |way| and whole below 2^26 and part below whole: the guess is within 32 of it, so that
// what it leaves fits 32 bits though the product does not.
fn share_of(way: i32, part: i32, whole: i32) -> i32 {
    let guess = i32(floor(f32(way) * (f32(part) / f32(whole))));
    return guess + floor_divide(way * part - guess * whole, whole);
}

fn cut_edge(a: vec3<i32>, b: vec3<i32>, axis: u32, plane: i32, part: i32, whole: i32) -> vec3<i32> {
    let way = b - a;
    var point = a + vec3<i32>(share_of(way.x, part, whole), share_of(way.y, part, whole), share_of(way.z, part, whole));
    point = select(point, vec3<i32>(plane), vec3<bool>(axis == 0u, axis == 1u, axis == 2u));
    return point;
}

fn along(v: vec3<i32>, axis: u32) -> i32 {
    return select(select(v.z, v.y, axis == 1u), v.x, axis == 0u);
}

// The part where side * (coordinate - plane) >= 0.
fn clipped(p: Polygon, axis: u32, plane: i32, side: i32) -> Polygon {
    var out: Polygon;
    for (var i = 0u; i < p.count; i++) {
        let here = p.corners[i];
        let next = p.corners[select(i + 1u, 0u, i + 1u == p.count)];
        let a = side * (along(here, axis) - plane);
        let b = side * (along(next, axis) - plane);
        if a >= 0 && out.count < MOST_CORNERS {
            out.corners[out.count] = here;
            out.count++;
        }
        if ((a > 0 && b < 0) || (a < 0 && b > 0)) && out.count < MOST_CORNERS {
            if a > 0 {
                out.corners[out.count] = cut_edge(here, next, axis, plane, a, a - b);
            } else {
                out.corners[out.count] = cut_edge(next, here, axis, plane, b, b - a);
            }
            out.count++;
        }
    }
    return out;
}

// Twice the area of the part of a triangle inside the closed cube of a voxel, in (2^-10 voxels)^2, rounded down.
fn doubled_area(t: Corners, voxel: vec3<i32>) -> u32 {
    let low = voxel * 65536;
    var p: Polygon;
    p.corners[0] = (t.v0 - low + 32) >> vec3<u32>(6u);
    p.corners[1] = (t.v1 - low + 32) >> vec3<u32>(6u);
    p.corners[2] = (t.v2 - low + 32) >> vec3<u32>(6u);
    p.count = 3u;
    for (var face = 0u; face < 6u; face++) {
        let upper = (face & 1u) == 1u;
        p = clipped(p, face >> 1u, select(0, OVERLAP_WIDTH, upper), select(1, -1, upper));
    }
    var sum = vec3<i32>(0);
    for (var i = 2u; i < p.count; i++) {
        let u = p.corners[i - 1u] - p.corners[0];
        let v = p.corners[i] - p.corners[0];
        sum += vec3<i32>(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
    }
    return u64_root(dot_i64(sum, sum));
}
