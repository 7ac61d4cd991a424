// [HCV] 3.2: one fragment a column. The vertex stage turns each triangle to its dominant axis and dilates it, so that
// the rasterizer makes a fragment of every column that the triangle may meet; the fragment stage decides exactly.
//
// LISTED (triangles come from `list`) is prepended.

@group(1) @binding(0) var<storage, read> list: array<u32>;

@vertex
fn dilate(@builtin(vertex_index) index: u32) -> Varyings {
    let corner = index % VERTICES;
    var triangle = index / VERTICES;
    if LISTED {
        triangle = list[triangle];
    }
    let shape = shape_of(corners(triangle));
    if (shape.flags & TOO_LARGE) != 0u {
        // One pixel, whose fragment tells.
        var tell: Varyings;
        tell.ea_flags.w = i32(shape.flags);
        tell.position = clip_space(vec2<f32>(select(0.0, 1.5, corner == 1u), select(0.0, 1.5, corner == 2u)), 0.5);
        return tell;
    }
    if (shape.flags & EMPTY) != 0u {
        // Three times the same point: no fragment.
        var nothing: Varyings;
        nothing.ea_flags.w = i32(shape.flags);
        nothing.position = vec4<f32>(0.0, 0.0, 0.5, 1.0);
        return nothing;
    }
    let t = triangle_of(shape);
    var v = pack(t);
    v.low.w = triangle;
    let pixel = dilated(t, corner) + vec2<f32>(t.base.xy - window_corner(t.flags & AXIS_MASK));
    v.position = clip_space(pixel, 0.5);
    return v;
}

@fragment
fn fragment_parallel(v: Varyings) -> @location(0) vec4<f32> {
    let t = unpack(v);
    painting = v.low.w;
    count_too_large(t.flags);
    if (t.flags & EMPTY) != 0u {
        return vec4<f32>(0.0);
    }
    let column = vec2<i32>(floor(v.position.xy)) + window_corner(t.flags & AXIS_MASK) - t.base.xy;
    let rect = column_rect(t.base, t.extent, t.flags & AXIS_MASK);
    var passed = false;
    if all(column >= rect.xy) && all(column <= rect.zw) {
        passed = voxelize_column(t, column.x, column.y);
    }
    if COUNTING {
        count(COUNT_FRAGMENTS, 1u);
        if !passed {
            count(COUNT_DISCARDED, 1u);
        }
        flush_counters();
    }
    // The target's write mask is empty.
    return vec4<f32>(0.0);
}
