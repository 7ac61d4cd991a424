// Light through the material volume: refraction and transmittance. [CL], sections 3.2 and 3.3; `reference.rs` is the same
// on triangles.

override SURFACES: u32 = 2u; // 0 none, 1 two, 2 many
override ABSORB: bool = false;
override FRESNEL: bool = true;
// Whether the way between two surfaces is measured along the ray as it came.
override INCIDENT: bool = false;
override MAX_SURFACES: u32 = 12u;
// What is written: 0 light, 1 where rays leave.
override OUTPUT: u32 = 0u;

@group(1) @binding(0) var shares: texture_3d<f32>;
@group(1) @binding(1) var surface: texture_3d<f32>;
@group(1) @binding(2) var voxel_sampler: sampler;
@group(1) @binding(3) var<storage, read_write> sums: array<vec4<f32>>;

const AIR: u32 = 4u;
// The longest step through voxels that may hold a surface, of [CL]'s equation 3's.
const STEP: f32 = 0.5;
// Distances are those of voxels' centres, interpolated, to centres of voxels that have the surface somewhere.
const DISTANCE_SLACK: f32 = 2.3;
// Halvings of the step in which the medium changes.
const HALVINGS: u32 = 7u;
// Steps of one ray between two surfaces. All loops of a ray together must stay below lavapipe's 65,535 iterations.
const MAX_STEPS: u32 = 3000u;
const MAX_ALL_STEPS: u32 = 24000u;
// Voxels within which a second hit of a similar surface is the same one.
const DOUBLE_HIT_VOXELS: f32 = 2.0;

struct Boundary {
    found: bool,
    // The last place in the old medium, and the first in the new one; or where the ray left the volume.
    before: vec3<f32>,
    after: vec3<f32>,
    medium: u32,
}

// What is traced, in the world.
struct Traced {
    origin: vec3<f32>,
    direction: vec3<f32>,
    tint: vec3<f32>,
    mirror_share: f32,
    mirror_origin: vec3<f32>,
    mirror_direction: vec3<f32>,
}

var<private> steps_left: u32;

fn volume_size() -> vec3<f32> {
    return vec3<f32>(textureDimensions(shares));
}

// The medium that fills most of the place.
fn medium_at(p: vec3<f32>) -> u32 {
    let share = textureSampleLevel(shares, voxel_sampler, p / volume_size(), 0.0);
    var best = 1.0 - (share.x + share.y + share.z + share.w);
    var medium = AIR;
    for (var i = 0u; i < 4u; i++) {
        if share[i] > best {
            best = share[i];
            medium = i;
        }
    }
    return medium;
}

fn normal_at(p: vec3<f32>) -> vec3<f32> {
    let normal = textureSampleLevel(surface, voxel_sampler, p / volume_size(), 0.0).xyz;
    let squared = dot(normal, normal);
    return select(vec3<f32>(0.0), normal * inverseSqrt(max(squared, 1e-12)), squared > 1e-4);
}

fn same(a: u32, b: u32, any_solid: bool) -> bool {
    return a == b || (any_solid && a != AIR && b != AIR);
}

// Marches until the medium is another, a voxel's slice at a time where there may be a surface (equation 3).
fn next_boundary(start: vec3<f32>, d: vec3<f32>, current: u32, any_solid: bool) -> Boundary {
    let size = volume_size();
    let slice = STEP / max(max(abs(d.x), abs(d.y)), abs(d.z));
    var p = start;
    for (var i = 0u; i < MAX_STEPS && steps_left > 0u; i++) {
        steps_left -= 1u;
        let free = textureSampleLevel(surface, voxel_sampler, p / size, 0.0).w;
        let q = p + d * max(slice, free - DISTANCE_SLACK);
        let inside = all(q >= vec3<f32>(0.0)) && all(q <= size);
        if !inside {
            return Boundary(false, p, q, AIR);
        }
        let medium = medium_at(q);
        if !same(medium, current, any_solid) {
            var before = p;
            var after = q;
            var reached = medium;
            for (var h = 0u; h < HALVINGS; h++) {
                let middle = (before + after) * 0.5;
                let there = medium_at(middle);
                if same(there, current, any_solid) {
                    before = middle;
                } else {
                    after = middle;
                    reached = there;
                }
            }
            return Boundary(true, before, after, reached);
        }
        p = q;
    }
    return Boundary(false, p, p, AIR);
}

