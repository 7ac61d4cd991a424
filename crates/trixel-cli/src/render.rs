//! `trixel render`: light through voxels, or traced for comparison.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, ensure};
use trixel::Mesh;
use trixel_gpu::{AdapterChoice, Gpu};
use trixel_io::atomic_file::{AtomicFile, Staged};
use trixel_render::Picture;
use trixel_render::light::{Background, LightRenderer, Medium, OpticalScene, Panorama, Placement, Reference, psnr};

use crate::mesh;
use crate::progress::Reporter;
use crate::render_args::{LightArgs, Optics, RenderArgs};
use crate::volume::cannot_write;

pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(args.quiet);
    let input = args.inputs.join(", ");
    check_png(&args.output)?;
    let options = args.light.options(background(&args.light)?);
    options.check()?;
    let compared = args.compare.as_deref().map(read_png).transpose()?;
    let (loaded, _) = reporter.stage(&format!("reading {input}"), || mesh::load_all(&args.inputs, true, &reporter));
    let loaded = loaded?;
    let up = args
        .light
        .up
        .axis()
        .unwrap_or_else(|| args.inputs.first().map_or(trixel::UpAxis::Y, |first| mesh::up(first, &loaded)));
    let media = media(&loaded, &args.light.materials)?;
    let bounds = loaded.bounds().with_context(|| format!("{input}: there is no triangle"))?;
    let placement = Placement::new(&bounds, up)?;
    let scene = OpticalScene::new(&loaded, &placement, &media)?;
    let effect = args.light.effect();
    let picture = if args.reference {
        let (radiance, ms) =
            reporter.stage("tracing", || Ok::<_, anyhow::Error>(Reference::new(&scene, &options)?.render(effect)));
        let radiance = radiance?;
        reporter.say(&format!("traced in {ms:.0} ms"));
        radiance.to_picture()
    } else {
        let gpu = open(&args.light, &reporter)?;
        let (lit, _) = reporter.stage("rendering", || LightRenderer::new(&gpu, effect, &options)?.render(&scene));
        let lit = lit?;
        reporter.say(&format!(
            "voxelized in {:.0} ms, filled in {:.0} ms, lit in {:.0} ms on {}",
            lit.voxelize_ms,
            lit.fill_ms,
            lit.light_ms,
            gpu.info()
        ));
        lit.radiance.to_picture()
    };
    stage_png(&args.output, &picture)?.commit()?;
    if let (Some(other), Some(path)) = (compared, &args.compare) {
        let decibels = psnr(&picture, &other).ok_or_else(|| {
            anyhow!("{} is {} x {} pixels; render at the same --size", path.display(), other.width, other.height)
        })?;
        reporter.say(&format!("PSNR against {}: {decibels:.2} dB", path.display()));
    }
    reporter.finish();
    Ok(ExitCode::SUCCESS)
}

/// Opens the GPU that the arguments ask for; a software one if there is no other.
pub(crate) fn open(args: &LightArgs, reporter: &Reporter) -> Result<Gpu> {
    let choice = args.adapter.clone().map_or(AdapterChoice::Any, AdapterChoice::Named);
    let (gpu, _) = reporter.stage("opening the GPU", || Gpu::open(&choice));
    Ok(gpu?)
}

/// What is far away.
pub(crate) fn background(args: &LightArgs) -> Result<Background> {
    Ok(match args.environment.as_str() {
        "sky" => Background::Sky,
        "white" => Background::Plain([1.0; 3]),
        "black" => Background::Plain([0.0; 3]),
        file => {
            let bytes = std::fs::read(file).map_err(|error| {
                anyhow!("--environment {file}: {error}; it takes sky, white, black, or an .hdr, .png or .jpg file")
            })?;
            Background::Panorama(Panorama::decode(&bytes).map_err(|error| anyhow!("--environment {file}: {error}"))?)
        }
    })
}

/// The media of a mesh, with what the arguments say about them.
pub(crate) fn media(mesh: &Mesh, said: &[Optics]) -> Result<Vec<Medium>> {
    let mut media = Medium::of_mesh(mesh);
    for Optics { name, index, absorption } in said {
        let mut found = false;
        for medium in media.iter_mut().filter(|medium| name.as_ref().is_none_or(|name| *name == medium.name)) {
            medium.refraction_index = *index;
            if let Some(absorption) = absorption {
                medium.absorption = *absorption;
            }
            found = true;
        }
        let names =
            || mesh.materials.iter().map(|material| format!("`{}`", material.name)).collect::<Vec<_>>().join(", ");
        ensure!(
            found,
            "--material {}: there is no such material; there are {}",
            name.as_deref().unwrap_or_default(),
            if mesh.materials.is_empty() { "none: leave the name out".to_owned() } else { names() }
        );
    }
    Ok(media)
}

fn check_png(path: &Path) -> Result<()> {
    ensure!(
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")),
        "{}: pictures are written as .png",
        path.display()
    );
    // Dropped at once, which removes it: what cannot be written is known before the work.
    AtomicFile::create(path).map(drop).map_err(|error| cannot_write(path, &error))
}

/// Writes a picture beside its target.
pub(crate) fn stage_png(path: &Path, picture: &Picture) -> Result<Staged> {
    let mut file = AtomicFile::create(path).map_err(|error| cannot_write(path, &error))?;
    picture.encode_png(&mut file).map_err(|error| cannot_write(path, &error))?;
    file.stage().map_err(|error| cannot_write(path, &error))
}

fn read_png(path: &Path) -> Result<Picture> {
    let bytes = std::fs::read(path).map_err(|error| anyhow!("--compare {}: {error}", path.display()))?;
    Picture::decode_png(&bytes).map_err(|error| anyhow!("--compare {}: {error}", path.display()))
}
