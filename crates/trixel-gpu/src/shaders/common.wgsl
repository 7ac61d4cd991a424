// What every stage of a voxelization sees. The constants MODE, COUNTING and TILED are prepended.

const CONSERVATIVE: u32 = 0u;
const THIN: u32 = 1u;
const SOLID: u32 = 2u;
const SLICED: u32 = 3u;
// Not a mode of its own: the triangles that meet the cube of two voxels' width around a voxel's centre, which are those that
// count for a solid's attributes. The twin of `Shell` in `fragments.rs`.
const SHELL: u32 = 4u;

// S, lattice steps along a voxel.
const STEPS: i32 = 65536;
const WORKGROUP: u32 = 64u;

// The triangle that this invocation paints, for entries that name it.
var<private> painting: u32 = 0u;

struct Params {
    // The grid, all of it.
    dims: vec3<i32>,
    // u32 words of one column of voxels along z.
    column_words: u32,
    // The slab of the grid that `voxels` holds: from this x on, this many.
    slab_x: i32,
    slab_nx: i32,
    // The slices' overlap in lattice steps (mode sliced).
    overlap: i32,
    triangles: u32,
    // The part of each triangle's columns that one dispatch takes.
    first_column: u32,
    max_columns: u32,
    cutoff: f32,
    // The number of this chunk's first triangle in the mesh.
    first_triangle: u32,
    // The part of the projected slab that the raster target shows, in voxels from the slab's corner.
    window: vec2<i32>,
    window_size: vec2<f32>,
}

@group(0) @binding(0) var<uniform> params: Params;
// Three i32 a vertex, in lattice steps.
@group(0) @binding(1) var<storage, read> positions: array<i32>;
// Three u32 a triangle.
@group(0) @binding(2) var<storage, read> indices: array<u32>;

struct Corners {
    v0: vec3<i32>,
    v1: vec3<i32>,
    v2: vec3<i32>,
}

fn vertex(i: u32) -> vec3<i32> {
    return vec3<i32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
}

fn corners(triangle: u32) -> Corners {
    return Corners(
        vertex(indices[3u * triangle]),
        vertex(indices[3u * triangle + 1u]),
        vertex(indices[3u * triangle + 2u]),
    );
}

// The tile of the slab that an invocation is confined to, where TILED.
var<private> tile_low: vec3<i32>;
var<private> tile_high: vec3<i32>;

// The lowest and the highest voxel of the slab, or of what it is confined to.
fn slab_low() -> vec3<i32> {
    if TILED {
        return tile_low;
    }
    return vec3<i32>(params.slab_x, 0, 0);
}

fn slab_high() -> vec3<i32> {
    if TILED {
        return tile_high;
    }
    return vec3<i32>(params.slab_x + params.slab_nx - 1, params.dims.yz - 1);
}

// [HCV] 3.2: turns the axes so that `axis` becomes the third.
fn swizzle(v: vec3<i32>, axis: u32) -> vec3<i32> {
    return select(select(v, v.yzx, axis == 0u), v.zxy, axis == 1u);
}

fn unswizzle(v: vec3<i32>, axis: u32) -> vec3<i32> {
    return select(select(v, v.zxy, axis == 0u), v.yzx, axis == 1u);
}

// The number of this invocation in a dispatch of two dimensions, which large ones need.
fn invocation(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * WORKGROUP + local;
}
