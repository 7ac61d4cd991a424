// [SS]'s 2D case, conservative: a triangle within one layer of voxels meets those that its projection onto the layer meets,
// which three edges and the box decide.

fn voxelize_case(at: Corners) {
    let t = triangle_of(shape_of(at));
    let axis = t.flags & AXIS_MASK;
    let rect = column_rect(t.base, t.extent, axis);
    let layer = t.base.z;
    if layer < swizzle(slab_low(), axis).z || layer > swizzle(slab_high(), axis).z {
        return;
    }
    for (var b = rect.y; b <= rect.w; b++) {
        for (var a = rect.x; a <= rect.z; a++) {
            count_column();
            if ab_pass(t, a, b) {
                let voxel = unswizzle(vec3<i32>(t.base.x + a, t.base.y + b, layer), axis);
                set_bits(voxel.xy, voxel.z, 1u);
            }
        }
    }
}
