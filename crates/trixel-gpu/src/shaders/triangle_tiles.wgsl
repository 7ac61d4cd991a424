// The tiles that a triangle's box meets: all in which it may set a voxel, or toggle one.

fn tiles_of(s: Shape) -> TileBox {
    let axis = s.flags & AXIS_MASK;
    var low = unswizzle(s.base, axis);
    var high = low + unswizzle(s.extent, axis);
    low.z -= overlap_voxels();
    // The first centre above a surface may be one voxel up.
    high.z += overlap_voxels() + select(0, 1, MODE == SOLID);
    let first = clamp(low, slab_low(), slab_high()) >> TILE_SHIFT;
    let last = clamp(high, slab_low(), slab_high()) >> TILE_SHIFT;
    return TileBox(first, vec3<u32>(last - first + 1));
}
