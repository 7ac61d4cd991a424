//! Materials, textures and images of a glTF document (glTF 2.0, sections 3.8 and 3.9, and the material extensions).

use std::collections::HashMap;

use trixel::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};

use super::buffer::{Buffers, data_uri, relative_path};
use super::json;
use crate::read::{Problem, Resources};

/// Everything that triangles refer to by material.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<Image>,
    pub(super) warnings: Vec<String>,
}

/// Reads all materials, in the order of the document, with the textures and images that they use. An image that cannot
/// be had costs a warning and the texture, never the mesh.
pub(super) fn read(
    document: &json::Document<'_>,
    buffers: &Buffers<'_>,
    bytes: usize,
    resources: &dyn Resources,
) -> Materials {
    // Views may overlap, so that many images could share few bytes; no honest file copies its images four times.
    let room = bytes.saturating_mul(4);
    let mut reader = Reader {
        document,
        buffers,
        resources,
        out: Materials::default(),
        textures: HashMap::new(),
        images: HashMap::new(),
        room,
    };
    let materials = document.materials.iter().map(|material| reader.material(material)).collect();
    Materials { materials, ..reader.out }
}

struct Reader<'a> {
    document: &'a json::Document<'a>,
    buffers: &'a Buffers<'a>,
    resources: &'a dyn Resources,
    out: Materials,
    /// Index in the output of each texture and image of the document that has been asked for; `None` if it failed.
    textures: HashMap<usize, Option<u32>>,
    images: HashMap<usize, Option<u32>>,
    room: usize,
}

