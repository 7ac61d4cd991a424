// [SS]'s 3D case, and all cases of modes in which thickness decides nothing: column by column. Triangles too long for one
// invocation take a share of their columns a dispatch.

fn voxelize_case(t: Corners) {
    let first = select(0u, params.first_column, CASE == 3u);
    voxelize_columns(triangle_of(shape_of(t)), first);
}
