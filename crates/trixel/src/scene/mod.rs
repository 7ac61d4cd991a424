//! Built-in procedural scenes: what `scene:NAME` and `scene:NAME:N` stand for.
//!
//! A scene depends on its name and parameter alone. Only additions, multiplications, divisions and square roots make its
//! coordinates (`numbers` has its own sines), all of which IEEE 754 rounds the same everywhere, so a scene is the same
//! to the last bit on every platform.

mod builder;
mod city;
mod cube;
mod hairball;
mod knot;
mod numbers;
mod room;
mod sphere;
mod torus;
mod tree;
mod triangle;

use crate::mesh::Mesh;
use builder::Builder;

/// A built-in scene. All have z up.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// The name, as in `scene:NAME`.
    pub name: &'static str,
    /// One line that says what it shows.
    pub description: &'static str,
    /// What N means in `scene:NAME:N`.
    pub parameter: &'static str,
    /// N when it is not given.
    pub default: u32,
    /// The least N.
    pub min: u32,
    /// The largest N.
    pub max: u32,
    count: fn(u64) -> u64,
    fill: fn(&mut Builder, u32),
}

/// Every built-in scene.
pub const SCENES: [Scene; 11] = [
    cube::SCENE,
    torus::SCENE,
    sphere::SCENE,
    triangle::SCENE,
    room::SCENE,
    room::ROTATED,
    hairball::SCENE,
    city::SCENE,
    tree::SCENE,
    knot::SCENE,
    knot::IN_A_BALL,
];

/// Why a scene could not be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No scene has the name.
    #[error("there is no scene '{name}'{}; the scenes are {}", suggest(name), names())]
    Unknown {
        /// The name asked for.
        name: String,
    },
    /// The parameter is not a positive integer.
    #[error(
        "scene:{name}:{parameter}: '{parameter}' is not a positive whole number; N is the {meaning}, {min} to {max}"
    )]
    NotANumber {
        /// The scene.
        name: &'static str,
        /// What stands in place of N.
        parameter: String,
        /// What N means.
        meaning: &'static str,
        /// The least N.
        min: u32,
        /// The largest N.
        max: u32,
    },
    /// The parameter is out of range.
    #[error("scene:{name}:{value}: {value} is out of range; N is the {meaning}, {min} to {max}")]
    OutOfRange {
        /// The scene.
        name: &'static str,
        /// The parameter.
        value: u64,
        /// What N means.
        meaning: &'static str,
        /// The least N.
        min: u32,
        /// The largest N.
        max: u32,
    },
    /// Vertices no longer fit into 32-bit indices.
    #[error("scene:{name}:{value} has more vertices than 32-bit indices can name; choose a smaller N")]
    TooManyVertices {
        /// The scene.
        name: &'static str,
        /// The parameter.
        value: u32,
    },
}

impl Scene {
    /// How many triangles the scene has for a given N.
    ///
    /// ```
    /// let sphere = trixel::scene::find("sphere").unwrap();
    /// assert_eq!(sphere.triangles(10), 2000);
    /// ```
    #[must_use]
    pub fn triangles(&self, n: u32) -> u64 {
        (self.count)(u64::from(n))
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// When `n` is out of range.
    pub fn build(&self, n: u32) -> Result<Mesh, SceneError> {
        let Self { name, parameter: meaning, min, max, .. } = *self;
        if !(min..=max).contains(&n) {
            return Err(SceneError::OutOfRange { name, value: u64::from(n), meaning, min, max });
        }
        let mut builder = Builder::with_capacity(self.triangles(n));
        (self.fill)(&mut builder, n);
        builder.finish().ok_or(SceneError::TooManyVertices { name, value: n })
    }
}

/// The scene of a name.
///
/// # Errors
/// When there is none, with the names there are.
pub fn find(name: &str) -> Result<&'static Scene, SceneError> {
    const ALL: &[Scene] = &SCENES;
    ALL.iter().find(|scene| scene.name == name).ok_or_else(|| SceneError::Unknown { name: name.to_owned() })
}

/// Builds the scene `NAME` or `NAME:N`, that is what stands after `scene:`.
///
/// # Errors
/// When there is no such scene, or N is not a number or out of range.
///
/// ```
/// let mesh = trixel::scene::build("torus:64")?;
/// assert_eq!(mesh.triangles.len(), 64 * 64);
/// # Ok::<(), trixel::scene::SceneError>(())
/// ```
pub fn build(spec: &str) -> Result<Mesh, SceneError> {
    let (name, parameter) = spec.split_once(':').map_or((spec, None), |(name, parameter)| (name, Some(parameter)));
    let scene = find(name)?;
    let Scene { name, parameter: meaning, default, min, max, .. } = *scene;
    let n = match parameter {
        None => default,
        Some(text) => {
            let value: u64 = text.parse().map_err(|_| SceneError::NotANumber {
                name,
                parameter: text.to_owned(),
                meaning,
                min,
                max,
            })?;
            u32::try_from(value).map_err(|_| SceneError::OutOfRange { name, value, meaning, min, max })?
        }
    };
    scene.build(n)
}

fn names() -> String {
    SCENES.map(|scene| scene.name).join(", ")
}

/// `"; did you mean ...?"` when a scene's name is close.
fn suggest(name: &str) -> String {
    let name = name.to_lowercase();
    let closest = SCENES
        .iter()
        .map(|scene| (edit_distance(&name, scene.name), scene.name))
        .min()
        .filter(|&(distance, known)| distance <= 2 && distance < known.len().min(name.chars().count()));
    closest.map_or_else(String::new, |(_, known)| format!("; did you mean '{known}'?"))
}

/// Insertions, removals and replacements of a character between two words (Levenshtein's distance).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = i;
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests;
