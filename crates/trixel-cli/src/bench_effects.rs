//! `trixel bench --table effects`: what a frame of each effect takes.

use std::io::Write;
use std::process::ExitCode;

use anyhow::{Context, Result};
use trixel_bench::text;
use trixel_gpu::{AdapterChoice, Gpu};
use trixel_render::light::{
    Effect, LightOptions, LightRenderer, Lit, Medium, OpticalScene, Placement, Surfaces, Thickness,
};

use crate::args::BenchArgs;
use crate::bench::inputs;
use crate::grid::usage;
use crate::mesh;
use crate::progress::Reporter;
use crate::report::median;
use crate::voxelize::set_threads;

const EFFECTS: [(&str, Effect); 4] = [
    ("transparent-shadow", Effect::TransparentShadow),
    ("refraction, 2 surfaces", Effect::Refraction(Surfaces::Two(Thickness::Refracted))),
    ("refraction, many", Effect::Refraction(Surfaces::Many)),
    ("transmittance, many", Effect::Transmittance(Surfaces::Many)),
];
/// The paper's pictures are about as large.
const SIZE: [u32; 2] = [512, 512];

pub(crate) fn run(args: &BenchArgs) -> Result<ExitCode> {
    if args.json.is_some() || args.html.is_some() || args.compare.is_some() {
        usage("--table effects is printed; leave --json, --html and --compare out");
    }
    set_threads(args.threads)?;
    let reporter = Reporter::new(false);
    let gpu = Gpu::open(&args.adapter.clone().map_or(AdapterChoice::Any, AdapterChoice::Named))?;
    let head = ["mesh", "triangles", "at", "effect", "voxelize", "fill", "light", "frame"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, input) in &inputs(args)? {
        let (loaded, _) = reporter.stage(&format!("reading {input}"), || mesh::load(input, true, &reporter));
        let loaded = loaded?;
        let bounds = loaded.bounds().with_context(|| format!("{input}: there is no triangle"))?;
        let placement = Placement::new(&bounds, mesh::up(input, &loaded))?;
        let scene = OpticalScene::new(&loaded, &placement, &Medium::of_mesh(&loaded))?;
        for &resolution in &args.resolutions {
            let options = LightOptions { size: SIZE, samples: 1, resolution, ..LightOptions::default() };
            for (effect_name, effect) in EFFECTS {
                let (frames, _) = reporter.stage(&format!("{name} at {resolution}, {effect_name}"), || {
                    let renderer = LightRenderer::new(&gpu, effect, &options)?;
                    // The first frame pays for what drivers compile late.
                    (0..=args.repeat.get()).map(|_| renderer.render(&scene)).collect::<Result<Vec<Lit>, _>>()
                });
                let frames = frames?;
                let timed = frames.get(1..).unwrap_or_default();
                let ms = |of: fn(&Lit) -> f64| {
                    let samples: Vec<f64> = timed.iter().map(of).collect();
                    format!("{:.1}", median(&samples))
                };
                rows.push(vec![
                    name.clone(),
                    loaded.triangles.len().to_string(),
                    resolution.to_string(),
                    effect_name.to_owned(),
                    ms(|lit| lit.voxelize_ms),
                    ms(|lit| lit.fill_ms),
                    ms(|lit| lit.light_ms),
                    ms(|lit| lit.voxelize_ms + lit.fill_ms + lit.light_ms),
                ]);
            }
        }
    }
    reporter.finish();
    let [width, height] = SIZE;
    let table = format!(
        "Milliseconds a frame of {width} x {height} pixels, one ray each, medians of {}; voxelized on the processor, lit on {}\n\n{}",
        args.repeat,
        gpu.info(),
        text::aligned(&rows)
    );
    match write!(std::io::stdout().lock(), "{table}") {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write to standard output")?,
    }
    Ok(ExitCode::SUCCESS)
}
