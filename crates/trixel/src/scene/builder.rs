//! What scenes are built of: tessellated boxes, surfaces of revolution and tubes, with vertices shared.

use super::numbers::{Vec3, add, dot, scale, sin_cos};
use crate::material::Material;
use crate::mesh::{Mesh, UpAxis};

/// A mesh under construction.
pub(super) struct Builder {
    mesh: Mesh,
    material: u32,
    rows: [Vec3; 3],
    offset: Vec3,
    overflow: bool,
}

impl Builder {
    pub(super) fn with_capacity(triangles: u64) -> Self {
        let mut mesh = Mesh { up: Some(UpAxis::Z), ..Mesh::default() };
        mesh.triangles.reserve(usize::try_from(triangles).unwrap_or(0));
        let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Self { mesh, material: Mesh::NO_MATERIAL, rows, offset: [0.0; 3], overflow: false }
    }

    /// The mesh, or `None` when it had more vertices than 32 bits can name.
    pub(super) fn finish(mut self) -> Option<Mesh> {
        if self.mesh.materials.is_empty() {
            self.mesh.triangle_materials.clear();
        }
        (!self.overflow).then_some(self.mesh)
    }

    /// What follows is turned by the rotation whose rows these are, then moved.
    pub(super) fn place(&mut self, rows: [Vec3; 3], offset: Vec3) {
        (self.rows, self.offset) = (rows, offset);
    }

    /// What follows has a new material: a name, a linear colour, and roughness.
    pub(super) fn material(&mut self, name: &str, [r, g, b]: [f32; 3], roughness: f32) {
        self.material = index(self.mesh.materials.len());
        let name = name.to_owned();
        self.mesh.materials.push(Material { name, base_color: [r, g, b, 1.0], roughness, ..Material::default() });
    }

    /// What follows has a new material that light passes through: a name, a linear colour, and an index of refraction.
    pub(super) fn clear_material(&mut self, name: &str, color: [f32; 3], index_of_refraction: f32) {
        self.material(name, color, 0.0);
        if let Some(material) = self.mesh.materials.last_mut() {
            (material.index_of_refraction, material.transmission) = (index_of_refraction, 1.0);
        }
    }

    /// What follows has a material made before, counted from 0.
    pub(super) fn use_material(&mut self, material: u32) {
        self.material = material;
    }

    pub(super) fn vertex(&mut self, p: Vec3) -> u32 {
        let placed = add(self.rows.map(|row| dot(row, p)), self.offset);
        let Ok(vertex) = u32::try_from(self.mesh.positions.len()) else {
            self.overflow = true;
            return 0;
        };
        self.mesh.positions.push(placed);
        vertex
    }

    /// The number that the next vertex will have.
    pub(super) fn next_vertex(&self) -> u32 {
        index(self.mesh.positions.len())
    }

    pub(super) fn triangle(&mut self, corners: [u32; 3]) {
        if !self.overflow {
            self.mesh.triangles.push(corners);
            self.mesh.triangle_materials.push(self.material);
        }
    }

    /// Two triangles; the corners go counterclockwise as seen from outside.
    pub(super) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// A quad with vertices of its own.
    pub(super) fn sheet(&mut self, corners: [Vec3; 4]) {
        let vertices = corners.map(|p| self.vertex(p));
        self.quad(vertices);
    }

    /// A closed box whose edges are cut into `n`: `12 n^2` triangles.
    pub(super) fn block(&mut self, low: Vec3, high: Vec3, n: u32) {
        let start = self.next_vertex();
        let at = |axis: usize, i: u32| {
            let t = f64::from(i) / f64::from(n);
            // Not `low + t * (high - low)`, which may miss `high`.
            low[axis] * (1.0 - t) + high[axis] * t
        };
        for x in 0..=n {
            for y in 0..=n {
                self.vertex([at(0, x), at(1, y), low[2]]);
            }
        }
        for x in 0..=n {
            for y in 0..=n {
                self.vertex([at(0, x), at(1, y), high[2]]);
            }
        }
        // Between the two full layers, rings of 4 n vertices.
        let ring = |i: u32| match i / n {
            0 => (i, 0),
            1 => (n, i - n),
            2 => (3 * n - i, n),
            _ => (0, 4 * n - i),
        };
        for z in 1..n {
            for i in 0..4 * n {
                let (x, y) = ring(i);
                self.vertex([at(0, x), at(1, y), at(2, z)]);
            }
        }
        let layer = (n + 1) * (n + 1);
        let on_layer = |top: u32, x: u32, y: u32| start + top * layer + x * (n + 1) + y;
        for x in 0..n {
            for y in 0..n {
                let corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
                self.quad(corners.map(|(x, y)| on_layer(1, x, y)));
                let [a, b, c, d] = corners.map(|(x, y)| on_layer(0, x, y));
                self.quad([a, d, c, b]);
            }
        }
        let on_side = |z: u32, i: u32| {
            let (x, y) = ring(i % (4 * n));
            match z {
                0 => on_layer(0, x, y),
                z if z == n => on_layer(1, x, y),
                z => start + 2 * layer + (z - 1) * 4 * n + i % (4 * n),
            }
        };
        for z in 0..n {
            for i in 0..4 * n {
                self.quad([on_side(z, i), on_side(z, i + 1), on_side(z + 1, i + 1), on_side(z + 1, i)]);
            }
        }
    }

    /// A surface of revolution about the z axis through `base`: `profile` lists radius and height upwards, `n` are the
    /// segments around. A radius of 0 closes an end in one vertex (`n` triangles); other rows have `2 n` triangles.
    pub(super) fn lathe(&mut self, base: Vec3, profile: &[[f64; 2]], n: u32) {
        let rings = profile.iter().map(|&[radius, height]| {
            let center = add(base, [0.0, 0.0, height]);
            (center, radius, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        });
        self.rings(rings, n);
    }

    /// A surface through rings of `n` vertices: centre, radius and two perpendicular directions each, such that the
    /// rings follow one another along the cross product of these. A radius of 0 makes one vertex.
    pub(super) fn rings(&mut self, rings: impl Iterator<Item = (Vec3, f64, [Vec3; 2])>, n: u32) {
        let mut below: Option<(u32, bool)> = None;
        for (center, radius, [u, v]) in rings {
            let start = self.next_vertex();
            let point = radius == 0.0;
            if point {
                self.vertex(center);
            } else {
                for i in 0..n {
                    let (sin, cos) = sin_cos(f64::from(i) / f64::from(n));
                    self.vertex(add(center, add(scale(u, radius * cos), scale(v, radius * sin))));
                }
            }
            if let Some((last, last_point)) = below {
                for i in 0..n {
                    let j = (i + 1) % n;
                    match (last_point, point) {
                        (false, false) => self.quad([last + i, last + j, start + j, start + i]),
                        (true, false) => self.triangle([last, start + j, start + i]),
                        (false, true) => self.triangle([last + i, last + j, start]),
                        (true, true) => {}
                    }
                }
            }
            below = Some((start, point));
        }
    }
}

/// A list's length as an index; lists longer than 32 bits never get that far.
fn index(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}
