//! What is rendered: a mesh made ready for light, and what its materials do to it.

use glam::DVec3;
use trixel::{Attribute, Bounds, Material, Mesh, Topology, UpAxis};

use super::error::LightError;
use super::normals::corner_normals;

/// What a material does to light that passes through it.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// The material's name, or empty.
    pub name: String,
    /// Index of refraction, 0.1 to 10; air has 1.
    pub refraction_index: f64,
    /// Absorption of red, green and blue, 0 or more: the natural logarithm of the share of light that is lost over the
    /// longest side of the object's box.
    pub absorption: [f64; 3],
    /// Linear colour of the surface, where it is shown as an opaque one.
    pub color: [f32; 3],
}

impl Medium {
    /// Refraction indices that a medium may have.
    pub const INDICES: [f64; 2] = [0.1, 10.0];
    /// The most absorption.
    pub const MAX_ABSORPTION: f64 = 1e6;

    /// What a material's own values say: its refraction index, and an absorption that leaves its base colour of light that
    /// passes through a third of the object.
    #[must_use]
    pub fn of_material(material: &Material) -> Self {
        let [r, g, b, _] = material.base_color;
        let color = [r, g, b].map(|c| if c > 0.0 { c.min(1.0) } else { 0.0 });
        Self {
            name: material.name.clone(),
            refraction_index: f64::from(material.index_of_refraction),
            absorption: color.map(|c| -3.0 * f64::from(c.max(1e-3)).ln()),
            color,
        }
    }

    /// [`Medium::of_material`] for each material of a mesh, and one more for triangles without a material.
    #[must_use]
    pub fn of_mesh(mesh: &Mesh) -> Vec<Self> {
        mesh.materials.iter().chain([&Material::default()]).map(Self::of_material).collect()
    }

    fn check(&self) -> Result<(), LightError> {
        let [least, most] = Self::INDICES;
        range("refraction index", self.refraction_index, least, most)?;
        self.absorption.iter().try_for_each(|&a| range("absorption", a, 0.0, Self::MAX_ABSORPTION))
    }

    fn same_optics(&self, other: &Self) -> bool {
        self.refraction_index == other.refraction_index && self.absorption == other.absorption
    }
}

/// An error unless `value` lies between the ends.
pub(super) fn range(option: &'static str, value: f64, min: f64, max: f64) -> Result<(), LightError> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(LightError::Range { option, value, min, max }) }
}

/// How a mesh is put into the world of light: its box's centre to the origin, its longest side to 1, its up axis to z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    center: DVec3,
    size: DVec3,
    longest: f64,
    up: UpAxis,
}

impl Placement {
    /// The placement of what is in a box. For an animation take a box round all frames.
    ///
    /// # Errors
    /// When the box is a point or not finite.
    pub fn new(bounds: &Bounds, up: UpAxis) -> Result<Self, LightError> {
        let (low, high) = (DVec3::from_array(bounds.min), DVec3::from_array(bounds.max));
        let size = high - low;
        let longest = size.max_element();
        if !(longest.is_normal() && size.min_element() >= 0.0) {
            return Err(LightError::Empty);
        }
        Ok(Self { center: low + 0.5 * size, size, longest, up })
    }

    /// A direction or difference of the mesh, turned but not scaled. The front comes to face -y.
    fn turn(&self, v: DVec3) -> DVec3 {
        match self.up {
            UpAxis::X => DVec3::new(-v.y, -v.z, v.x),
            UpAxis::Y => DVec3::new(v.x, -v.z, v.y),
            UpAxis::Z => v,
        }
    }

    fn point(&self, p: [f64; 3]) -> DVec3 {
        self.turn((DVec3::from_array(p) - self.center) / self.longest)
    }

    /// How far the box reaches from its centre in the world of light.
    #[must_use]
    pub fn half(&self) -> [f64; 3] {
        (self.turn(self.size).abs() / (2.0 * self.longest)).to_array()
    }
}

/// A mesh in the world of light: z up, its front facing -y, the centre of its box at the origin, its longest side 1.
#[derive(Clone, Debug)]
pub struct OpticalScene {
    /// Positions, triangles and shading normals alone.
    pub(super) mesh: Mesh,
    pub(super) normals: Vec<[DVec3; 3]>,
    pub(super) half: DVec3,
    pub(super) media: Vec<Medium>,
    /// Whether a medium is made of sheets without an inside.
    pub(super) sheets: Vec<bool>,
    /// Medium of each triangle.
    pub(super) medium_of: Vec<u8>,
    /// Media that light tells apart: a medium stands for all of the same optics.
    pub(super) classes: Vec<Medium>,
    /// Class of each medium.
    pub(super) class_of: Vec<u8>,
}

