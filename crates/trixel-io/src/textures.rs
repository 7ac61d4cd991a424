//! Decodes the images of a mesh: PNG and JPEG, from files beside it or from its own bytes.
//!
//! Readers leave images encoded, because occupancy does not need them. What cannot be decoded costs a warning; its
//! materials then show their own colours.

use std::io::{Cursor, Read};
use std::path::Path;

use image::{ImageReader, Limits};
use rayon::prelude::*;
use trixel::{Image, ImageSource, Mesh};

use crate::open::open;

/// The most pixels along a side of an image.
const MOST_SIDE: u32 = 16_384;
/// The most bytes that one image may take while it is decoded.
const MOST_BYTES: u64 = 2 << 30;
/// The most bytes of an image file.
const MOST_FILE_BYTES: u64 = 1 << 30;
/// The most pixels that all images of a mesh may have together: 2 GiB.
const MOST_PIXELS: u64 = 1 << 29;

/// Decodes every image that a material of `mesh` uses, in place, and gives a warning for each that cannot be had.
///
/// Images are at most 16,384 pixels along a side, and 2^29 pixels together; larger ones are left out with a warning.
///
/// ```
/// use trixel::{Image, ImageSource, Material, Mesh, Texture, TextureRef};
/// let mut mesh = Mesh::default();
/// mesh.images.push(Image { name: "wood.png".into(), source: ImageSource::File("no/wood.png".into()) });
/// mesh.textures.push(Texture { image: 0, wrap: Default::default(), filter: Default::default(), mipmaps: true });
/// mesh.materials.push(Material { base_color_texture: Some(TextureRef::new(0)), ..Material::default() });
/// let warnings = trixel_io::textures::decode_textures(&mut mesh);
/// assert!(warnings[0].contains("wood.png"));
/// ```
pub fn decode_textures(mesh: &mut Mesh) -> Vec<String> {
    let used = used_images(mesh);
    let sources: Vec<_> =
        mesh.images.par_iter().zip(&used).map(|(image, used)| if *used { size_of(image) } else { Ok(None) }).collect();
    // Counted in the file's order, so that which images are too many does not depend on threads.
    let mut room = MOST_PIXELS;
    let admitted: Vec<Result<bool, String>> = sources
        .into_iter()
        .map(|size| {
            let Some([width, height]) = size? else { return Ok(false) };
            room = room.checked_sub(u64::from(width) * u64::from(height)).ok_or_else(|| {
                format!(
                    "the images before it have nearly {MOST_PIXELS} pixels already, which is the most; use smaller ones"
                )
            })?;
            Ok(true)
        })
        .collect();
    let results: Vec<Result<(), String>> = mesh
        .images
        .par_iter_mut()
        .zip(admitted)
        .map(|(image, admitted)| if admitted? { decode(image) } else { Ok(()) })
        .collect();
    let names = mesh.images.iter().map(|image| &image.name);
    let failed = results.into_iter().zip(names).filter_map(|(result, name)| Some((result.err()?, name)));
    failed.map(|(why, name)| format!("the texture {name:?} is left out: {why}")).collect()
}

/// Which images a material uses.
fn used_images(mesh: &Mesh) -> Vec<bool> {
    let mut used = vec![false; mesh.images.len()];
    let textures = mesh.materials.iter().flat_map(|material| {
        [
            material.base_color_texture,
            material.metallic_roughness_texture,
            material.emissive_texture,
            material.opacity_texture,
        ]
    });
    for texture in textures.flatten() {
        let image = mesh.textures.get(texture.texture as usize).map(|texture| texture.image as usize);
        if let Some(used) = image.and_then(|image| used.get_mut(image)) {
            *used = true;
        }
    }
    used
}

/// The size of an image that is still encoded; `None` when it is decoded already.
fn size_of(image: &Image) -> Result<Option<[u32; 2]>, String> {
    let (width, height) = match &image.source {
        ImageSource::Rgba8 { .. } => return Ok(None),
        ImageSource::Encoded(bytes) => reader(Cursor::new(bytes.as_slice()))?.into_dimensions(),
        ImageSource::File(path) => {
            let (file, _) = open_image(path)?;
            reader(std::io::BufReader::new(file))?.into_dimensions()
        }
    }
    .map_err(|error| error.to_string())?;
    if width.max(height) > MOST_SIDE {
        return Err(format!("it has {width} x {height} pixels, and {MOST_SIDE} along a side is the most"));
    }
    Ok(Some([width, height]))
}

