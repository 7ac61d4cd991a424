//! MTL, the material libraries of OBJ.

use std::collections::HashMap;

use trixel::{AlphaMode, Filter, Image, ImageSource, Material, Mesh, Texture, TextureRef, Wrap};

use super::text::{Scanner, shown};
use super::{Resources, warn_of};
use crate::numbers::narrow;

/// More materials than any real file has; a material is many times larger than its line in a file.
pub(super) const MOST_MATERIALS: usize = 65_536;

/// What libraries fill: the materials of a mesh, found by name.
#[derive(Default)]
pub(super) struct Materials {
    by_name: HashMap<Vec<u8>, u32>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    images: Vec<Image>,
    image_of_file: HashMap<Vec<u8>, Option<u32>>,
    missing_textures: Vec<String>,
}

/// What a `map_` line says besides the file.
struct MapOptions {
    offset: [f64; 2],
    scale: [f64; 2],
    clamp: bool,
}

impl Materials {
    /// The number of a material, if a library has it.
    pub(super) fn find(&self, name: &[u8]) -> Option<u32> {
        self.by_name.get(name).copied()
    }

    /// Adds a material of which only the name is known; without effect, if there are absurdly many.
    pub(super) fn add(&mut self, name: &[u8]) -> u32 {
        if self.materials.len() >= MOST_MATERIALS {
            return Mesh::NO_MATERIAL;
        }
        let index = u32::try_from(self.materials.len()).unwrap_or(Mesh::NO_MATERIAL);
        self.materials.push(Material { name: shown(name), ..Material::default() });
        // Of two materials with one name, the first counts.
        *self.by_name.entry(name.to_vec()).or_insert(index)
    }

    /// Puts the materials and what they use into a mesh.
    pub(super) fn finish(self, mesh: &mut Mesh, warnings: &mut Vec<String>) {
        warn_of(warnings, &self.missing_textures, "texture", "not there; materials stay without");
        (mesh.materials, mesh.textures, mesh.images) = (self.materials, self.textures, self.images);
    }

    /// Reads a library. Lines that it does not know are skipped: there are many dialects.
    pub(super) fn read(&mut self, bytes: &[u8], resources: &dyn Resources) {
        let mut scanner = Scanner::new(bytes);
        let mut current = None;
        let mut has_dissolve = false;
        while let Some(keyword) = scanner.word() {
            if keyword == b"newmtl" {
                current = (self.materials.len() < MOST_MATERIALS).then_some(self.materials.len());
                self.add(scanner.rest_of_line());
                has_dissolve = false;
            } else if let Some(index) = current {
                // Some exporters write `map_kd`.
                let keyword = keyword.to_ascii_lowercase();
                if keyword.starts_with(b"map_") {
                    self.map(&keyword, scanner.rest_of_line(), index, resources);
                } else if let Some(material) = self.materials.get_mut(index) {
                    set(material, &keyword, &mut scanner, &mut has_dissolve);
                }
            }
            scanner.rest_of_line();
        }
    }

