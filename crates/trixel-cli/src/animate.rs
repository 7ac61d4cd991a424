//! `trixel animate`: a film of light through a mesh that deforms, voxelized anew for every frame.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use serde::Serialize;
use trixel_io::animation::{AnimatedMesh, Animation, read_animated};
use trixel_io::atomic_file::{AtomicFile, Staged};
use trixel_io::read::{Loaded, ReadOptions};
use trixel_render::light::{LightRenderer, OpticalScene, Orbit, Placement};
use trixel_render::{Film, FilmFormat, Picture, PictureError};

use crate::mesh;
use crate::progress::Reporter;
use crate::render::{background, media, open, stage_png};
use crate::render_args::AnimateArgs;
use crate::report::{AdapterReport, median};
use crate::volume::cannot_write;

/// Seconds of a film of what has no animation.
const STILL_SECONDS: f64 = 4.0;

/// What `--report` writes.
#[derive(Serialize)]
struct AnimateReport {
    command: Vec<String>,
    version: &'static str,
    triangles: usize,
    vertices: usize,
    animation: Option<String>,
    seconds: f64,
    frames: u32,
    adapter: AdapterReport,
    median_ms: FrameTimes,
    frames_ms: Vec<FrameTimes>,
    warnings: Vec<String>,
}

/// Milliseconds of a frame.
#[derive(Clone, Copy, Default, Serialize)]
struct FrameTimes {
    /// Skins and morph targets, on the CPU.
    deform: f64,
    /// Making the mesh ready for light: its normals, and which of its materials are sheets.
    prepare: f64,
    voxelize: f64,
    fill: f64,
    light: f64,
    /// Compressing the picture.
    encode: f64,
}

pub(crate) fn run(args: &AnimateArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(args.quiet);
    let input = args.input.as_str();
    let output = Output::open(&args.output)?;
    let report =
        args.report.as_deref().map(|path| AtomicFile::create(path).map_err(|error| cannot_write(path, &error)));
    let report = report.transpose()?;
    let options = args.light.options(background(&args.light)?);
    options.check()?;
    let (model, _) = reporter.stage(&format!("reading {input}"), || read(input));
    let model = model?;
    model.warnings().iter().for_each(|warning| reporter.warn(format!("{input}: {warning}")));
    let animations = model.animations();
    let (number, animation) = choose(input, &animations, args.animation.as_deref())?;
    let seconds = args.seconds.or(animation.map(|a| a.seconds).filter(|s| *s > 0.0)).unwrap_or(STILL_SECONDS);
    let turn = args.turn.unwrap_or(if animation.is_some() { 0.0 } else { 360.0 });

    let media = media(model.mesh(), &args.light.materials)?;
    let up = args.light.up.axis().unwrap_or_else(|| mesh::up(input, model.mesh()));
    let bounds = model.bounds(number).with_context(|| format!("{input}: there is no triangle"))?;
    let placement = Placement::new(&bounds, up)?;
    let gpu = open(&args.light, &reporter)?;
    let mut renderer = LightRenderer::new(&gpu, args.light.effect(), &options)?;
    let mut posed = model.mesh().clone();
    let mut frames_ms = Vec::new();
    reporter.now("frames");
    let mut frame = |frame: u32, add: &mut dyn FnMut(&Picture) -> Result<()>| {
        let share = f64::from(frame) / f64::from(args.frames);
        let start = Instant::now();
        model.pose(number, share * animation.map_or(0.0, |a| a.seconds), &mut posed);
        let deform = lap(start);
        let start = Instant::now();
        let scene = OpticalScene::new(&posed, &placement, &media).with_context(|| format!("{input}, frame {frame}"))?;
        let prepare = lap(start);
        let azimuth = (options.orbit.azimuth + share * turn) % 360.0;
        renderer.set_orbit(Orbit { azimuth, ..options.orbit })?;
        let lit = renderer.render(&scene)?;
        let start = Instant::now();
        add(&lit.radiance.to_picture())?;
        let (voxelize, fill, light) = (lit.voxelize_ms, lit.fill_ms, lit.light_ms);
        frames_ms.push(FrameTimes { deform, prepare, voxelize, fill, light, encode: lap(start) });
        #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
        reporter.fraction((share + 1.0 / f64::from(args.frames)) as f32);
        Ok::<_, anyhow::Error>(())
    };
    let written = output.write(options.size, args.frames, seconds / f64::from(args.frames), |add| {
        (0..args.frames).try_for_each(|number| frame(number, add))
    });
    let (mut staged, _folder) = written?;

    let typical = medians(&frames_ms);
    let played = match animation {
        None => input.to_owned(),
        Some(Animation { name: "", seconds }) => format!("animation {number} ({seconds:.2} s)"),
        Some(Animation { name, seconds }) => format!("animation `{name}` ({seconds:.2} s)"),
    };
    reporter.say(&format!(
        "{} frames of {}; median of a frame: deformed in {:.1} ms, prepared in {:.1} ms, voxelized in {:.0} ms, filled in \
         {:.0} ms, lit in {:.0} ms, encoded in {:.0} ms on {}",
        args.frames,
        played,
        typical.deform,
        typical.prepare,
        typical.voxelize,
        typical.fill,
        typical.light,
        typical.encode,
        gpu.info()
    ));
    if let (Some(mut file), Some(path)) = (report, &args.report) {
        let report = AnimateReport {
            command: std::env::args().collect(),
            version: env!("CARGO_PKG_VERSION"),
            triangles: posed.triangles.len(),
            vertices: posed.positions.len(),
            animation: animation.map(|a| a.name.to_owned()),
            seconds,
            frames: args.frames,
            adapter: AdapterReport::from(gpu.info()),
            median_ms: typical,
            frames_ms,
            warnings: reporter.warnings(),
        };
        serde_json::to_writer_pretty(&mut file, &report).map_err(|error| cannot_write(path, &error))?;
        staged = staged.join(file.stage().map_err(|error| cannot_write(path, &error))?);
    }
    staged.commit()?;
    reporter.finish();
    Ok(ExitCode::SUCCESS)
}