fn open_image(path: &Path) -> Result<(std::fs::File, u64), String> {
    let (file, length) = open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    if !file.metadata().is_ok_and(|metadata| metadata.is_file()) {
        return Err(format!("{} is not a regular file", path.display()));
    }
    Ok((file, length))
}

fn decode(image: &mut Image) -> Result<(), String> {
    let decoded = match &image.source {
        ImageSource::Rgba8 { .. } => return Ok(()),
        ImageSource::Encoded(bytes) => reader(Cursor::new(bytes.as_slice()))?.decode(),
        ImageSource::File(path) => {
            let (file, length) = open_image(path)?;
            if length > MOST_FILE_BYTES {
                return Err(format!("the file has {length} bytes, and {MOST_FILE_BYTES} are the most"));
            }
            let mut bytes = Vec::new();
            file.take(MOST_FILE_BYTES).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
            reader(Cursor::new(bytes))?.decode()
        }
    };
    let pixels = decoded.map_err(|error| error.to_string())?.into_rgba8();
    let (width, height) = pixels.dimensions();
    image.source = ImageSource::Rgba8 { width, height, pixels: pixels.into_raw() };
    Ok(())
}

/// A bounded reader of the format that the first bytes name.
fn reader<R: std::io::BufRead + std::io::Seek>(source: R) -> Result<ImageReader<R>, String> {
    let mut reader = ImageReader::new(source).with_guessed_format().map_err(|error| error.to_string())?;
    if reader.format().is_none() {
        return Err("it is neither PNG nor JPEG; convert it".to_owned());
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    Ok(reader)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trixel::{Material, Texture, TextureRef};

    fn mesh(images: Vec<ImageSource>) -> Mesh {
        let mut mesh = Mesh::default();
        for (i, source) in (0u32..).zip(images) {
            mesh.images.push(Image { name: format!("image {i}"), source });
            mesh.textures.push(Texture {
                image: i,
                wrap: Default::default(),
                filter: Default::default(),
                mipmaps: false,
            });
            mesh.materials.push(Material { base_color_texture: Some(TextureRef::new(i)), ..Material::default() });
        }
        mesh
    }

    /// A PNG file of 3 x 2 pixels, grey and opaque.
    fn png() -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels = image::GrayImage::from_fn(3, 2, |x, y| image::Luma([u8::try_from(10 * x + 100 * y).unwrap()]));
        pixels.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn files_and_bytes_are_decoded_to_rgba() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no extension");
        std::fs::write(&path, png()).unwrap();
        let mut mesh = mesh(vec![ImageSource::File(path), ImageSource::Encoded(png())]);
        assert_eq!(decode_textures(&mut mesh), [""; 0]);
        for image in &mesh.images {
            let ImageSource::Rgba8 { width: 3, height: 2, pixels } = &image.source else { panic!("{image:?}") };
            assert_eq!(pixels[16..20], [110, 110, 110, 255]);
        }
        assert!(decode_textures(&mut mesh).is_empty(), "decoded ones stay");
    }

    #[test]
    fn what_cannot_be_decoded_is_a_warning_that_says_why() {
        let mut cut = png();
        cut.truncate(cut.len() - 20);
        let mut huge = png();
        huge[16..20].copy_from_slice(&u32::MAX.to_be_bytes());
        let sources = vec![
            ImageSource::File("no/such.png".into()),
            ImageSource::Encoded(b"GIF89a and more".to_vec()),
            ImageSource::Encoded(cut),
            ImageSource::Encoded(huge),
            ImageSource::Encoded(Vec::new()),
        ];
        let mut mesh = mesh(sources.clone());
        let warnings = decode_textures(&mut mesh);
        assert_eq!(warnings.len(), 5, "{warnings:?}");
        assert!(warnings[0].contains("image 0") && warnings[0].contains("such.png"), "{}", warnings[0]);
        assert!(mesh.images.iter().map(|image| &image.source).eq(&sources), "they stay as they are");
    }

    #[test]
    fn images_that_nothing_uses_are_left_alone() {
        let mut mesh = mesh(vec![ImageSource::Encoded(png())]);
        mesh.materials.clear();
        assert!(decode_textures(&mut mesh).is_empty());
        assert!(matches!(mesh.images[0].source, ImageSource::Encoded(_)));
    }
}
