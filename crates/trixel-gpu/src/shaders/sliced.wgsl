// [CL] 2.2: one draw of all pairs of a triangle and a slice that it may meet. The paper's geometry shader copies triangles;
// here the vertex stage finds its pair in the prefix sums of `count_slices`.

@vertex
fn sliced(@builtin(vertex_index) index: u32) -> Varyings {
    let pair = index / VERTICES;
    let triangle = triangle_of_pair(pair);
    let shape = shape_of(corners(triangle));
    let slice = slices_of(shape).x + i32(pair - before[triangle]);
    return slice_corner(triangle, shape, index % VERTICES, slice);
}
