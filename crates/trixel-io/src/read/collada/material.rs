//! COLLADA effects of the common profile as materials (COLLADA 1.4.1, chapters 7 and 8).

use std::collections::HashMap;

use trixel::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};

use crate::numbers::narrow;
use crate::read::Resources;
use crate::read::color::linear;
use crate::xml::{Document, Element};

/// The materials that triangles have used so far.
pub(super) struct Materials<'d> {
    document: &'d Document<'d>,
    resources: &'d dyn Resources,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<Image>,
    pub(super) warnings: Vec<String>,
    known_materials: HashMap<usize, Option<u32>>,
    known_images: HashMap<usize, Option<u32>>,
}

/// A colour, a texture, or both as a material uses them.
#[derive(Default)]
struct Paint {
    color: Option<[f32; 4]>,
    texture: Option<u32>,
}

impl<'d> Materials<'d> {
    pub(super) fn new(document: &'d Document<'d>, resources: &'d dyn Resources) -> Self {
        Self {
            document,
            resources,
            materials: Vec::new(),
            textures: Vec::new(),
            images: Vec::new(),
            warnings: Vec::new(),
            known_materials: HashMap::new(),
            known_images: HashMap::new(),
        }
    }

    /// The index of a `<material>`; `None` when its effect cannot be found.
    pub(super) fn index(&mut self, material: Element<'d>) -> Option<u32> {
        if let Some(&known) = self.known_materials.get(&material.index()) {
            return known;
        }
        let effect = material.child("instance_effect").and_then(|instance| instance.target("url"));
        let index = match effect {
            Some(effect) => {
                let read = self.effect(material, effect);
                self.materials.push(read);
                u32::try_from(self.materials.len() - 1).ok()
            }
            None => {
                self.warnings.push(format!("{} has no effect in this file; it is left out", material.describe()));
                None
            }
        };
        self.known_materials.insert(material.index(), index);
        index
    }

    fn effect(&mut self, material: Element<'d>, effect: Element<'d>) -> Material {
        let name = material.attribute("name").or_else(|| material.attribute("id")).unwrap_or_default().into_owned();
        let mut out = Material { name, ..Material::default() };
        let Some(profile) = effect.child("profile_COMMON") else { return out };
        let Some(technique) = profile.child("technique") else { return out };
        out.double_sided = [effect, profile, technique].into_iter().any(says_double_sided);
        let shader =
            technique.children().find(|child| matches!(child.name(), "phong" | "blinn" | "lambert" | "constant"));
        let Some(shader) = shader else { return out };

        let diffuse = self.paint(effect, profile, shader.child("diffuse"));
        // A texture replaces the colour. Authoring tools write what the screen shows, which is sRGB.
        out.base_color_texture = diffuse.texture.map(TextureRef::new);
        if let (Some(color), None) = (diffuse.color, diffuse.texture) {
            out.base_color = linear(color);
        }
        let emission = self.paint(effect, profile, shader.child("emission"));
        out.emissive_texture = emission.texture.map(TextureRef::new);
        out.emissive = match (emission.texture, emission.color) {
            (Some(_), _) => [1.0; 3],
            (None, Some(color)) => {
                let [r, g, b, _] = linear(color);
                [r, g, b]
            }
            (None, None) => [0.0; 3],
        };
        if let Some(index) = float(shader.child("index_of_refraction"))
            && index >= 1.0
        {
            out.index_of_refraction = index;
        }
        let alpha = opacity(shader);
        out.base_color[3] = alpha;
        let see_through = shader.child("transparent").is_some_and(|t| t.child("texture").is_some());
        if alpha < 1.0 || see_through {
            out.alpha_mode = AlphaMode::Blend;
        }
        out
    }

    fn paint(&mut self, effect: Element<'d>, profile: Element<'d>, paint: Option<Element<'d>>) -> Paint {
        let Some(paint) = paint else { return Paint::default() };
        let texture = paint.child("texture").and_then(|texture| {
            let sampler = texture.attribute("texture")?;
            self.texture(effect, profile, &sampler)
        });
        Paint { color: paint.child("color").and_then(color), texture }
    }