fn to_world(p: vec3<f32>) -> vec3<f32> {
    return view.corner + p * view.voxel;
}

// Beer and Lambert: equation 5.
fn left_after(medium: u32, voxels: f32) -> vec3<f32> {
    if ABSORB && medium != AIR {
        return exp(-view.media[medium].xyz * (voxels * view.voxel));
    }
    return vec3<f32>(1.0);
}

fn against(normal: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    return select(normal, -normal, dot(normal, d) > 0.0);
}

// Snell's law; zero where all light is reflected.
fn refracted(d: vec3<f32>, normal: vec3<f32>, ratio: f32) -> vec3<f32> {
    let cosine = -dot(d, normal);
    let rest = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    if rest < 0.0 {
        return vec3<f32>(0.0);
    }
    return normalize(ratio * d + (ratio * cosine - sqrt(rest)) * normal);
}

fn reflectance(cosine: f32, index: f32, behind: f32) -> f32 {
    let ratio = index / behind;
    let sine2 = ratio * ratio * (1.0 - cosine * cosine);
    if sine2 >= 1.0 {
        return 1.0;
    }
    let cosine_behind = sqrt(1.0 - sine2);
    let across = (index * cosine - behind * cosine_behind) / (index * cosine + behind * cosine_behind);
    let along = (behind * cosine - index * cosine_behind) / (behind * cosine + index * cosine_behind);
    return 0.5 * (across * across + along * along);
}

// Where a ray enters the volume, in voxels; how far that is, or -1.
fn entry(origin: vec3<f32>, d: vec3<f32>) -> f32 {
    let a = -origin / d;
    let b = (volume_size() - origin) / d;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), high.z);
    return select(-1.0, near, near < far);
}

fn remember_mirror(traced: ptr<function, Traced>, at: vec3<f32>, d: vec3<f32>, normal: vec3<f32>, behind: f32) {
    (*traced).mirror_share = reflectance(-dot(normal, d), 1.0, behind);
    (*traced).mirror_origin = to_world(at);
    (*traced).mirror_direction = reflect(d, normal);
}

// Straight through everything.
fn trace_straight(traced: ptr<function, Traced>, start: vec3<f32>) {
    let d = (*traced).direction;
    var p = start;
    var current = medium_at(p);
    for (var i = 0u; i < 4096u && steps_left > 0u; i++) {
        let next = next_boundary(p, d, current, false);
        (*traced).tint *= left_after(current, distance(p, next.after));
        if !next.found {
            return;
        }
        p = next.after;
        current = next.medium;
    }
}

// Figure 5.
fn trace_two(traced: ptr<function, Traced>, start: vec3<f32>) {
    let d = (*traced).direction;
    var first = next_boundary(start, d, medium_at(start), true);
    if first.found && first.medium == AIR {
        first = next_boundary(first.after, d, AIR, true);
    }
    if !first.found {
        return;
    }
    let index = view.media[first.medium].w;
    let first_normal = against(normal_at(first.after), d);
    var bent = d;
    if any(first_normal != vec3<f32>(0.0)) && index != 1.0 {
        remember_mirror(traced, first.after, d, first_normal, index);
        bent = refracted(d, first_normal, 1.0 / index);
        (*traced).origin = to_world(first.after);
        if all(bent == vec3<f32>(0.0)) {
            (*traced).direction = reflect(d, first_normal);
            return;
        }
    }
    (*traced).direction = bent;
    let measured = select(bent, d, INCIDENT);
    let second = next_boundary(first.after, measured, first.medium, true);
    if !second.found {
        return;
    }
    let thickness = distance(first.after, second.after);
    let at = first.after + thickness * bent;
    (*traced).tint *= left_after(first.medium, thickness);
    let normal = against(normal_at(at), bent);
    if all(normal == vec3<f32>(0.0)) || index == 1.0 {
        return;
    }
    (*traced).origin = to_world(at);
    let out = refracted(bent, normal, index);
    (*traced).direction = select(out, reflect(bent, normal), all(out == vec3<f32>(0.0)));
}

