// The slices that a triangle may meet: from .x to .y, none if .y < .x.
fn slices_of(s: Shape) -> vec2<i32> {
    if (s.flags & EMPTY) != 0u {
        return vec2<i32>(0, -1);
    }
    let reach = overlap_voxels();
    return vec2<i32>(max(s.base.z - reach, 0), min(s.base.z + s.extent.z + reach, params.dims.z - 1));
}
