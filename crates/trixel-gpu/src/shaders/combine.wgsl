// How the triangles of a voxel become one: the twin of `combine.rs`. In front of it stand COMBINE, PRIORITIES, WANT_..., and
// where in a voxel's state (STATE_WORDS words) and row (ROW_WORDS) the parts are.
//
// A voxel's state begins with what its winner has most of, the winner's number inverted, so that zeros are nothing yet, how
// many triangles count, and the highest priority. Then come sums of two words each, or with MAX maxima of one.

@group(0) @binding(2) var<storage, read> list: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> state: array<atomic<u32>>;

const MEAN: u32 = 0u;
const AREA_WEIGHTED: u32 = 1u;
const NEAREST: u32 = 2u;
const DOMINANT: u32 = 3u;
const MAX: u32 = 4u;
const FIRST: u32 = 5u;
const ALL: u32 = 6u;

const STATE_MOST: u32 = 0u;
const STATE_WINNER: u32 = 1u;
const STATE_COUNT: u32 = 2u;
const STATE_PRIORITY: u32 = 3u;

// Makes components of normals positive.
const BIAS: i32 = 65536;

fn voxel_at(place: u32) -> vec3<i32> {
    return vec3<i32>(voxel_of(list[work.first_voxel + place]));
}

// What a surface is like at a point, as far as it is asked for.
struct Row {
    color: vec4<u32>,
    normal: vec3<i32>,
    geometric_normal: vec3<i32>,
    emission: vec3<u32>,
    metallic_roughness: vec2<u32>,
    u: vec2<u32>,
    v: vec2<u32>,
    weights: vec3<u32>,
    triangle: u32,
    material: u32,
}

fn row_of(p: Patch, triangle: u32, w: vec3<u32>) -> Row {
    var row: Row;
    row.triangle = triangle;
    row.material = material_of(p);
    row.weights = w;
    if WANT_COLOR {
        row.color = color_of(p, w).color;
    }
    if WANT_NORMAL {
        row.normal = shading_normal_of(p, w);
    }
    if WANT_GEOMETRIC_NORMAL {
        row.geometric_normal = geometric_normal_of(p);
    }
    if WANT_EMISSION {
        row.emission = emission_of(p, w);
    }
    if WANT_METALLIC_ROUGHNESS {
        row.metallic_roughness = metallic_roughness_of(p, w);
    }
    if WANT_TEXCOORD {
        row.u = coordinate_of(p, w, 0u);
        row.v = coordinate_of(p, w, 1u);
    }
    return row;
}
