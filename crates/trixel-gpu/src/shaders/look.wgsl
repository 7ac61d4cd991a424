// The first look at a triangle, by an invocation of its own: what to do with it.

struct Look {
    shape: Shape,
    // Of the triangle's box within the slab; 0 if it sets nothing.
    columns: u32,
}

fn look_at(triangle: u32) -> Look {
    if COUNTING {
        count(COUNT_INVOCATIONS, 1u);
    }
    let shape = shape_of(corners(triangle));
    count_too_large(shape.flags);
    var columns = 0u;
    if (shape.flags & EMPTY) == 0u {
        columns = rect_columns(column_rect(shape.base, shape.extent, shape.flags & AXIS_MASK));
    }
    return Look(shape, columns);
}

// Whether one invocation of a stage with SMALL can take the triangle whole.
fn fits_one_invocation(look: Look) -> bool {
    return look.columns <= params.max_columns && is_small(look.shape.extent);
}
