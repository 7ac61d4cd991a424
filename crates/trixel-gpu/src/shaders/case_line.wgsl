// [SS]'s 1D case, conservative: a triangle whose box is a line of voxels meets every one of them, so nothing is tested.

fn voxelize_case(t: Corners) {
    let base = (min(min(t.v0, t.v1), t.v2) - 1) >> vec3<u32>(16u);
    let top = max(max(t.v0, t.v1), t.v2) >> vec3<u32>(16u);
    let low = max(base, slab_low());
    let high = min(top, slab_high());
    // Two of these three go around once.
    for (var x = low.x; x <= high.x; x++) {
        for (var y = low.y; y <= high.y; y++) {
            count_column();
            if low.z <= high.z {
                set_run(vec2<i32>(x, y), low.z, high.z);
            }
        }
    }
}
