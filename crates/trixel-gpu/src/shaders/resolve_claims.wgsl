// Writes the 3D textures of a material volume from the triangles that claimed its voxels: [CL] 2.1 and 2.2, after the
// rasterizer and not in it, because WebGPU orders neither fragments nor texture writes. One invocation a column.
//
// `Texels` and FILLED are prepended.

struct Resolve {
    nx: u32,
    ny: u32,
    nz: u32,
    slab_x: u32,
    // u32 words of a column of `inside`.
    column_words: u32,
    // Which medium triangles without one have.
    other: u32,
    normal_scale: f32,
    normal_offset: f32,
    absorption_scale: f32,
    index_scale: f32,
}

// A corner of a triangle, as `corners.rs` writes it.
struct Corner {
    // In the frame's voxels.
    x: f32,
    y: f32,
    // The fourth homogeneous coordinate.
    depth: f32,
    nx: f32,
    ny: f32,
    nz: f32,
    red_green: u32,
    blue_alpha: u32,
}

struct Face {
    a: Corner,
    b: Corner,
    c: Corner,
    medium: u32,
}

@group(0) @binding(0) var<uniform> volume: Resolve;
@group(0) @binding(1) var<storage, read> claims: array<u32>;
@group(0) @binding(2) var<storage, read> faces: array<Face>;
// Absorption and index of refraction.
@group(0) @binding(3) var<storage, read> media: array<vec2<f32>>;
// The bits of the whole grid that a fill found inside.
@group(0) @binding(4) var<storage, read> inside: array<u32>;
@group(0) @binding(5) var surface_texels: Texels;
@group(0) @binding(6) var color_texels: Texels;
@group(0) @binding(7) var medium_texels: Texels;

fn color_of(corner: Corner) -> vec4<f32> {
    return vec4<f32>(unpack2x16unorm(corner.red_green), unpack2x16unorm(corner.blue_alpha));
}

fn normal_of(corner: Corner) -> vec3<f32> {
    return vec3<f32>(corner.nx, corner.ny, corner.nz);
}

fn cross_2d(u: vec2<f32>, v: vec2<f32>) -> f32 {
    return u.x * v.y - u.y * v.x;
}

// How much of each corner the surface is where it crosses the line along z through `at`, in the world and not in the frame:
// perspective divides by the depth.
fn weights(face: Face, at: vec2<f32>) -> vec3<f32> {
    let a = vec2<f32>(face.a.x, face.a.y) - at;
    let b = vec2<f32>(face.b.x, face.b.y) - at;
    let c = vec2<f32>(face.c.x, face.c.y) - at;
    let areas = vec3<f32>(cross_2d(b, c), cross_2d(c, a), cross_2d(a, b));
    // Rounding may leave the triangle by a little, or nothing of a needle.
    let turn = select(1.0, -1.0, areas.x + areas.y + areas.z < 0.0);
    let w = max(areas * turn, vec3<f32>(0.0)) / vec3<f32>(face.a.depth, face.b.depth, face.c.depth);
    let sum = w.x + w.y + w.z;
    return select(w / sum, vec3<f32>(1.0 / 3.0), !(sum > 0.0));
}

fn medium_texel(medium: u32, is_inside: bool) -> vec4<f32> {
    let m = media[medium];
    return vec4<f32>(m.x / volume.absorption_scale, (m.y - 1.0) / volume.index_scale, f32(is_inside), 1.0);
}

@compute @workgroup_size(WORKGROUP)
fn resolve_claims(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let column = invocation(group, groups, local);
    if column >= volume.nx * volume.ny {
        return;
    }
    let x = volume.slab_x + column / volume.ny;
    let y = column % volume.ny;
    // What is inside is of what the last surface below is of.
    var below = volume.other;
    for (var z = 0u; z < volume.nz; z++) {
        let texel = vec3<u32>(x, y, z);
        let is_inside = FILLED && (inside[(x * volume.ny + y) * volume.column_words + z / 32u] >> (z % 32u) & 1u) == 1u;
        let claimed = claims[column * volume.nz + z];
        if claimed == 0u {
            textureStore(surface_texels, texel, vec4<f32>(0.0));
            textureStore(color_texels, texel, vec4<f32>(0.0));
            var medium = vec4<f32>(0.0);
            if is_inside {
                medium = medium_texel(below, true);
            }
            textureStore(medium_texels, texel, medium);
            continue;
        }
        let face = faces[0xffffffffu - claimed];
        let w = weights(face, vec2<f32>(vec2<u32>(x, y)) + 0.5);
        let sum = w.x * normal_of(face.a) + w.y * normal_of(face.b) + w.z * normal_of(face.c);
        let size = length(sum);
        let normal = select(vec3<f32>(0.0), sum / size, size > 0.0);
        let color = w.x * color_of(face.a) + w.y * color_of(face.b) + w.z * color_of(face.c);
        below = face.medium;
        let encoded = (normal + volume.normal_offset) / volume.normal_scale;
        textureStore(surface_texels, texel, vec4<f32>(encoded, 1.0));
        textureStore(color_texels, texel, color);
        textureStore(medium_texels, texel, medium_texel(below, is_inside));
    }
}
