//! Renders a gallery of analytic volumes, to judge previews by eye and to time them.
//!
//! `cargo run --release -p trixel-render --example preview_gallery -- FOLDER [RESOLUTION] [SHAPE]`

#![expect(clippy::print_stdout, reason = "an example reports what it does")]

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Instant;

use trixel::{Grid, Volume};
use trixel_render::{PreviewOptions, render_preview};

/// Whether a point of the cube [-1, 1]^3 is inside the shape, for voxels of the given edge.
type Shape = fn([f64; 3], f64) -> bool;

const SHAPES: [(&str, Shape); 7] = [
    ("torus", |p, _| torus(p) < 0.0),
    ("torus-shell", |p, h| torus(p).abs() < h),
    ("sphere", |[x, y, z], _| x * x + y * y + z * z < 0.98),
    ("gyroid", |p, _| {
        let [x, y, z] = p.map(|c| c * 5.5);
        let wave = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
        wave.abs() < 0.35 && p.iter().map(|c| c * c).sum::<f64>() < 0.95
    }),
    ("city", |[x, y, z], _| {
        let cell = [x, y].map(|c| (c * 4.0).floor());
        let height = ((cell[0] * 12.9 + cell[1] * 78.2).sin() * 437.5).rem_euclid(1.0) * 1.4 - 0.9;
        let street = [x, y].iter().any(|c| (c * 4.0).rem_euclid(1.0) > 0.7);
        z < if street { -0.95 } else { height }
    }),
    ("sheet", |[x, y, z], h| (z - 0.3 * (3.0 * x).sin() * (3.0 * y).cos()).abs() < 1.5 * h),
    // Asymmetric on purpose: the letter F, its foot towards the front, with a ball on its left.
    ("letter", |[x, y, z], _| {
        let f = y.abs() < 0.15
            && ((-0.4..-0.1).contains(&x) || (-0.1..0.5).contains(&x) && (z > 0.65 || (0.0..0.3).contains(&z)));
        let ball = (x + 0.75).powi(2) + y * y + (z + 0.8).powi(2) < 0.03;
        (f && z.abs() < 0.95) || ball || (z < -0.8 && x.abs() < 0.3 && (-0.6..0.0).contains(&y))
    }),
];

fn torus([x, y, z]: [f64; 3]) -> f64 {
    let ring = (x * x + y * y).sqrt() - 0.68;
    (ring * ring + z * z).sqrt() - 0.28
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("usage: preview_gallery FOLDER [RESOLUTION] [SHAPE]")?);
    let resolution: u32 = arguments.next().map_or(Ok(64), |n| n.parse())?;
    let only = arguments.next();
    for (name, inside) in SHAPES.iter().filter(|(name, _)| only.as_deref().is_none_or(|only| only == *name)) {
        let edge = 2.0 / f64::from(resolution);
        let grid = Grid::new([-1.0; 3], [edge; 3], [resolution; 3])?;
        let mut volume = Volume::new(grid)?;
        for x in 0..resolution {
            for y in 0..resolution {
                for z in 0..resolution {
                    if inside(grid.center([x, y, z]), edge) {
                        volume.set([x, y, z]);
                    }
                }
            }
        }
        let start = Instant::now();
        let picture = render_preview(&volume, &PreviewOptions::default())?;
        println!("{name} at {resolution}: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        picture.encode_png(BufWriter::new(File::create(folder.join(format!("{name}-{resolution}.png")))?))?;
    }
    Ok(())
}