fn lap(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

fn read(input: &str) -> Result<AnimatedMesh> {
    if let Some(spec) = input.strip_prefix("scene:") {
        let mesh = trixel::scene::build(spec)?;
        return Ok(AnimatedMesh::from(Loaded { mesh, warnings: Vec::new() }));
    }
    Ok(read_animated(Path::new(input), &ReadOptions::default())?)
}

/// The animation asked for, and its number.
fn choose<'a>(
    input: &str,
    animations: &[Animation<'a>],
    asked: Option<&str>,
) -> Result<(usize, Option<Animation<'a>>)> {
    let Some(asked) = asked else { return Ok((0, animations.first().copied())) };
    let named = animations.iter().position(|animation| animation.name == asked);
    let number = named.or_else(|| asked.parse().ok().filter(|number| *number < animations.len()));
    let Some(number) = number else {
        if animations.is_empty() {
            bail!("--animation {asked}: {input} has no animation; leave the option out, and the camera walks round it");
        }
        let list = animations.iter().enumerate().map(|(i, animation)| format!("{i} `{}`", animation.name));
        bail!("--animation {asked}: there is no such animation; there are {}", list.collect::<Vec<_>>().join(", "));
    };
    Ok((number, animations.get(number).copied()))
}

fn medians(frames: &[FrameTimes]) -> FrameTimes {
    let median = |of: fn(&FrameTimes) -> f64| median(&frames.iter().map(of).collect::<Vec<_>>());
    FrameTimes {
        deform: median(|f| f.deform),
        prepare: median(|f| f.prepare),
        voxelize: median(|f| f.voxelize),
        fill: median(|f| f.fill),
        light: median(|f| f.light),
        encode: median(|f| f.encode),
    }
}

/// Where pictures go.
enum Output {
    Film { path: PathBuf, format: FilmFormat, file: AtomicFile },
    Folder(Folder),
}

impl Output {
    /// Finds out what cannot be written before the work.
    fn open(path: &Path) -> Result<Self> {
        let last = path.as_os_str().as_encoded_bytes().last();
        if path.is_dir() || last.is_some_and(|&b| std::path::is_separator(char::from(b))) {
            return Folder::open(path).map(Self::Folder);
        }
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        let format = match extension.as_deref().and_then(std::ffi::OsStr::to_str) {
            Some("gif") => FilmFormat::Gif,
            Some("apng" | "png") => FilmFormat::Apng,
            _ => bail!("{}: films are written as .gif or .apng, or as FOLDER/ for one .png a frame", path.display()),
        };
        let file = AtomicFile::create(path).map_err(|error| cannot_write(path, &error))?;
        Ok(Self::Film { path: path.to_owned(), format, file })
    }

    /// Writes pictures, `pictures` calling back with each in turn. What comes back must be kept until the files have their
    /// names.
    fn write(
        self,
        size: [u32; 2],
        frames: u32,
        seconds_a_frame: f64,
        pictures: impl FnOnce(&mut dyn FnMut(&Picture) -> Result<()>) -> Result<()>,
    ) -> Result<(Staged, Option<Folder>)> {
        match self {
            Self::Film { path, format, mut file } => {
                let failed = |error: PictureError| cannot_write(&path, &error);
                let mut film = Film::new(format, size, frames, seconds_a_frame, &mut file).map_err(failed)?;
                pictures(&mut |picture| film.add(picture).map_err(failed))?;
                film.finish().map_err(failed)?;
                Ok((file.stage().map_err(|error| cannot_write(&path, &error))?, None))
            }
            Self::Folder(folder) => {
                let mut staged: Option<Staged> = None;
                let mut frame = 0;
                pictures(&mut |picture| {
                    let new = stage_png(&folder.path.join(format!("frame-{frame:04}.png")), picture)?;
                    frame += 1;
                    staged = Some(match staged.take() {
                        Some(before) => before.join(new),
                        None => new,
                    });
                    Ok(())
                })?;
                Ok((staged.context("there is no frame")?, Some(folder)))
            }
        }
    }
}

/// A folder of frames, which goes again when it was made for frames that did not come.
struct Folder {
    path: PathBuf,
    made: bool,
}

impl Folder {
    fn open(path: &Path) -> Result<Self> {
        let made = !path.is_dir();
        if made {
            std::fs::create_dir(path).map_err(|error| cannot_write(path, &error))?;
        }
        Ok(Self { path: path.to_owned(), made })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.made {
            // Fails where there is something in it: the frames, or what somebody else has put there.
            let _ = std::fs::remove_dir(&self.path);
        }
    }
}
