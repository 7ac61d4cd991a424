// How large a triangle is, to tell small from large: DESIGN section 2. In voxels of the dominant projection; floats will
// do, because either side of the cutoff gives the same voxels.
// HEURISTIC is prepended: lavapipe compiles a shader anew for every run if it branches on a uniform alone.

const PROJECTED_AREA: u32 = 0u;
const BOX_AREA: u32 = 1u;
const DILATED_AREA: u32 = 2u;
const AREA_RATIO: u32 = 3u;

fn size_of(s: Shape) -> f32 {
    let area = i64_to_f32(s.nc) * 0x1p-33;
    let box = vec2<f32>(max(max(s.v0, s.v1), s.v2).xy - min(min(s.v0, s.v1), s.v2).xy) / f32(STEPS);
    // The Minkowski sum of a convex polygon and the unit square.
    let dilated = area + box.x + box.y + 1.0;
    switch HEURISTIC {
        case PROJECTED_AREA: { return area; }
        case BOX_AREA: { return box.x * box.y; }
        case DILATED_AREA: { return dilated; }
        case AREA_RATIO: { return area / dilated; }
        default: {
            let extent = vec3<f32>(s.extent + 1);
            return extent.x * extent.y * extent.z;
        }
    }
}
