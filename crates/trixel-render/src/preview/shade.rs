//! What a pixel sees: surfaces, and how much of the key light and of the sky reaches them.
//!
//! Shadow and sky rays are few a pixel, but their directions differ from pixel to pixel in tiles of [`TILE`] squared, so
//! that averaging one tile's worth of neighbours on the same surface ([`super::resolve`]) leaves no noise:
//! A. Keller & W. Heidrich, *Interleaved Sampling*, Eurographics Workshop on Rendering 2001.

use glam::{DVec3, Vec3};
use trixel::Grid;

use super::camera::{Camera, Frame, View};
use super::pyramid::{Hit, Pyramid};
use super::{PreviewOptions, VoxelColor};
use crate::picture::linear_from_srgb;

/// Edge, in pixels, of the tile after which ray directions repeat.
pub(super) const TILE: u32 = 4;

/// Share of the picture's half size that stays free around the object.
const MARGIN: f64 = 0.12;
/// Most cells whose corners the camera is fitted to.
const FIT_CELLS: u64 = 1 << 21;
/// Direction of the key light in the camera's frame: from the left, the front and above.
const KEY_DIRECTION: DVec3 = DVec3::new(-0.48, -0.34, 0.92);
/// Tangent of the key light's half width, which makes its shadows soft.
const KEY_SPREAD: f64 = 0.10;
const KEY_COLOR: Vec3 = Vec3::new(1.62, 1.50, 1.32);
const SKY_COLOR: Vec3 = Vec3::new(0.44, 0.50, 0.60);
const GROUND_BOUNCE: Vec3 = Vec3::new(0.34, 0.31, 0.29);
/// A second light from the right, too weak to need shadows.
const FILL_DIRECTION: Vec3 = Vec3::new(0.85, -0.45, 0.30);
const FILL_COLOR: Vec3 = Vec3::new(0.10, 0.12, 0.15);
/// Rays to the sky, and as many to the key light, that the first sample of a pixel sends.
const RAYS: usize = 2;
/// How far rays to the sky look, as a share of the object's longest side.
const SKY_REACH: f64 = 0.6;
/// Voxels narrower than the first number of pixels are shaded by the smoothed normal, above the second by their faces.
const SMOOTH_PIXELS: [f64; 2] = [2.0, 6.0];
/// Neighbours whose linear colours differ by more than this get more samples.
const COLOR_STEP: f32 = 0.02;
/// Edges appear between these widths of a voxel in pixels.
const EDGE_PIXELS: [f64; 2] = [5.0, 14.0];

/// What the samples of one pixel found, before light and sky are averaged over neighbours.
#[derive(Clone, Copy, Default)]
pub(super) struct Pixel {
    /// Light that the object reflects of the sky, were it all visible (linear, averaged over all samples).
    pub sky: Vec3,
    /// The same of the key light.
    pub key: Vec3,
    /// Where the first sample on the object is, and its normal.
    pub position: Vec3,
    /// The normal there.
    pub normal: Vec3,
    /// The colour there.
    pub albedo: Vec3,
    /// Whether the edge of a voxel is drawn close by.
    pub detail: bool,
    /// Samples on the object.
    pub object: Visibility,
    /// Samples on the ground.
    pub ground: Visibility,
}

/// Sums over samples of one kind of surface.
#[derive(Clone, Copy, Default)]
pub(super) struct Visibility {
    /// Share of the pixel's samples that see this kind of surface.
    pub coverage: f32,
    /// Rays that were sent to the sky, and as many to the key light.
    pub rays: f32,
    /// Sum of the visible share of the sky over these.
    pub sky: f32,
    /// Sum of the visible share of the key light over these.
    pub key: f32,
}

impl Visibility {
    fn add(&mut self, sky: f32, key: f32) {
        self.rays += 1.0;
        self.sky += sky;
        self.key += key;
    }
}

/// Everything that shading needs to know.
pub(super) struct Scene<'a> {
    pyramid: Pyramid<'a>,
    camera: Camera,
    frame: Frame,
    /// Edge lengths of a voxel; the longest is 1.
    voxel: DVec3,
    /// Height of the ground, when there is one.
    ground: Option<f64>,
    /// The set voxels' box.
    low: DVec3,
    high: DVec3,
    reach: f64,
    key: DVec3,
    albedo: Vec3,
    colors: Option<&'a VoxelColor<'a>>,
    voxel_edges: bool,
    kernel: Kernel,
    /// Offsets within a pixel of the samples after the first, which is in the middle.
    offsets: Vec<[f64; 2]>,
    /// Points of the unit disk that light and sky rays go through.
    disk: Vec<[f64; 2]>,
}