impl Reader<'_> {
    fn material(&mut self, material: &json::Material<'_>) -> Material {
        let extensions = &material.extensions;
        let mut out =
            Material { name: material.name.to_string(), metallic: 1.0, roughness: 1.0, ..Material::default() };
        if let Some(pbr) = &material.pbr_metallic_roughness {
            out.base_color = pbr.base_color_factor.unwrap_or([1.0; 4]);
            out.base_color_texture = self.texture_ref(pbr.base_color_texture.as_ref());
            out.metallic = pbr.metallic_factor.unwrap_or(1.0);
            out.roughness = pbr.roughness_factor.unwrap_or(1.0);
            out.metallic_roughness_texture = self.texture_ref(pbr.metallic_roughness_texture.as_ref());
        } else if let Some(old) = &extensions.specular_glossiness {
            out.base_color = old.diffuse_factor.unwrap_or([1.0; 4]);
            out.base_color_texture = self.texture_ref(old.diffuse_texture.as_ref());
            out.metallic = 0.0;
            out.roughness = 1.0 - old.glossiness_factor.unwrap_or(1.0);
        }
        let strength = extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength).unwrap_or(1.0);
        out.emissive = material.emissive_factor.unwrap_or([0.0; 3]).map(|c| c * strength);
        out.emissive_texture = self.texture_ref(material.emissive_texture.as_ref());
        out.alpha_mode = match &*material.alpha_mode {
            "MASK" => AlphaMode::Mask { cutoff: material.alpha_cutoff.unwrap_or(0.5) },
            "BLEND" => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        };
        out.double_sided = material.double_sided;
        out.transmission = extensions.transmission.as_ref().and_then(|t| t.transmission_factor).unwrap_or(0.0);
        out.index_of_refraction = extensions.ior.as_ref().and_then(|i| i.ior).unwrap_or(1.5);
        out
    }

    fn texture_ref(&mut self, info: Option<&json::TextureInfo>) -> Option<TextureRef> {
        let info = info?;
        let texture = match self.textures.get(&info.index) {
            Some(&known) => known,
            None => {
                let texture = self.texture(info.index);
                self.textures.insert(info.index, texture);
                texture
            }
        }?;
        let mut out = TextureRef { uv_set: info.tex_coord, ..TextureRef::new(texture) };
        if let Some(transform) = &info.extensions.transform {
            out.uv_set = transform.tex_coord.unwrap_or(out.uv_set);
            out.transform = matrix(transform);
        }
        Some(out)
    }

    fn texture(&mut self, index: usize) -> Option<u32> {
        let Some(texture) = self.document.textures.get(index) else {
            self.out.warnings.push(format!("texture {index} does not exist, but a material names it"));
            return None;
        };
        let webp = texture.extensions.webp.as_ref().and_then(|webp| webp.source);
        let Some(source) = texture.source.or(webp) else {
            self.out.warnings.push(format!("texture {index} has no image that trixel reads"));
            return None;
        };
        let image = match self.images.get(&source) {
            Some(&known) => known,
            None => {
                let image = self.image(source).unwrap_or_else(|problem| {
                    self.out.warnings.push(format!("{}: {}", problem.at, problem.what));
                    None
                });
                self.images.insert(source, image);
                image
            }
        }?;
        let sampler = texture.sampler.and_then(|sampler| self.document.samplers.get(sampler));
        let wrap = |code: Option<u32>| match code {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let nearest = sampler.and_then(|s| s.mag_filter) == Some(9728);
        // Without a word on it the implementation chooses: averaging, unless all the rest is nearest.
        let mipmaps = match sampler.and_then(|s| s.min_filter) {
            Some(9728 | 9729) => false,
            Some(_) => true,
            None => !nearest,
        };
        self.out.textures.push(Texture {
            image,
            wrap: [wrap(sampler.and_then(|s| s.wrap_s)), wrap(sampler.and_then(|s| s.wrap_t))],
            filter: if nearest { Filter::Nearest } else { Filter::Linear },
            mipmaps,
        });
        u32::try_from(self.out.textures.len() - 1).ok()
    }

    fn image(&mut self, index: usize) -> Result<Option<u32>, Problem> {
        let at = format!("image {index}");
        let Some(image) = self.document.images.get(index) else {
            return Err(Problem::new(at, "does not exist, but a texture names it"));
        };
        let mut name = image.name.to_string();
        let source = if let Some(view) = image.buffer_view {
            let (bytes, _) = self.buffers.view(view, &at)?;
            ImageSource::Encoded(self.charge(bytes.len(), &at).map(|()| bytes.to_vec())?)
        } else if let Some(uri) = &image.uri {
            if let Some(bytes) = data_uri(&uri.0, &at)? {
                ImageSource::Encoded(bytes)
            } else {
                let path = relative_path(&uri.0, &at)?;
                let Some(file) = self.resources.locate(&path).or_else(|| self.resources.locate(&uri.0)) else {
                    return Err(Problem::new(at, format!("'{path}' is not beside the file; its texture is left out")));
                };
                if name.is_empty() {
                    name = path.into_owned();
                }
                ImageSource::File(file)
            }
        } else {
            return Err(Problem::new(at, "has neither a URI nor a bufferView"));
        };
        self.out.images.push(Image { name: if name.is_empty() { at } else { name }, source });
        Ok(u32::try_from(self.out.images.len() - 1).ok())
    }

    fn charge(&mut self, bytes: usize, at: &str) -> Result<(), Problem> {
        self.room = self.room.checked_sub(bytes).ok_or_else(|| {
            Problem::new(at, "shares its bytes with so many other images that it is left out; the file is damaged")
        })?;
        Ok(())
    }
}

/// `KHR_texture_transform`: scale, then turn, then shift. The turn is counter-clockwise as seen in the image, whose v
/// points down, so that `u` grows with `v`.
fn matrix(transform: &json::TextureTransform) -> [[f32; 3]; 2] {
    let (sin, cos) = transform.rotation.sin_cos();
    let [sx, sy] = transform.scale.unwrap_or([1.0; 2]);
    let [ox, oy] = transform.offset;
    [[cos * sx, sin * sy, ox], [-sin * sx, cos * sy, oy]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_transform_example_of_the_extension_takes_the_lower_left_quadrant() {
        let transform = json::TextureTransform {
            offset: [0.0, 1.0],
            rotation: std::f32::consts::FRAC_PI_2,
            scale: Some([0.5, 0.5]),
            tex_coord: None,
        };
        let m = matrix(&transform);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let [x, y] = m.map(|row| row[0] * u + row[1] * v + row[2]);
            assert!(
                (-1e-6..=0.500_001).contains(&x) && (0.499_999..=1.000_001).contains(&y),
                "({u}, {v}) -> ({x}, {y})"
            );
        }
    }
}
