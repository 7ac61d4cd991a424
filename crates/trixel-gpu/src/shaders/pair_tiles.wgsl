// For `tiled`: one invocation a pair of a triangle and a tile that its box meets. Pairs whose tile the triangle's plane misses
// drop out, by sorting to the end.

struct Round {
    // The pairs of this round: from the first on, so many.
    first: u32,
    length: u32,
    // The number that no tile has.
    none: u32,
}

// How many pairs there are.
@group(1) @binding(1) var<storage, read> total: u32;
@group(1) @binding(2) var<storage, read> round: Round;
// Tile and triangle.
@group(1) @binding(3) var<storage, read_write> pairs: array<vec2<u32>>;

// Whether the plane comes near a tile, in f32 with more room than all rounding: every factor is within 2^-20 of itself, and
// what a triangle sets lies within two voxels of its plane, but for overlaps.
fn plane_is_near(s: Shape, tile: vec3<i32>) -> bool {
    if MODE == SOLID && tile.z == 0 {
        // Toggled by what is below the grid as well.
        return true;
    }
    let axis = s.flags & AXIS_MASK;
    let half = vec3<f32>(vec3<i32>(1) << TILE_SHIFT) * 0.5;
    let low = swizzle(tile << TILE_SHIFT, axis) - s.base;
    let corner = vec3<f32>(s.v0 - s.base * STEPS) / f32(STEPS);
    let centre = vec3<f32>(low) + vec3<f32>(swizzle(vec3<i32>(half), axis)) - corner;
    let reach = vec3<f32>(swizzle(vec3<i32>(half) + vec3<i32>(2, 2, 2 + overlap_voxels()), axis));
    let normal = vec3<f32>(i64_to_f32(s.na), i64_to_f32(s.nb), i64_to_f32(s.nc));
    let room = reach + (abs(centre) + abs(corner) + reach) * 0x1p-16;
    return abs(dot(normal, centre)) <= dot(abs(normal), room);
}

@compute @workgroup_size(WORKGROUP)
fn pair_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= round.length {
        return;
    }
    let pair = round.first + i;
    var entry = vec2<u32>(round.none, 0u);
    if pair < total {
        let triangle = triangle_of_pair(pair);
        let shape = shape_of(corners(triangle));
        let box = tiles_of(shape);
        let number = pair - before[triangle];
        let column = number / box.size.z;
        let offset = vec3<u32>(column / box.size.y, column % box.size.y, number % box.size.z);
        let tile = box.low + vec3<i32>(offset);
        if COUNTING {
            count(COUNT_INVOCATIONS, 1u);
        }
        if plane_is_near(shape, tile) {
            entry = vec2<u32>(tile_number(tile), triangle);
        }
    }
    pairs[i] = entry;
}