impl<'a> Scene<'a> {
    pub(super) fn new(
        grid: &Grid,
        pyramid: Pyramid<'a>,
        colors: Option<&'a VoxelColor<'a>>,
        options: &PreviewOptions,
    ) -> Self {
        let size = DVec3::from_array(grid.voxel_size());
        // Voxels a million times longer than wide would only lose the rays' precision.
        let voxel = (size / size.max_element()).max(DVec3::splat(1e-6));
        let (lo, hi) = pyramid.occupied_box();
        let place = |v: [i32; 3]| DVec3::from_array(v.map(f64::from)) * voxel;
        let (low, high) = (place(lo), place(hi));

        let mut points = Vec::new();
        pyramid.visit_outer_cells(FIT_CELLS, |lo, hi| {
            let ends = [place(lo), place(hi)];
            points.extend((0..8_usize).map(|i| DVec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z)));
        });
        let frame = Frame::new(options.up).turned(options.azimuth);
        let (elevation, field_of_view) = (options.elevation, options.field_of_view);
        let camera = Camera::fit(View { frame, elevation, field_of_view, size: options.size }, &points, MARGIN);

        let floor = low.dot(frame.up);
        let seen_from_above = camera.origin().dot(frame.up) > floor || camera.forward().dot(frame.up) < 0.0;
        Self {
            camera,
            frame,
            voxel,
            ground: (options.ground && seen_from_above && options.elevation >= 0.0).then_some(floor),
            low,
            high,
            reach: SKY_REACH * (high - low).max_element(),
            key: from_frame(frame, KEY_DIRECTION.normalize()),
            albedo: Vec3::from_array(options.color.map(linear_from_srgb)),
            colors,
            voxel_edges: options.voxel_edges,
            kernel: Kernel::new(),
            offsets: (1..options.samples_per_pixel).map(sequence).collect(),
            disk: (0..).map(|i| disk(sequence(i))).take(RAYS * TILE_ORDER.as_flattened().len()).collect(),
            pyramid,
        }
    }

    /// How far from another pixel's tangent plane a surface may be to count as the same.
    pub(super) fn plane_tolerance(&self) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "a length of a few voxels")]
        let voxel = self.voxel.max_element() as f32;
        voxel * 1.5
    }

    /// Takes the first sample of a pixel, in its middle, with all its rays to the sky and the light.
    pub(super) fn first_sample(&self, x: u32, y: u32) -> Pixel {
        let mut pixel = Pixel::default();
        let tile = TILE_ORDER[(y % TILE) as usize][(x % TILE) as usize];
        let rays = std::array::from_fn(|i| self.disk[i * TILE_ORDER.as_flattened().len() + tile]);
        self.sample(&mut pixel, [f64::from(x) + 0.5, f64::from(y) + 0.5], 1.0, Some(rays));
        pixel
    }

    /// Takes the other samples of a pixel.
    pub(super) fn more_samples(&self, pixel: &mut Pixel, x: u32, y: u32) {
        #[expect(clippy::cast_precision_loss, reason = "at most 64 samples")]
        let share = 1.0 / (self.offsets.len() + 1) as f32;
        pixel.sky *= share;
        pixel.key *= share;
        pixel.object.coverage *= share;
        pixel.ground.coverage *= share;
        for [dx, dy] in &self.offsets {
            self.sample(pixel, [f64::from(x) + dx, f64::from(y) + dy], share, None);
        }
    }

    /// Whether one sample is not enough: neighbours show other things.
    pub(super) fn needs_more(&self, pixel: &Pixel, neighbour: &Pixel) -> bool {
        let object = pixel.object.coverage > 0.0;
        if object != (neighbour.object.coverage > 0.0) {
            return true;
        }
        let apart = (neighbour.position - pixel.position).dot(pixel.normal).abs();
        let colors_differ = (pixel.albedo - neighbour.albedo).abs().max_element() > COLOR_STEP;
        object
            && (pixel.detail
                || colors_differ
                || pixel.normal.dot(neighbour.normal) < 0.99
                || apart > self.plane_tolerance())
    }

    fn sample(&self, pixel: &mut Pixel, [x, y]: [f64; 2], share: f32, rays: Option<[[f64; 2]; RAYS]>) {
        let (origin, direction) = self.camera.ray(x, y);
        if let Some(hit) = self.pyramid.march(origin / self.voxel, direction / self.voxel, f64::INFINITY) {
            self.shade_object(pixel, share, origin, direction, &hit, rays);
        } else if let Some(point) = self.ground_point(origin, direction) {
            pixel.ground.coverage += share;
            for ray in rays.into_iter().flatten() {
                let (sky, key) = self.ground_visibility(point, ray);
                pixel.ground.add(sky, key);
            }
        }
    }

    fn shade_object(
        &self,
        pixel: &mut Pixel,
        share: f32,
        origin: DVec3,
        direction: DVec3,
        hit: &Hit,
        rays: Option<[[f64; 2]; RAYS]>,
    ) {
        let position = origin + hit.t * direction;
        let mut face = DVec3::ZERO;
        face[hit.axis] = -direction[hit.axis].signum();

        // How many pixels a voxel is wide here decides whether it is shaded as a box or as a grain of a surface.
        let width = self.voxel.min_element() / self.camera.pixel_at(hit.t);
        let smooth = 1.0 - smoothstep(SMOOTH_PIXELS, width);
        let mut normal = face;
        let mut lift = 1e-4 * self.voxel[hit.axis];
        if smooth > 0.0 {
            let gradient = self.kernel.normal(&self.pyramid, hit, face) / self.voxel;
            normal = face.lerp(gradient.normalize_or(face), smooth).normalize_or(face);
            lift += 0.5 * smooth * self.voxel[hit.axis];
        }
        // Rays start off the surface, and further along the smoothed normal so that its own steps cast no shadow.
        let start = position + face * lift + normal * self.voxel * smooth;

        let lit = normal.dot(self.key);
        pixel.object.coverage += share;
        for ray in rays.into_iter().flatten() {
            let key = if lit > 0.0 { self.key_visibility(start, ray) } else { 0.0 };
            pixel.object.add(self.sky_visibility(start, normal, ray), key);
        }

        let edge = if self.voxel_edges { self.edge_shade(position, hit.axis, width) } else { 1.0 };
        pixel.detail |= edge < 1.0;
        let n = normal.as_vec3();
        let up = n.dot(self.frame.up.as_vec3());
        let fill = n.dot(from_frame(self.frame, FILL_DIRECTION.as_dvec3()).as_vec3()).max(0.0);
        let ambient = GROUND_BOUNCE.lerp(SKY_COLOR, 0.5 + 0.5 * up) + FILL_COLOR * fill;
        #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
        let lit = lit.max(0.0) as f32;
        let half = (self.key - direction).normalize_or(normal).dot(normal).max(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
        let gloss = 0.06 * lit.sqrt() * half.powi(24) as f32;
        let albedo = self.albedo(hit);
        pixel.sky += share * edge * ambient * albedo;
        pixel.key += share * edge * KEY_COLOR * (albedo * lit + gloss);
        if pixel.normal == Vec3::ZERO {
            pixel.position = position.as_vec3();
            pixel.normal = n;
            pixel.albedo = albedo;
        }
    }

    /// The linear colour of the voxel that was hit.
    fn albedo(&self, hit: &Hit) -> Vec3 {
        let voxel = hit.voxel.map(|c| u32::try_from(c).unwrap_or(0));
        let color = self.colors.and_then(|colors| colors(voxel));
        color.map_or(self.albedo, |color| Vec3::from_array(color.map(linear_from_srgb)))
    }

    /// Darkens the rim of a voxel's face, by a line of about a pixel that fades as voxels get small.
    fn edge_shade(&self, position: DVec3, axis: usize, width: f64) -> f32 {
        let strength = smoothstep(EDGE_PIXELS, width);
        if strength == 0.0 {
            return 1.0;
        }
        let shortest = self.voxel.min_element();
        let mut rim = f64::INFINITY;
        for i in (0..3).filter(|&i| i != axis) {
            let inside = (position[i] / self.voxel[i]).rem_euclid(1.0);
            rim = rim.min(inside.min(1.0 - inside) * self.voxel[i] / shortest * width);
        }
        // `rim` is in pixels from here on.
        let line = (0.018 * width).clamp(0.7, 2.5);
        let bevel = (0.07 * width).clamp(1.0, 12.0);
        let dark =
            0.26 * (1.0 - smoothstep([line * 0.5, line * 1.5], rim)) + 0.10 * (1.0 - smoothstep([0.0, bevel], rim));
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
        let shade = (1.0 - strength * dark) as f32;
        shade
    }

    fn ground_point(&self, origin: DVec3, direction: DVec3) -> Option<DVec3> {
        let floor = self.ground?;
        let falling = -direction.dot(self.frame.up);
        let t = (origin.dot(self.frame.up) - floor) / falling;
        (falling > 1e-9 && t > 0.0).then(|| origin + t * direction)
    }

    fn ground_visibility(&self, point: DVec3, ray: [f64; 2]) -> (f32, f32) {
        // Start below the lowest voxels by a hair, so that they touch the ground rather than swallow it.
        let start = point - self.frame.up * (1e-4 * self.voxel.min_element());
        let nearest = start.clamp(self.low, self.high);
        let sky = if start.distance_squared(nearest) < self.reach * self.reach {
            self.sky_visibility(start, self.frame.up, ray)
        } else {
            1.0
        };
        (sky, self.key_visibility(start, ray))
    }

    /// The share of the key light that reaches `start`, by one ray.
    fn key_visibility(&self, start: DVec3, [x, y]: [f64; 2]) -> f32 {
        let (tangent, bitangent) = self.key.any_orthonormal_pair();
        let direction = self.key + KEY_SPREAD * (x * tangent + y * bitangent);
        match self.pyramid.march(start / self.voxel, direction / self.voxel, f64::INFINITY) {
            Some(_) => 0.0,
            None => 1.0,
        }
    }

    /// The share of the sky that `start` sees, by one ray, near things counting for more than far ones.
    fn sky_visibility(&self, start: DVec3, normal: DVec3, [x, y]: [f64; 2]) -> f32 {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        // Cosine-weighted: a point of the disk, lifted onto the hemisphere.
        let direction = x * tangent + y * bitangent + (1.0 - x * x - y * y).max(1e-3).sqrt() * normal;
        match self.pyramid.march(start / self.voxel, direction / self.voxel, self.reach) {
            #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
            Some(hit) => (hit.t / self.reach).sqrt() as f32,
            None => 1.0,
        }
    }
}

