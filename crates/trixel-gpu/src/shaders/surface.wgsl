// What a mesh's surface is like at a point of a triangle: the twin of `surface.rs` and `texture.rs`, on the words of
// `device.rs`.

struct Work {
    // Fragments, pairs, or voxels that there is an invocation for.
    items: u32,
    // The first voxel of the batch in the list, and how many the batch has.
    first_voxel: u32,
    voxels: u32,
    // The triangles of the chunk.
    first_triangle: u32,
    triangles: u32,
    // PatchLayout of `device.rs`.
    stride: u32,
    colors: u32,
    normals: u32,
    coordinates: u32,
    color_placement: u32,
    opacity_placement: u32,
    emission_placement: u32,
    metallic_placement: u32,
    // Where in `tables` the levels of textures and the tables of light begin.
    levels_at: u32,
    linear_at: u32,
    srgb_at: u32,
}

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(4) var<storage, read> patches: array<u32>;
@group(0) @binding(5) var<storage, read> tables: array<u32>;
@group(0) @binding(6) var<storage, read> texels_0: array<u32>;
@group(0) @binding(7) var<storage, read> texels_1: array<u32>;
@group(0) @binding(8) var<storage, read> texels_2: array<u32>;

const NOTHING: u32 = 0xffffffffu;
// MATERIAL_WORDS and the words of a level.
const MATERIAL_WORDS: u32 = 10u;
const LEVEL_WORDS: u32 = 8u;

const HAS_COLORS: u32 = 1u;
const HAS_NORMALS: u32 = 2u;
const HAS_COORDINATES: u32 = 4u;
const HAS_COLOR_TEXTURE: u32 = 8u;
const HAS_OPACITY_TEXTURE: u32 = 16u;
const HAS_EMISSION_TEXTURE: u32 = 32u;
const HAS_METALLIC_TEXTURE: u32 = 64u;

const OPAQUE: u32 = 0u;
const MASKED: u32 = 1u;

struct Corners {
    v0: vec3<i32>,
    v1: vec3<i32>,
    v2: vec3<i32>,
}

// A triangle's words.
struct Patch {
    at: u32,
    flags: u32,
    // Of its material's row.
    material: u32,
}

fn patch_of(triangle: u32) -> Patch {
    let at = (triangle - work.first_triangle) * work.stride;
    return Patch(at, patches[at], patches[at + 1u] * MATERIAL_WORDS);
}

fn vector_at(at: u32) -> vec3<i32> {
    return bitcast<vec3<i32>>(vec3<u32>(patches[at], patches[at + 1u], patches[at + 2u]));
}

fn corners_of(p: Patch) -> Corners {
    return Corners(vector_at(p.at + 2u), vector_at(p.at + 5u), vector_at(p.at + 8u));
}

fn halves(low: u32, high: u32) -> vec4<u32> {
    return vec4<u32>(low & 0xffffu, low >> 16u, high & 0xffffu, high >> 16u);
}

fn colors_at(at: u32) -> vec4<u32> {
    return halves(patches[at], patches[at + 1u]);
}

fn material_word(p: Patch, word: u32) -> u32 {
    return tables[p.material + word];
}

fn priority_of(p: Patch) -> u32 {
    return material_word(p, 8u);
}

fn material_of(p: Patch) -> u32 {
    return material_word(p, 9u);
}

fn texel_word(page: u32, at: u32) -> u32 {
    switch page {
        case 0u: { return texels_0[at]; }
        case 1u: { return texels_1[at]; }
        default: { return texels_2[at]; }
    }
}

// A row of the levels.
struct Level {
    page: u32,
    at: u32,
    size: vec2<i32>,
    base: vec2<i32>,
    flags: u32,
}

fn level_of(row: u32) -> Level {
    let at = work.levels_at + row * LEVEL_WORDS;
    let size = vec2<i32>(i32(tables[at + 2u]), i32(tables[at + 3u]));
    let base = vec2<i32>(i32(tables[at + 4u]), i32(tables[at + 5u]));
    return Level(tables[at], tables[at + 1u], size, base, tables[at + 6u]);
}

// The texel that index i stands for in a row of n.
fn wrapped(i: i32, n: i32, wrap: u32) -> i32 {
    if wrap == 2u {
        return clamp(i, 0, n - 1);
    }
    let period = select(n, 2 * n, wrap == 1u);
    let there = i - floor_divide(i, period) * period;
    return select(2 * n - 1 - there, there, there < n);
}

fn texel(l: Level, x: i32, y: i32) -> vec4<u32> {
    let column = wrapped(x, l.size.x, l.flags & 3u);
    let row = wrapped(y, l.size.y, (l.flags >> 2u) & 3u);
    let i = u32(row) * u32(l.size.x) + u32(column);
    let format = (l.flags >> 5u) & 3u;
    if format == 2u {
        return halves(texel_word(l.page, l.at + 2u * i), texel_word(l.page, l.at + 2u * i + 1u));
    }
    let word = texel_word(l.page, l.at + i);
    let bytes = vec4<u32>(word, word >> 8u, word >> 16u, word >> 24u) & vec4<u32>(0xffu);
    if format == 1u {
        return bytes * 257u;
    }
    return vec4<u32>(linear_of_srgb(bytes.x), linear_of_srgb(bytes.y), linear_of_srgb(bytes.z), bytes.w * 257u);
}

// (sum of the weights b and c times the way there + half) >> 16, seen from corner a.
fn between(a: i32, b: i32, c: i32, w: vec3<u32>) -> i32 {
    let moved = i64_add(i64_mul(i32(w.y), b - a), i64_mul(i32(w.z), c - a));
    return a + bitcast<i32>(i64_shift_right(i64_add(moved, vec2<u32>(32768u, 0u)), 16u).x);
}

