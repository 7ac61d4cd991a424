// An opaque object and the floor in sunlight that comes through the object: section 3.1 of [CL]. The rasterizer finds the
// first surface of each pixel; `shadow.rs` and `reference.rs` are the same on triangles.

@group(1) @binding(0) var optical_depth: texture_3d<f32>;
@group(1) @binding(1) var depth_sampler: sampler;

const SUNLIGHT = vec3<f32>(1.06, 1.0, 0.90);
const AMBIENT = vec3<f32>(0.90, 0.98, 1.10);
const NEAR: f32 = 0.005;
const FAR: f32 = 200.0;

// The share of the sun's light that comes to a point.
fn sunlight(point: vec3<f32>) -> vec3<f32> {
    let placed = vec3<f32>(dot(point, view.across), dot(point, view.across_too), -dot(point, view.to_sun));
    let size = vec3<f32>(textureDimensions(optical_depth));
    let voxels = (placed - view.corner) / view.voxel;
    if any(voxels.xy < vec2<f32>(0.0)) || any(voxels.xy > size.xy) {
        return vec3<f32>(1.0);
    }
    // The middle of a texel holds the sum up to the far end of its slice, half a voxel farther on.
    let place = vec3<f32>(voxels.xy, voxels.z - 0.5 - BIAS) / size;
    return exp(-textureSampleLevel(optical_depth, depth_sampler, place, 0.0).xyz);
}

// Voxels towards the sun at which a surface looks up its shadow, so that it is not in its own.
override BIAS: f32 = 1.0;

fn surface_light(color: vec3<f32>, normal: vec3<f32>, sheet: f32, shadow: vec3<f32>) -> vec3<f32> {
    let towards = dot(normal, view.to_sun);
    let facing = select(max(towards, 0.0), abs(towards), sheet > 0.5);
    let from_everywhere = AMBIENT * view.ambient * (0.75 + 0.25 * normal.z);
    return color * (from_everywhere + SUNLIGHT * (1.0 - view.ambient) * facing * shadow);
}

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) point: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) color: vec4<f32>,
}

fn depth_of(forward: f32) -> f32 {
    return FAR * (forward - NEAR) / (FAR - NEAR);
}

@vertex
fn object_vertex(
    @location(0) point: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
) -> Corner {
    let seen = point - view.camera;
    let forward = dot(seen, view.forward);
    // The sample lies at `jitter` in the pixel, and the rasterizer looks at the middle.
    let shift = (vec2<f32>(0.5) - view.jitter) * forward;
    let across = dot(seen, view.right) / view.pixel + shift.x;
    let upwards = dot(seen, view.up) / view.pixel - shift.y;
    let size = vec2<f32>(view.width, view.height);
    return Corner(vec4<f32>(2.0 * vec2<f32>(across, upwards) / size, depth_of(forward), forward), point, normal, color);
}

@fragment
fn object_fragment(corner: Corner) -> @location(0) vec4<f32> {
    let away = normalize(corner.point - view.camera);
    let length2 = dot(corner.normal, corner.normal);
    var normal = select(-away, corner.normal * inverseSqrt(max(length2, 1e-12)), length2 > 1e-8);
    if dot(normal, away) > 0.0 {
        normal = -normal;
    }
    return vec4<f32>(surface_light(corner.color.xyz, normal, corner.color.w, sunlight(corner.point)), 1.0);
}

@vertex
fn far_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // One triangle that covers the picture.
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

struct Far {
    @builtin(frag_depth) depth: f32,
    @location(0) light: vec4<f32>,
}

@fragment
fn far_fragment(@builtin(position) position: vec4<f32>) -> Far {
    let d = view_direction(position.xy - vec2<f32>(0.5) + view.jitter);
    if !meets_floor(view.camera, d) {
        return Far(1.0, vec4<f32>(far_light(d), 1.0));
    }
    let away = floor_distance(view.camera, d);
    let point = view.camera + away * d;
    let lit = surface_light(floor_color(point), vec3<f32>(0.0, 0.0, 1.0), 0.0, sunlight(point));
    let forward = away * dot(d, view.forward);
    let depth = clamp(depth_of(forward) / max(forward, 1e-6), 0.0, 1.0);
    return Far(depth, vec4<f32>(to_horizon(lit, point, d), 1.0));
}