/// The order in which the pixels of a tile take their directions; neighbours are far apart in it (a Bayer matrix).
const TILE_ORDER: [[usize; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// Point `index` of a sequence that fills the unit square evenly: multiples of the plastic number's powers (M. Roberts,
/// *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018).
fn sequence(index: u32) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (f64::from(index) * step + 0.5).fract())
}

/// The unit square onto the unit disk, area kept.
fn disk([u, v]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    [cos * u.sqrt(), sin * u.sqrt()]
}

/// A direction given along right, back and up.
fn from_frame(frame: Frame, direction: DVec3) -> DVec3 {
    direction.x * frame.right + direction.y * frame.back + direction.z * frame.up
}

/// 0 below the first edge, 1 above the second, smooth between.
fn smoothstep([low, high]: [f64; 2], x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A smoothed normal from the set voxels within [`Kernel::RADIUS`]: away from their centre of mass, as seen from the
/// empty voxel in front of the face that was hit. Seen from there a thin shell works as well as a solid.
struct Kernel {
    /// For each pattern of voxels along z, their summed weight and moment.
    along_z: [[f32; 2]; 1 << Self::WIDTH],
}

impl Kernel {
    const RADIUS: i32 = 3;
    const WIDTH: usize = 7;
    /// Binomial weights, nearly a Gaussian.
    const WEIGHTS: [f32; Self::WIDTH] = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];

    #[expect(clippy::cast_precision_loss, reason = "offsets of a few voxels")]
    fn new() -> Self {
        let along_z = std::array::from_fn(|pattern| {
            let mut sums = [0.0; 2];
            for (i, weight) in (0..).zip(Self::WEIGHTS) {
                if pattern >> i & 1 == 1 {
                    sums[0] += weight;
                    sums[1] += weight * (i - Self::RADIUS) as f32;
                }
            }
            sums
        });
        Self { along_z }
    }

    /// The outward gradient, in voxels, not of unit length; 0 where it is undefined.
    #[expect(clippy::cast_precision_loss, reason = "offsets of a few voxels")]
    fn normal(&self, pyramid: &Pyramid<'_>, hit: &Hit, face: DVec3) -> DVec3 {
        let mut front = hit.voxel;
        front[hit.axis] += if face[hit.axis] > 0.0 { 1 } else { -1 };
        let mut sum = Vec3::ZERO;
        for (dx, wx) in (-Self::RADIUS..).zip(Self::WEIGHTS) {
            for (dy, wy) in (-Self::RADIUS..).zip(Self::WEIGHTS) {
                let corner = [front[0] + dx, front[1] + dy, front[2] - Self::RADIUS];
                let [weight, moment] =
                    self.along_z[pyramid.run_along_z(corner, 2 * Self::RADIUS.unsigned_abs() + 1) as usize];
                sum -= wx * wy * Vec3::new(dx as f32 * weight, dy as f32 * weight, moment);
            }
        }
        sum.as_dvec3()
    }
}
