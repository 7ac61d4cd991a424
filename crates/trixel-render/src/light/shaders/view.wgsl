// What every shader of light knows. `View` of `gpu/view.rs` has the same fields.

struct View {
    // The camera, and the width of a pixel at distance 1.
    camera: vec3<f32>,
    pixel: f32,
    right: vec3<f32>,
    // Height of the floor.
    floor_height: f32,
    up: vec3<f32>,
    // Degrees are cosines here: of the angle of double hits.
    double_hit: f32,
    forward: vec3<f32>,
    // Share of the light from everywhere.
    ambient: f32,
    // Low corner of the voxels, in the world or, for shadows, in the light's space; and a voxel's edge.
    corner: vec3<f32>,
    voxel: f32,
    // The light's space.
    across: vec3<f32>,
    width: f32,
    across_too: vec3<f32>,
    height: f32,
    to_sun: vec3<f32>,
    unused: f32,
    // Colour of a plain background.
    plain: vec3<f32>,
    unused_too: f32,
    // Where in the pixel the sample lies.
    jitter: vec2<f32>,
    unused_at_last: vec2<f32>,
    // Absorption and refraction index of each class, and of air.
    media: array<vec4<f32>, 5>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var panorama: texture_2d<f32>;
@group(0) @binding(2) var smooth_sampler: sampler;

// The unit direction through a point of the picture, in pixels from its top left corner.
fn view_direction(pixel: vec2<f32>) -> vec3<f32> {
    let across = (pixel.x - view.width * 0.5) * view.pixel;
    let upwards = (view.height * 0.5 - pixel.y) * view.pixel;
    return normalize(view.forward + across * view.right + upwards * view.up);
}
