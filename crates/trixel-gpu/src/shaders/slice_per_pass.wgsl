// Llamas 2007: the whole mesh is drawn for each slice.

struct Slice {
    index: i32,
}

@group(1) @binding(0) var<uniform> one: Slice;

// Three times the same point: no fragment.
fn no_corner() -> Varyings {
    var nothing: Varyings;
    nothing.ea_flags.w = i32(EMPTY);
    nothing.position = vec4<f32>(0.0, 0.0, 0.5, 1.0);
    return nothing;
}

@vertex
fn slice_per_pass(@builtin(vertex_index) index: u32) -> Varyings {
    let triangle = index / VERTICES;
    let shape = shape_of(corners(triangle));
    if (shape.flags & TOO_LARGE) != 0u {
        // One pixel of the first slice, whose fragment tells.
        var tell: Varyings;
        let corner = index % VERTICES;
        tell.ea_flags.w = i32(shape.flags);
        let at = vec2<f32>(select(0.0, 1.5, corner == 1u), select(0.0, 1.5, corner == 2u));
        tell.position = clip_space(at, select(2.0, 0.5, one.index == 0));
        return tell;
    }
    let slices = slices_of(shape);
    if one.index < slices.x || one.index > slices.y {
        return no_corner();
    }
    return slice_corner(triangle, shape, index % VERTICES, one.index);
}