impl OpticalScene {
    /// The most media of different optics. Where their insides overlap the last one counts: a figure inside a glass ball
    /// comes after the ball.
    pub const MAX_CLASSES: usize = 4;
    /// The most media.
    pub const MAX_MEDIA: usize = 255;
    /// A material with a larger share of open edges consists of sheets, such as leaves.
    const SHEET_EDGES: f64 = 0.1;

    /// Makes a mesh ready. `media` has one medium for each material, and a last one for triangles without.
    ///
    /// # Errors
    /// When the mesh has no triangle or a broken one, or a medium is out of range.
    pub fn new(mesh: &Mesh, placement: &Placement, media: &[Medium]) -> Result<Self, LightError> {
        mesh.check()?;
        if mesh.triangles.is_empty() || media.is_empty() {
            return Err(LightError::Empty);
        }
        let (media, medium_of) = used_media(mesh, media)?;
        media.iter().try_for_each(Medium::check)?;
        let mut classes: Vec<Medium> = vec![];
        let mut class_of = vec![];
        for medium in &media {
            let class = classes.iter().position(|class| class.same_optics(medium)).unwrap_or(classes.len());
            if class == classes.len() {
                classes.push(medium.clone());
            }
            class_of.push(narrow(class));
        }
        if media.len() == 1 {
            classes[0].name.clone_from(&media[0].name);
        }
        let positions = mesh.positions.iter().map(|&p| placement.point(p).to_array()).collect();
        let mut placed = Mesh::new(positions, mesh.triangles.clone());
        placed.normals = mesh.normals.as_ref().map(|normals| {
            let turned = |n: &[f32; 3]| placement.turn(DVec3::from_array(n.map(f64::from))).as_vec3().to_array();
            Attribute { values: normals.values.iter().map(turned).collect(), corners: normals.corners.clone() }
        });
        let class = |triangle: usize| medium_of.get(triangle).map_or(0, |&medium| class_of[usize::from(medium)]);
        let normals = corner_normals(&placed, class);
        placed.normals = Some(Attribute {
            values: normals.iter().flatten().map(|n| n.as_vec3().to_array()).collect(),
            corners: Some((0..narrow32(normals.len())).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()),
        });
        let mut scene = Self {
            mesh: placed,
            normals,
            half: DVec3::from_array(placement.half()),
            sheets: vec![],
            media,
            medium_of,
            classes,
            class_of,
        };
        scene.sheets = (0..scene.media.len()).map(|medium| scene.is_of_sheets(medium)).collect();
        Ok(scene)
    }

    /// How far the object's box reaches from its centre, which is the origin.
    #[must_use]
    pub fn half(&self) -> [f64; 3] {
        self.half.to_array()
    }

    /// Height of the floor, which the object stands on.
    pub(super) fn floor(&self) -> f64 {
        -self.half.z
    }

    /// The triangles of some media, with everything of the others left out.
    pub(super) fn part(&self, of: impl Fn(usize) -> bool) -> Mesh {
        let triangles = self.mesh.triangles.iter().zip(&self.medium_of);
        let triangles = triangles.filter(|(_, medium)| of(usize::from(**medium))).map(|(t, _)| *t).collect();
        Mesh::new(self.mesh.positions.clone(), triangles)
    }

    /// The triangles of one class.
    pub(super) fn part_of_class(&self, class: usize) -> Mesh {
        self.part(|medium| usize::from(self.class_of[medium]) == class)
    }

    pub(super) fn class_of_triangle(&self, triangle: usize) -> usize {
        self.medium_of.get(triangle).map_or(0, |&medium| usize::from(self.class_of[usize::from(medium)]))
    }

    /// Refuses more classes than the shaders hold.
    pub(super) fn check_classes(&self) -> Result<(), LightError> {
        let (found, most) = (self.classes.len(), Self::MAX_CLASSES);
        if found > most { Err(LightError::TooManyMedia { found, most }) } else { Ok(()) }
    }

    fn is_of_sheets(&self, medium: usize) -> bool {
        let topology = Topology::of(&self.part(|of| of == medium));
        #[expect(clippy::cast_precision_loss, reason = "a ratio")]
        let sheets = topology.open_edges as f64 > Self::SHEET_EDGES * topology.edges as f64;
        sheets
    }
}

