// [CL] 2.2: one triangle in one slice, rasterized between the slice's near and far plane.
//
// The planes bound the depth of clip space, as in the paper. Both are moved apart by what the rasterizer may misplace a
// fragment and floats the depth, so that nothing is lost; the fragment stage decides exactly.

// A corner of a triangle's copy for a slice.
fn slice_corner(triangle: u32, shape: Shape, corner: u32, slice: i32) -> Varyings {
    let t = triangle_of(shape);
    var v = pack(t);
    // Modes that look along z leave these free.
    v.low.z = params.first_triangle + triangle;
    v.low.w = bitcast<u32>(slice);
    let at = dilated(t, corner);
    // The voxel's centre is half a voxel above the lower of the two bounds, but for the overlap.
    let half = 0.5 + f32(params.overlap) / f32(STEPS);
    let middle = (t.plane.x + t.plane.y) * 0.5;
    let depth = middle - t.plane.z * (at.x - 0.5) - t.plane.w * (at.y - 0.5);
    let margin = MARGIN * (abs(t.plane.z) + abs(t.plane.w)) + 2.0 * t.error + 0.001;
    let reach = half + margin;
    let from_middle = (depth - f32(slice - t.base.z)) / reach;
    v.position = clip_space(at + vec2<f32>(t.base.xy - window_corner(2u)), 0.5 + 0.5 * from_middle);
    return v;
}

// Sets the voxel of column (a, b) in a slice if the triangle meets the column's line there.
fn voxelize_in_slice(t: Triangle, triangle: u32, a: i32, b: i32, slice: i32) -> bool {
    count_column();
    if !ab_pass(t, a, b) {
        return false;
    }
    let c = slice - t.base.z;
    let range = depth_range(t, a, b, c, c);
    if range.x > range.y {
        return false;
    }
    let column = t.base.xy + vec2<i32>(a, b);
    set_bits(column, slice, 1u);
    claim(vec3<i32>(column, slice), triangle);
    return true;
}

@fragment
fn slice(v: Varyings) -> @location(0) vec4<f32> {
    let t = unpack(v);
    painting = v.low.z - params.first_triangle;
    count_too_large(t.flags);
    if (t.flags & EMPTY) != 0u {
        return vec4<f32>(0.0);
    }
    let column = vec2<i32>(floor(v.position.xy)) + window_corner(2u) - t.base.xy;
    let rect = column_rect(t.base, t.extent, 2u);
    var passed = false;
    if all(column >= rect.xy) && all(column <= rect.zw) {
        passed = voxelize_in_slice(t, v.low.z, column.x, column.y, bitcast<i32>(v.low.w));
    }
    if COUNTING {
        count(COUNT_FRAGMENTS, 1u);
        if !passed {
            count(COUNT_DISCARDED, 1u);
        }
        flush_counters();
    }
    return vec4<f32>(0.0);
}
