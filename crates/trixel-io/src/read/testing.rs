//! What the tests of several readers share: resources in memory and on disk, the real meshes, and hostile variants of a
//! file.

use std::collections::HashMap;
use std::io;
use std::path::PathBuf;

use trixel::Mesh;

use super::{Loaded, Problem, ReadOptions, Resources};

#[path = "../../tests/common/models.rs"]
mod models;

/// A reader under test.
pub(super) type Reader = fn(&[u8], &ReadOptions, &dyn Resources) -> Result<Loaded, Problem>;

/// Files that exist only in the test.
#[derive(Default)]
pub(super) struct Memory(pub(super) HashMap<String, Vec<u8>>);

impl Memory {
    pub(super) fn with(name: &str, bytes: Vec<u8>) -> Self {
        Self(HashMap::from([(name.to_owned(), bytes)]))
    }
}

impl Resources for Memory {
    fn load(&self, relative: &str) -> io::Result<Vec<u8>> {
        self.0.get(relative).cloned().ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "no such file"))
    }

    fn locate(&self, relative: &str) -> Option<PathBuf> {
        self.0.contains_key(relative).then(|| PathBuf::from(relative))
    }
}

/// The files of a folder.
struct Folder(PathBuf);

impl Resources for Folder {
    fn load(&self, relative: &str) -> io::Result<Vec<u8>> {
        std::fs::read(self.0.join(relative))
    }

    fn locate(&self, relative: &str) -> Option<PathBuf> {
        Some(self.0.join(relative)).filter(|path| path.is_file())
    }
}

/// Reads one of the real meshes, or prints why it cannot and returns `None`.
pub(super) fn read_model(name: &str, reader: Reader, options: &ReadOptions) -> Option<Loaded> {
    let path = models::models_folder()?.join(name);
    let Ok(bytes) = std::fs::read(&path) else {
        println!("skipped: {} is not there", path.display());
        return None;
    };
    let resources = Folder(path.parent().unwrap().to_owned());
    let start = std::time::Instant::now();
    let loaded = reader(&bytes, options, &resources).unwrap_or_else(|problem| panic!("{name}: {problem}"));
    println!("{name}: {} triangles in {:.1?}", loaded.mesh.triangles.len(), start.elapsed());
    Some(loaded)
}

/// Compares a real mesh with what is known of it: triangles, and a box given to five digits.
pub(super) fn check_model(name: &str, reader: Reader, triangles: usize, min: [f64; 3], max: [f64; 3]) {
    for attributes in [true, false] {
        let Some(loaded) = read_model(name, reader, &ReadOptions { attributes }) else { return };
        let mesh = loaded.mesh;
        check_consistent(&mesh);
        assert_eq!(mesh.triangles.len(), triangles, "{name}: {:?}", loaded.warnings);
        let bounds = mesh.bounds().unwrap();
        let tolerance = 1e-4 * bounds.size().into_iter().fold(0.0, f64::max);
        for axis in 0..3 {
            let off = (bounds.min[axis] - min[axis]).abs().max((bounds.max[axis] - max[axis]).abs());
            assert!(off <= tolerance, "{name}: {bounds:?}");
        }
        println!("{name}: {:?}", loaded.warnings);
    }
}

/// Panics unless everything in a mesh that names something else is in range.
pub(super) fn check_consistent(mesh: &Mesh) {
    fn check<T: Copy>(attribute: &trixel::Attribute<T>, mesh: &Mesh) {
        match &attribute.corners {
            None => assert_eq!(attribute.values.len(), mesh.positions.len()),
            Some(corners) => {
                assert_eq!(corners.len(), mesh.triangles.len());
                let values = attribute.values.len();
                assert!(corners.iter().flatten().all(|&c| c == u32::MAX || (c as usize) < values));
            }
        }
    }
    mesh.check().unwrap();
    mesh.normals.iter().for_each(|a| check(a, mesh));
    mesh.uvs.iter().for_each(|a| check(a, mesh));
    mesh.colors.iter().for_each(|a| check(a, mesh));
    assert!(mesh.triangle_materials.is_empty() || mesh.triangle_materials.len() == mesh.triangles.len());
    let materials = mesh.materials.len();
    assert!(mesh.triangle_materials.iter().all(|&m| m == Mesh::NO_MATERIAL || (m as usize) < materials));
    for material in &mesh.materials {
        for texture in [material.base_color_texture, material.metallic_roughness_texture, material.emissive_texture]
            .into_iter()
            .flatten()
        {
            assert!((texture.texture as usize) < mesh.textures.len());
        }
    }
    assert!(mesh.textures.iter().all(|t| (t.image as usize) < mesh.images.len()));
}

/// Reads `bytes` cut off at every length, and in `rounds` damaged forms: each must give a consistent mesh or a problem.
pub(super) fn assault(bytes: &[u8], rounds: u64, reader: Reader, resources: &dyn Resources) {
    let attempt = |bytes: &[u8]| {
        for attributes in [true, false] {
            if let Ok(loaded) = reader(bytes, &ReadOptions { attributes }, resources) {
                check_consistent(&loaded.mesh);
            }
        }
    };
    for_each_damage(bytes, rounds, attempt);
}

/// Calls `each` with `bytes` cut off at every length, and in `rounds` damaged forms.
pub(super) fn for_each_damage(bytes: &[u8], rounds: u64, each: impl Fn(&[u8])) {
    for length in 0..bytes.len() {
        each(&bytes[..length]);
    }
    let mut random = Random(1);
    for _ in 0..rounds {
        let mut damaged = bytes.to_vec();
        for _ in 0..=random.below(4) {
            damage(&mut damaged, &mut random);
        }
        each(&damaged);
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014): the same numbers everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next() % u64::try_from(n.max(1)).unwrap()).unwrap()
    }
}

fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    let end = (at + random.below(40)).min(bytes.len());
    match random.below(6) {
        0 => bytes[at] = random.next().to_le_bytes()[0],
        1 => bytes[at] ^= 1 << random.below(8),
        2 => drop(bytes.drain(at..end)),
        3 => {
            let piece = bytes[at..end].to_vec();
            bytes.splice(at..at, piece);
        }
        // A number becomes another, often a large or negative one.
        4 => {
            if let Some(offset) = bytes[at..].iter().position(u8::is_ascii_digit) {
                let digits = bytes[at + offset..].iter().take_while(|b| b.is_ascii_digit()).count();
                let value: &[u8] =
                    [&b"0"[..], b"1", b"7", b"65535", b"4294967295", b"99999999999999", b"-1", b"1e300", b"nan"]
                        [random.below(9)];
                bytes.splice(at + offset..at + offset + digits, value.iter().copied());
            }
        }
        _ => bytes[at] = b"\"<>{}[],:/#0 "[random.below(13)],
    }
}