/// The media that triangles have, and each triangle's place among them.
fn used_media(mesh: &Mesh, media: &[Medium]) -> Result<(Vec<Medium>, Vec<u8>), LightError> {
    let last = media.len() - 1;
    let of = |triangle: usize| {
        let material = mesh.triangle_materials.get(triangle).copied().unwrap_or(Mesh::NO_MATERIAL);
        usize::try_from(material).map_or(last, |material| material.min(last))
    };
    let mut used = vec![false; media.len()];
    (0..mesh.triangles.len()).for_each(|triangle| used[of(triangle)] = true);
    let found = used.iter().filter(|used| **used).count();
    if found > OpticalScene::MAX_MEDIA {
        return Err(LightError::TooManyMedia { found, most: OpticalScene::MAX_MEDIA });
    }
    let mut place = vec![0; media.len()];
    let mut kept = vec![];
    for (material, medium) in media.iter().enumerate().filter(|(material, _)| used[*material]) {
        place[material] = narrow(kept.len());
        kept.push(medium.clone());
    }
    Ok((kept, (0..mesh.triangles.len()).map(|triangle| place[of(triangle)]).collect()))
}

/// A number of media, of which there are few.
fn narrow(count: usize) -> u8 {
    u8::try_from(count).unwrap_or(u8::MAX)
}

/// A number of triangles, which 32 bits hold.
fn narrow32(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX / 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(mesh: &Mesh, up: UpAxis) -> OpticalScene {
        let placement = Placement::new(&mesh.bounds().unwrap(), up).unwrap();
        OpticalScene::new(mesh, &placement, &Medium::of_mesh(mesh)).unwrap()
    }

    #[test]
    fn every_up_axis_ends_up_up_and_nothing_is_mirrored() {
        for (up, axis) in [(UpAxis::X, DVec3::X), (UpAxis::Y, DVec3::Y), (UpAxis::Z, DVec3::Z)] {
            let unit = Bounds { min: [-0.5; 3], max: [0.5; 3] };
            let placement = Placement::new(&unit, up).unwrap();
            assert_eq!(placement.turn(axis), DVec3::Z);
            let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| placement.turn(v));
            assert_eq!(x.cross(y).dot(z), 1.0);
            let front = if up == UpAxis::Z { DVec3::NEG_Y } else { DVec3::Z };
            assert_eq!(placement.turn(front), DVec3::NEG_Y);
        }
    }

    #[test]
    fn the_longest_side_is_one_wherever_the_mesh_is() {
        let mut mesh = trixel::scene::build("torus:16").unwrap();
        mesh.positions.iter_mut().for_each(|p| *p = p.map(|c| 3000.0 * c + 1e6));
        let scene = placed(&mesh, UpAxis::Z);
        let bounds = scene.mesh.bounds().unwrap();
        let low = DVec3::from_array(bounds.min);
        assert!((low + scene.half).length() < 1e-9 && scene.half.max_element() == 0.5);
        assert_eq!(scene.floor(), -scene.half.z);
    }

    #[test]
    fn leaves_are_sheets_and_wood_is_not() {
        let tree = trixel::scene::build("tree:3").unwrap();
        let scene = placed(&tree, UpAxis::Z);
        let names: Vec<_> = scene.media.iter().map(|medium| medium.name.as_str()).collect();
        assert_eq!(
            (names.as_slice(), scene.sheets.as_slice()),
            (["bark", "leaf"].as_slice(), [false, true].as_slice())
        );
        assert_eq!(scene.classes.len(), 2);
    }

    #[test]
    fn media_of_the_same_optics_are_one_class() {
        let tree = trixel::scene::build("tree:2").unwrap();
        let placement = Placement::new(&tree.bounds().unwrap(), UpAxis::Z).unwrap();
        let mut media = Medium::of_mesh(&tree);
        media.iter_mut().for_each(|medium| medium.absorption = [1.0; 3]);
        let scene = OpticalScene::new(&tree, &placement, &media).unwrap();
        assert_eq!((scene.classes.len(), scene.class_of.as_slice()), (1, [0, 0].as_slice()));
        media[0].refraction_index = f64::NAN;
        assert!(OpticalScene::new(&tree, &placement, &media).unwrap_err().to_string().contains("refraction index"));
    }

    #[test]
    fn nothing_to_render_is_an_error() {
        let point = Bounds { min: [1.0; 3], max: [1.0; 3] };
        assert!(Placement::new(&point, UpAxis::Z).is_err());
        let placement = Placement::new(&Bounds { min: [0.0; 3], max: [1.0; 3] }, UpAxis::Z).unwrap();
        assert!(OpticalScene::new(&Mesh::default(), &placement, &Medium::of_mesh(&Mesh::default())).is_err());
    }
}
