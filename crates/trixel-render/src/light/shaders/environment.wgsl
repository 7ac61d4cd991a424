// What is round the object: the twin of `environment.rs`, where the numbers are explained.

override BACKGROUND: u32 = 0u; // 0 sky, 1 plain, 2 panorama
override FLOOR: u32 = 1u; // 0 none, 1 checker, 2 plain

const SUN = vec3<f32>(-6.0 / 11.0, -6.0 / 11.0, 7.0 / 11.0);
const TILE: f32 = 0.2;
const LIGHT_TILE = vec3<f32>(0.80, 0.79, 0.76);
const DARK_TILE = vec3<f32>(0.13, 0.20, 0.30);
const PLAIN_TILE = vec3<f32>(0.74, 0.73, 0.70);
const FLOOR_LIGHT: f32 = 0.92;
const FLOOR_SLACK: f32 = 0.02;
const PI: f32 = 3.14159265359;

fn sky(d: vec3<f32>) -> vec3<f32> {
    let horizon = vec3<f32>(0.80, 0.87, 0.94);
    let above = mix(horizon, vec3<f32>(0.13, 0.30, 0.62), sqrt(max(d.z, 0.0)));
    let below = mix(horizon, vec3<f32>(0.34, 0.33, 0.32), clamp(-d.z * 5.0, 0.0, 1.0));
    let sun = max(dot(d, SUN), 0.0);
    let sun2 = sun * sun;
    let sun4 = sun2 * sun2;
    let glow = sun4 * sun4;
    var disk = glow;
    for (var i = 0; i < 7; i++) {
        disk = disk * disk;
    }
    return select(below, above, d.z >= 0.0) + vec3<f32>(1.0, 0.9, 0.75) * (0.25 * glow + 14.0 * disk);
}

fn panorama_light(d: vec3<f32>) -> vec3<f32> {
    let place = vec2<f32>(atan2(d.x, d.y) / (2.0 * PI) + 0.5, acos(clamp(d.z, -1.0, 1.0)) / PI);
    return textureSampleLevel(panorama, smooth_sampler, place, 0.0).xyz;
}

fn far_light(d: vec3<f32>) -> vec3<f32> {
    if BACKGROUND == 1u {
        return view.plain;
    }
    if BACKGROUND == 2u {
        return panorama_light(d);
    }
    return sky(d);
}

fn meets_floor(origin: vec3<f32>, d: vec3<f32>) -> bool {
    return FLOOR != 0u && d.z <= -1e-5 && origin.z > view.floor_height - FLOOR_SLACK;
}

fn floor_distance(origin: vec3<f32>, d: vec3<f32>) -> f32 {
    return max((view.floor_height - origin.z) / d.z, 0.0);
}

fn floor_color(point: vec3<f32>) -> vec3<f32> {
    if FLOOR == 2u {
        return PLAIN_TILE;
    }
    let tile = floor(point.x / TILE) + floor(point.y / TILE);
    return mix(DARK_TILE, LIGHT_TILE, tile - 2.0 * floor(tile * 0.5));
}

fn to_horizon(light: vec3<f32>, point: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    let level = vec3<f32>(d.xy, 0.0);
    let horizon = far_light(select(d, normalize(level), dot(level, level) > 0.0));
    return mix(light, horizon, smoothstep(4.0, 11.0, length(point.xy)));
}

fn environment_light(origin: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    if meets_floor(origin, d) {
        let point = origin + floor_distance(origin, d) * d;
        return to_horizon(floor_color(point) * FLOOR_LIGHT, point, d);
    }
    return far_light(d);
}