    fn map(&mut self, keyword: &[u8], line: &[u8], material: usize, resources: &dyn Resources) {
        if !matches!(keyword, b"map_kd" | b"map_ke" | b"map_d") {
            return;
        }
        let (options, file) = split_options(line);
        let Some(image) = self.image(file, resources) else { return };
        let wrap = [if options.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let texture = Texture { image, wrap, filter: Filter::default(), mipmaps: true };
        let index = u32::try_from(self.textures.len()).unwrap_or(u32::MAX);
        self.textures.push(texture);
        // OBJ scales and moves with v up: v' = 1 - (scale (1 - v) + offset).
        let ([su, sv], [ou, ov]) = (options.scale, options.offset);
        let transform = [[su, 0.0, ou].map(narrow), [0.0, sv, 1.0 - sv - ov].map(narrow)];
        let texture = Some(TextureRef { texture: index, uv_set: 0, transform });
        let Some(material) = self.materials.get_mut(material) else { return };
        match keyword {
            b"map_kd" => material.base_color_texture = texture,
            b"map_ke" => material.emissive_texture = texture,
            _ => {
                material.opacity_texture = texture;
                material.alpha_mode = AlphaMode::Blend;
            }
        }
    }

    /// The image in a file beside the mesh; `None`, and a warning once a file, if it is not there.
    fn image(&mut self, file: &[u8], resources: &dyn Resources) -> Option<u32> {
        if let Some(&known) = self.image_of_file.get(file) {
            return known;
        }
        let name = String::from_utf8_lossy(file).into_owned();
        let found = resources.locate(&name).map(|path| {
            self.images.push(Image { name, source: ImageSource::File(path) });
            u32::try_from(self.images.len() - 1).unwrap_or(u32::MAX)
        });
        if found.is_none() {
            self.missing_textures.push(shown(file));
        }
        self.image_of_file.insert(file.to_vec(), found);
        found
    }
}

/// Sets the part of a material that a line is about; the keyword in lower case. `Kd` and `Ke` are linear, as the exporters of modelling programs
/// write them.
fn set(material: &mut Material, keyword: &[u8], scanner: &mut Scanner<'_>, has_dissolve: &mut bool) {
    let mut numbers = [f64::NAN; 3];
    let found = numbers.iter_mut().map_while(|n| scanner.float_on_line().map(|f| *n = f)).count();
    if found == 0 {
        return;
    }
    let unit = |number: f64| narrow(number.clamp(0.0, 1.0));
    // One number stands for all three.
    let color = if found == 3 { numbers } else { [numbers[0]; 3] };
    match keyword {
        b"kd" => material.base_color[..3].copy_from_slice(&color.map(unit)),
        b"ke" => material.emissive = color.map(|c| narrow(c.max(0.0))),
        b"d" => {
            *has_dissolve = true;
            set_opacity(material, unit(numbers[0]));
        }
        // Where a file has both, `Tr` is often written the wrong way round. So is a `Tr` of 1 alone: nobody means a
        // material that cannot be seen.
        b"tr" if !*has_dissolve && numbers[0] < 1.0 => set_opacity(material, unit(1.0 - numbers[0])),
        b"ni" => material.index_of_refraction = narrow(numbers[0]),
        b"pm" => material.metallic = unit(numbers[0]),
        b"pr" => material.roughness = unit(numbers[0]),
        _ => {}
    }
}

fn set_opacity(material: &mut Material, opacity: f32) {
    material.base_color[3] = opacity;
    if opacity < 1.0 {
        material.alpha_mode = AlphaMode::Blend;
    } else if material.opacity_texture.is_none() {
        material.alpha_mode = AlphaMode::Opaque;
    }
}

/// The options of a `map_` line, and the file's name behind them, which may hold spaces.
fn split_options(line: &[u8]) -> (MapOptions, &[u8]) {
    let mut options = MapOptions { offset: [0.0; 2], scale: [1.0; 2], clamp: false };
    let mut rest = line.trim_ascii();
    while rest.first() == Some(&b'-') {
        let mut scanner = Scanner::new(rest);
        let option = scanner.word().unwrap_or_default();
        // Up to three numbers; a file's name that starts with a number has an extension, so it is none.
        let mut triple = |values: &mut [f64; 2]| {
            for axis in 0..3 {
                let Some(number) = scanner.float_on_line() else { break };
                if let Some(value) = values.get_mut(axis) {
                    *value = number;
                }
            }
        };
        match option {
            b"-o" => triple(&mut options.offset),
            b"-s" => triple(&mut options.scale),
            b"-t" => triple(&mut [0.0; 2]),
            b"-mm" => {
                scanner.float_on_line();
                scanner.float_on_line();
            }
            b"-clamp" => options.clamp = scanner.word() == Some(b"on"),
            b"-blendu" | b"-blendv" | b"-cc" | b"-boost" | b"-texres" | b"-bm" | b"-imfchan" | b"-type" => {
                scanner.word();
            }
            // A name that starts with a hyphen.
            _ => break,
        }
        rest = scanner.rest().trim_ascii();
    }
    (options, rest)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    /// Has every file but those called `missing`.
    struct Everything;

    impl Resources for Everything {
        fn load(&self, _relative: &str) -> std::io::Result<Vec<u8>> {
            Ok(Vec::new())
        }

        fn locate(&self, relative: &str) -> Option<PathBuf> {
            (!relative.contains("missing")).then(|| PathBuf::from("folder").join(relative))
        }
    }

    fn read(text: &str) -> (Mesh, Vec<String>) {
        let (mut mesh, mut warnings) = (Mesh::default(), Vec::new());
        let mut materials = Materials::default();
        materials.read(text.as_bytes(), &Everything);
        materials.finish(&mut mesh, &mut warnings);
        (mesh, warnings)
    }

    #[test]
    fn colours_opacity_and_physical_parameters() {
        let (mesh, _) = read(
            "Kd 9 9 9\nnewmtl red glass\nKd 0.5 0.25 0\n  Ke 2 0 0\nd 0.25\nNi 1.33\nPm 1\nPr 0.125\nillum 2\n\
             newmtl grey\nKd 0.5\nTr 0.25\nnewmtl visible\nTr 1.0\n",
        );
        let red = &mesh.materials[0];
        assert_eq!((red.name.as_str(), red.base_color), ("red glass", [0.5, 0.25, 0.0, 0.25]));
        assert_eq!((red.emissive, red.alpha_mode), ([2.0, 0.0, 0.0], AlphaMode::Blend));
        assert_eq!((red.index_of_refraction, red.metallic, red.roughness), (1.33, 1.0, 0.125));
        assert_eq!(mesh.materials[1].base_color, [0.5, 0.5, 0.5, 0.75]);
        assert_eq!((mesh.materials[2].base_color[3], mesh.materials[2].alpha_mode), (1.0, AlphaMode::Opaque));
    }

    #[test]
    fn d_wins_over_tr() {
        let (mesh, _) = read("newmtl a\nd 0.25\nTr 0.25\nnewmtl b\nTr 0.25\nd 0.25\n");
        assert_eq!([mesh.materials[0].base_color[3], mesh.materials[1].base_color[3]], [0.25; 2]);
    }

    #[test]
    fn maps_with_options_and_spaces_in_names() {
        let (mesh, warnings) = read(
            "newmtl a\nmap_Kd -blendu on -s 2 3 1 -o 0.5 0.25 -clamp on my wood.png\nmap_Ke glow.png\n\
             newmtl b\nmap_Kd my wood.png\nmap_d 1 missing.png\nmap_Bump no.png\n",
        );
        let map = mesh.materials[0].base_color_texture.unwrap();
        assert_eq!(map.transform, [[2.0, 0.0, 0.5], [0.0, 3.0, 1.0 - 3.0 - 0.25]]);
        let texture = mesh.textures[map.texture as usize];
        assert_eq!(texture.wrap, [Wrap::Clamp; 2]);
        assert_eq!(mesh.images[texture.image as usize].source, ImageSource::File("folder/my wood.png".into()));
        assert_eq!(mesh.images.len(), 2, "a file named twice is one image");
        assert!(mesh.materials[0].emissive_texture.is_some());
        assert!(mesh.materials[1].opacity_texture.is_none());
        assert_eq!(warnings, ["the texture `1 missing.png` is not there; materials stay without"]);
    }

    #[test]
    fn keywords_in_any_case() {
        let (mesh, _) = read("newmtl a\nkd 0 1 0\nmap_kd a.png\nMAP_D b.png\n");
        let material = &mesh.materials[0];
        assert_eq!(material.base_color, [0.0, 1.0, 0.0, 1.0]);
        assert!(material.base_color_texture.is_some() && material.opacity_texture.is_some());
    }

    #[test]
    fn an_opacity_map_makes_a_material_blend() {
        let (mesh, _) = read("newmtl leaf\nmap_d leaf.png\nd 1\n");
        assert_eq!(mesh.materials[0].alpha_mode, AlphaMode::Blend);
    }

    #[test]
    fn any_bytes_are_survived() {
        for text in [
            "newmtl",
            "map_Kd x",
            "newmtl a\nmap_Kd",
            "newmtl a\nmap_Kd -s",
            "newmtl a\nKd",
            "\0\u{ff}",
            "newmtl a\nd nan",
        ] {
            read(text);
        }
    }
}