// Figure 6 and equation 4.
fn trace_many(traced: ptr<function, Traced>, start: vec3<f32>) {
    var p = start;
    var from_point = start;
    var d = (*traced).direction;
    var current = medium_at(p);
    var last_normal = vec3<f32>(0.0);
    var last_point = vec3<f32>(-1e9);
    var first = true;
    var count = 0u;
    for (var i = 0u; i < 4u * MAX_SURFACES && count < MAX_SURFACES; i++) {
        let next = next_boundary(p, d, current, false);
        (*traced).tint *= left_after(current, distance(from_point, next.after));
        from_point = next.after;
        if !next.found {
            break;
        }
        let outward = normal_at(next.after);
        let index = view.media[current].w;
        let behind = view.media[next.medium].w;
        p = next.after;
        let again = distance(next.after, last_point) < DOUBLE_HIT_VOXELS && dot(outward, last_normal) > view.double_hit;
        if index == behind || again || all(outward == vec3<f32>(0.0)) {
            current = next.medium;
            continue;
        }
        let normal = against(outward, d);
        if first {
            first = false;
            if current == AIR {
                remember_mirror(traced, next.after, d, normal, behind);
            }
        }
        count += 1u;
        last_normal = outward;
        last_point = next.after;
        (*traced).origin = to_world(next.after);
        let bent = refracted(d, normal, index / behind);
        if all(bent == vec3<f32>(0.0)) {
            d = reflect(d, normal);
            // Back into the medium, so that the same surface is not met again at once.
            p = next.before + normal * 0.5;
        } else {
            d = bent;
            current = next.medium;
        }
    }
    (*traced).direction = d;
}

@compute @workgroup_size(8, 8)
fn march(@builtin(global_invocation_id) id: vec3<u32>) {
    let width = u32(view.width);
    if id.x >= width || id.y >= u32(view.height) {
        return;
    }
    steps_left = MAX_ALL_STEPS;
    let direction = view_direction(vec2<f32>(id.xy) + view.jitter);
    let none = vec3<f32>(0.0);
    var traced = Traced(view.camera, direction, vec3<f32>(1.0), 0.0, none, none);
    let origin = (view.camera - view.corner) / view.voxel;
    let near = entry(origin, direction);
    if near >= 0.0 {
        // A hair inside, where voxels are.
        let start = origin + (near + 1e-3) * direction;
        if SURFACES == 0u {
            trace_straight(&traced, start);
        } else if SURFACES == 1u {
            trace_two(&traced, start);
        } else {
            trace_many(&traced, start);
        }
    }
    let index = id.y * width + id.x;
    if OUTPUT == 1u {
        sums[3u * index] = vec4<f32>(traced.origin, 0.0);
        sums[3u * index + 1u] = vec4<f32>(traced.direction, 0.0);
        sums[3u * index + 2u] = vec4<f32>(traced.tint, 0.0);
        return;
    }
    var light = traced.tint * environment_light(traced.origin, traced.direction);
    if FRESNEL && traced.mirror_share > 0.0 {
        light = mix(light, environment_light(traced.mirror_origin, traced.mirror_direction), traced.mirror_share);
    }
    sums[index] += vec4<f32>(light, 0.0);
}