    /// Follows a sampler to its surface to its image; some exporters name the image itself.
    fn texture(&mut self, effect: Element<'d>, profile: Element<'d>, sampler: &str) -> Option<u32> {
        let param = |sid: &str| {
            let params = profile.all("newparam").chain(effect.all("newparam"));
            params.into_iter().find(|param| param.attribute("sid").is_some_and(|found| found == sid.trim()))
        };
        let sampler2d = param(sampler).and_then(|param| param.child("sampler2D"));
        let image = match sampler2d {
            Some(sampler2d) => match sampler2d.child("instance_image") {
                Some(instance) => instance.target("url"),
                None => {
                    let surface = sampler2d.child("source").and_then(|source| param(source.text()));
                    let init = surface.and_then(|param| param.child("surface")?.child("init_from"));
                    init.and_then(|init| self.document.by_id(init.text()))
                }
            },
            None => self.document.by_id(sampler),
        };
        let Some(image) = image.filter(|image| image.name() == "image") else {
            self.warnings.push(format!("the texture '{sampler}' of {} has no image", effect.describe()));
            return None;
        };
        let image = match self.known_images.get(&image.index()) {
            Some(&known) => known,
            None => {
                let index = self.image(image);
                self.known_images.insert(image.index(), index);
                index
            }
        }?;
        let setting = |name: &str| sampler2d.and_then(|s| s.child(name)).map_or("", |s| s.text().trim());
        let wrap = |name: &str| match setting(name) {
            "MIRROR" => Wrap::Mirror,
            "CLAMP" | "BORDER" | "NONE" => Wrap::Clamp,
            _ => Wrap::Repeat,
        };
        let texture = Texture {
            image,
            wrap: [wrap("wrap_s"), wrap("wrap_t")],
            filter: if setting("magfilter") == "NEAREST" { Filter::Nearest } else { Filter::Linear },
            mipmaps: !matches!(setting("minfilter"), "NEAREST" | "LINEAR"),
        };
        let index = self.textures.iter().position(|known| *known == texture).unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        u32::try_from(index).ok()
    }

    fn image(&mut self, image: Element<'d>) -> Option<u32> {
        let init = image.child("init_from")?;
        let path = init.child("ref").unwrap_or(init).text().trim();
        let decoded = percent_encoding::percent_decode_str(path).decode_utf8_lossy();
        // Absolute paths are those of the machine that wrote the file: then the name alone may be beside it.
        let base = decoded.rsplit(['/', '\\']).next().unwrap_or_default();
        let found = [path, &decoded, base].into_iter().find_map(|path| self.resources.locate(path));
        let Some(file) = found else {
            self.warnings.push(format!("the image '{decoded}' is not beside the file; its texture is left out"));
            return None;
        };
        self.images.push(Image { name: decoded.into_owned(), source: ImageSource::File(file) });
        u32::try_from(self.images.len() - 1).ok()
    }
}

/// Opacity after `<transparent>` and `<transparency>`. A surface that comes out wholly invisible is taken as opaque: many
/// exporters write the opposite of what they mean, and nobody draws what cannot be seen.
fn opacity(shader: Element<'_>) -> f32 {
    let transparency = float(shader.child("transparency"));
    let Some(transparent) = shader.child("transparent") else {
        return transparency.filter(|t| *t > 0.0 && *t <= 1.0).unwrap_or(1.0);
    };
    let amount = transparency.unwrap_or(1.0);
    let [r, g, b, a] = transparent.child("color").and_then(color).unwrap_or([1.0; 4]);
    let luminance = 0.212_671 * r + 0.715_16 * g + 0.072_169 * b;
    let opacity = match transparent.attribute("opaque").as_deref() {
        Some("RGB_ZERO") => 1.0 - luminance * amount,
        Some("RGB_ONE") => luminance * amount,
        Some("A_ZERO") => 1.0 - a * amount,
        _ => a * amount,
    };
    if opacity > 0.0 { opacity.min(1.0) } else { 1.0 }
}

fn says_double_sided(element: Element<'_>) -> bool {
    element.all("extra").any(|extra| {
        extra.all("technique").any(|technique| technique.child("double_sided").is_some_and(|d| d.text().trim() == "1"))
    })
}

/// The components of a `<color>`; it is a matter of looks, so one that is damaged is as good as none.
fn color(element: Element<'_>) -> Option<[f32; 4]> {
    match *element.numbers().ok()? {
        [r, g, b, a] => Some([r, g, b, a].map(narrow)),
        [r, g, b] => Some([r, g, b, 1.0].map(narrow)),
        _ => None,
    }
}

fn float(element: Option<Element<'_>>) -> Option<f32> {
    element?.child("float")?.numbers().ok()?.first().copied().map(narrow)
}