// floor(fine * size / base), of sides below 2^16.
fn in_level(fine: i32, size: i32, base: i32) -> i32 {
    let whole = floor_divide(fine, base);
    return whole * size + i32((u32(fine - whole * base) * u32(size)) / u32(base));
}

// The linear colour, or fractions of FULL, where a patch is placed in a texture.
fn sample(at: u32, w: vec3<u32>) -> vec4<u32> {
    let l = level_of(patches[at + 6u]);
    let a = vector_at(at);
    let b = vector_at(at + 3u);
    let fine = vec2<i32>(between(a.x, a.z, b.y, w), between(a.y, b.x, b.z, w));
    let t = vec2<i32>(in_level(fine.x, l.size.x, l.base.x), in_level(fine.y, l.size.y, l.base.y));
    if (l.flags & 16u) != 0u {
        return texel(l, t.x >> 8u, t.y >> 8u);
    }
    let from_centre = t - 128;
    let f = vec2<u32>(from_centre & vec2<i32>(255));
    let i = from_centre >> vec2<u32>(8u);
    let g = 256u - f;
    var sum = texel(l, i.x, i.y) * (g.x * g.y);
    sum += texel(l, i.x + 1, i.y) * (f.x * g.y);
    sum += texel(l, i.x, i.y + 1) * (g.x * f.y);
    sum += texel(l, i.x + 1, i.y + 1) * (f.x * f.y);
    return (sum + 32768u) >> vec4<u32>(16u);
}

struct Shown {
    color: vec4<u32>,
    // Whether the alpha test finds anything.
    there: bool,
}

fn color_of(p: Patch, w: vec3<u32>) -> Shown {
    var color = halves(material_word(p, 0u), material_word(p, 1u));
    if (p.flags & HAS_COLORS) != 0u {
        let at = p.at + work.colors;
        let sum = colors_at(at) * w.x + colors_at(at + 2u) * w.y + colors_at(at + 4u) * w.z;
        color = times(color, (sum + 32768u) >> vec4<u32>(16u));
    }
    if (p.flags & HAS_COLOR_TEXTURE) != 0u {
        color = times(color, sample(p.at + work.color_placement, w));
    }
    if (p.flags & HAS_OPACITY_TEXTURE) != 0u {
        color.w = multiply(color.w, sample(p.at + work.opacity_placement, w).x);
    }
    let mode = material_word(p, 6u);
    let there = mode != MASKED || color.w >= material_word(p, 7u);
    if mode == OPAQUE || mode == MASKED {
        color.w = FULL;
    }
    return Shown(color, there);
}

fn is_masked(p: Patch) -> bool {
    return material_word(p, 6u) == MASKED;
}

fn geometric_normal_of(p: Patch) -> vec3<i32> {
    return vector_at(p.at + 11u);
}

fn weighted(a: i32, b: i32, c: i32, w: vec3<u32>) -> vec2<u32> {
    return i64_add(i64_add(i64_mul(i32(w.x), a), i64_mul(i32(w.y), b)), i64_mul(i32(w.z), c));
}

fn shading_normal_of(p: Patch, w: vec3<u32>) -> vec3<i32> {
    if (p.flags & HAS_NORMALS) != 0u {
        let at = p.at + work.normals;
        let a = vector_at(at);
        let b = vector_at(at + 3u);
        let c = vector_at(at + 6u);
        let sum = Vector(weighted(a.x, b.x, c.x, w), weighted(a.y, b.y, c.y, w), weighted(a.z, b.z, c.z, w));
        let normal = normalized(sum);
        if normal.w != 0 {
            return normal.xyz;
        }
    }
    return geometric_normal_of(p);
}

fn emission_of(p: Patch, w: vec3<u32>) -> vec3<u32> {
    let own = vec3<u32>(material_word(p, 2u), material_word(p, 3u), material_word(p, 4u));
    if (p.flags & HAS_EMISSION_TEXTURE) == 0u {
        return own;
    }
    let light = sample(p.at + work.emission_placement, w);
    let half = vec2<u32>(FULL / 2u, 0u);
    let full = vec2<u32>(FULL, 0u);
    return vec3<u32>(
        u64_divide(i64_add(mul_u32(own.x, light.x), half), full),
        u64_divide(i64_add(mul_u32(own.y, light.y), half), full),
        u64_divide(i64_add(mul_u32(own.z, light.z), half), full),
    );
}

fn metallic_roughness_of(p: Patch, w: vec3<u32>) -> vec2<u32> {
    let own = halves(material_word(p, 5u), 0u).xy;
    if (p.flags & HAS_METALLIC_TEXTURE) == 0u {
        return own;
    }
    let texel = sample(p.at + work.metallic_placement, w);
    return vec2<u32>(multiply(own.x, texel.z), multiply(own.y, texel.y));
}

fn coordinate_at(at: u32, w: u32) -> vec2<u32> {
    return u64_times(vec2<u32>(patches[at], patches[at + 1u]), w);
}

// u where `i` is 0 and v where it is 1, in 2^-16.
fn coordinate_of(p: Patch, w: vec3<u32>, i: u32) -> vec2<u32> {
    if (p.flags & HAS_COORDINATES) == 0u {
        return vec2<u32>(0u);
    }
    let at = p.at + work.coordinates + 2u * i;
    var sum = i64_add(i64_add(coordinate_at(at, w.x), coordinate_at(at + 4u, w.y)), coordinate_at(at + 8u, w.z));
    return i64_shift_right(i64_add(sum, vec2<u32>(32768u, 0u)), 16u);
}
