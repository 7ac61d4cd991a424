//! The arguments of `trixel render`, and of `trixel animate`, which takes the same picture many times.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use trixel_render::light::{
    Background, Effect, Environment, Floor, LightOptions, Medium, Orbit, Sun, Surfaces, Thickness,
};

use crate::args::{FillArg, UpArg};

pub(crate) const RENDER_EXAMPLES: &str = "\
Examples:
  trixel render scene:torus --effect refraction -o torus.png
  trixel render bunny.ply --effect transmittance --material 1.3:6,2,6 -r 256 -o jade.png
  trixel render scene:glass-ball --effect transmittance --reference -o traced.png
  trixel render scene:tree --effect transparent-shadow --material leaf=1:25 -r 256 -o tree.png
  trixel render spot.obj --effect refraction --surfaces 2 --environment studio.hdr -o spot.png

Exit status: 0 done, 1 failed, 2 wrong usage.";

pub(crate) const ANIMATE_EXAMPLES: &str = "\
Examples:
  trixel animate CesiumMan.glb --effect refraction --frames 48 -o glass.gif
  trixel animate scene:knot --effect transmittance --material 1.3:6,2,6 --frames 60 -o knot.apng
  trixel animate horse.obj --turn 90 --frames 12 -o frames/

Exit status: 0 done, 1 failed, 2 wrong usage.";

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// A mesh file, or scene:NAME or scene:NAME:N; several make one scene, in which later ones lie inside earlier ones.
    #[arg(value_name = "INPUT", required = true)]
    pub(crate) inputs: Vec<String>,

    /// Write the picture here, as .png.
    #[arg(short, long, value_name = "OUT.png")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) light: LightArgs,

    /// Trace the triangles on the processor instead, with exact intersections, to compare with.
    #[arg(long)]
    pub(crate) reference: bool,

    /// Compare with this .png, and print how alike the two are as a peak signal-to-noise ratio.
    #[arg(long, value_name = "FILE.png")]
    pub(crate) compare: Option<PathBuf>,

    /// Say nothing but errors.
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
pub(crate) struct AnimateArgs {
    /// A glTF or GLB file with skins or morph targets, which is voxelized anew for every frame; or any mesh, or scene:NAME.
    #[arg(value_name = "INPUT")]
    pub(crate) input: String,

    /// Write the film here: .gif, .apng or .png (animated); or FOLDER/ for one .png a frame.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,

    /// How many pictures.
    #[arg(short = 'n', long, value_name = "N", default_value = "48", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) frames: u32,

    /// The animation to play, by its name or its number from 0; by default the first.
    #[arg(short, long, value_name = "NAME|NUMBER")]
    pub(crate) animation: Option<String>,

    /// How long the film is; by default as long as the animation, or 4 seconds.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) seconds: Option<f64>,

    /// Walk round the object by so much while the film runs; by default 360 where nothing else moves.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub(crate) turn: Option<f64>,

    #[command(flatten)]
    pub(crate) light: LightArgs,

    /// Write the times of every frame and their medians here, as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,

    /// Say nothing but errors.
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.02..=600.0).contains(seconds));
    seconds.ok_or_else(|| "a film takes 0.02 to 600 seconds".to_owned())
}

/// How a picture of light is taken.
#[derive(Debug, Args)]
pub(crate) struct LightArgs {
    /// What light does with the object.
    #[arg(short, long, value_enum, default_value_t, value_name = "NAME", help_heading = "Effect")]
    pub(crate) effect: EffectArg,

    /// Which surfaces bend a ray.
    #[arg(long, value_enum, default_value_t, value_name = "WHICH", help_heading = "Effect")]
    pub(crate) surfaces: SurfacesArg,

    /// With --surfaces 2, along which direction the object's thickness is measured.
    #[arg(long, value_enum, default_value_t, value_name = "WHICH", help_heading = "Effect")]
    pub(crate) thickness: ThicknessArg,

    // Brackets in a comment would be links.
    #[arg(short, long = "material", value_name = "OPTICS", help_heading = "Effect", value_parser = parse_optics,
        help = "What a material does to light: [NAME=]INDEX[:ABSORPTION] or [NAME=]INDEX:RED,GREEN,BLUE; without NAME all \
            of them",
        long_help = "What a material does to light: [NAME=]INDEX[:ABSORPTION] or [NAME=]INDEX:RED,GREEN,BLUE; without NAME \
            all of them.\n\nINDEX is the refraction index (glass 1.5, water 1.33, air 1). ABSORPTION is the natural logarithm \
            of the share of light that is lost over the object's longest side. By default what the file says: its index, \
            and of light through a third of the object its base colour is left. Where the insides of two materials overlap \
            the later one counts.")]
    pub(crate) materials: Vec<Optics>,

    /// Leave out what the outermost surface mirrors.
    #[arg(long, help_heading = "Effect")]
    pub(crate) no_fresnel: bool,

    /// Follow a ray through at most N surfaces.
    #[arg(long, value_name = "N", default_value = "12", help_heading = "Effect",
        value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) max_surfaces: u32,

    /// A second surface within two voxels whose normal is turned by less is the first one, hit again.
    #[arg(long, value_name = "DEGREES", default_value_t = LightOptions::default().double_hit_angle, help_heading = "Effect")]
    pub(crate) double_hit_angle: f64,

    /// Filter normals with their neighbours N times.
    #[arg(long, value_name = "N", default_value_t = LightOptions::default().normal_filter, help_heading = "Effect",
        value_parser = clap::value_parser!(u32).range(0..=4))]
    pub(crate) normal_filter: u32,

    /// How insides are found; by default by exact parity where a material's surface is closed, and by xor, which repairs
    /// holes, where it is not.
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Effect")]
    pub(crate) fill: Option<FillArg>,

    /// How thick open surfaces such as leaves are, in longest sides of the object; for shadows.
    #[arg(long, value_name = "T", default_value_t = LightOptions::default().sheet_thickness, help_heading = "Effect")]
    pub(crate) sheet_thickness: f64,

    /// Voxels along the object's longest side.
    #[arg(short, long, value_name = "N", default_value = "128", help_heading = "Picture",
        value_parser = clap::value_parser!(u32).range(8..=1024))]
    pub(crate) resolution: u32,

    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "800x600", value_parser = parse_size, help_heading = "Picture")]
    pub(crate) size: [u32; 2],

    /// Rays a pixel.
    #[arg(long, value_name = "N", default_value = "4", help_heading = "Picture",
        value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(crate) samples: u32,

    /// The axis of the mesh that points up; `auto` as for voxelize.
    #[arg(long, value_enum, default_value_t, value_name = "AXIS", help_heading = "Picture")]
    pub(crate) up: UpArg,

    /// Walk round the object, from its front towards its right side.
    #[arg(long, value_name = "DEGREES", default_value_t = Orbit::default().azimuth, allow_negative_numbers = true,
        help_heading = "Camera")]
    pub(crate) azimuth: f64,

    /// Height above the horizon.
    #[arg(long, value_name = "DEGREES", default_value_t = Orbit::default().elevation, allow_negative_numbers = true,
        help_heading = "Camera")]
    pub(crate) elevation: f64,

    /// Angle across the picture's shorter side.
    #[arg(long, value_name = "DEGREES", default_value_t = Orbit::default().field_of_view, help_heading = "Camera")]
    pub(crate) field_of_view: f64,

    /// Distance from the object's centre in its longest sides; by default all of it is seen.
    #[arg(long, value_name = "D", help_heading = "Camera")]
    pub(crate) distance: Option<f64>,

    /// What is far away: sky, white, black, or a picture of everything round (equirectangular .hdr, .png or .jpg).
    #[arg(long, value_name = "NAME|FILE", default_value = "sky", help_heading = "Surroundings")]
    pub(crate) environment: String,

    /// What the object stands on.
    #[arg(long, value_enum, default_value_t, value_name = "NAME", help_heading = "Surroundings")]
    pub(crate) floor: FloorArg,

    /// Where the sun stands, for shadows, as for --azimuth.
    #[arg(long, value_name = "DEGREES", default_value_t = Sun::default().azimuth, allow_negative_numbers = true,
        help_heading = "Surroundings")]
    pub(crate) sun_azimuth: f64,

    /// Height of the sun above the horizon.
    #[arg(long, value_name = "DEGREES", default_value_t = Sun::default().elevation, help_heading = "Surroundings")]
    pub(crate) sun_elevation: f64,

    /// Light from everywhere, beside the sun's, 0 to 1.
    #[arg(long, value_name = "SHARE", default_value_t = Sun::default().ambient, help_heading = "Surroundings")]
    pub(crate) ambient: f64,

    /// Compute on the adapter whose name or driver contains NAME; by default the first, real ones before software.
    #[arg(long, value_name = "NAME", help_heading = "GPU")]
    pub(crate) adapter: Option<String>,
}

impl LightArgs {
    pub(crate) fn effect(&self) -> Effect {
        let surfaces = match self.surfaces {
            SurfacesArg::None => Surfaces::None,
            SurfacesArg::Two => Surfaces::Two(match self.thickness {
                ThicknessArg::Refracted => Thickness::Refracted,
                ThicknessArg::Incident => Thickness::Incident,
            }),
            SurfacesArg::Many => Surfaces::Many,
        };
        match self.effect {
            EffectArg::Refraction => Effect::Refraction(surfaces),
            EffectArg::Transmittance => Effect::Transmittance(surfaces),
            EffectArg::TransparentShadow => Effect::TransparentShadow,
        }
    }

    pub(crate) fn options(&self, background: Background) -> LightOptions {
        let floor = match self.floor {
            FloorArg::None => Floor::None,
            FloorArg::Checker => Floor::Checker,
            FloorArg::Plain => Floor::Plain,
        };
        LightOptions {
            size: self.size,
            samples: self.samples,
            resolution: self.resolution,
            orbit: Orbit {
                azimuth: self.azimuth,
                elevation: self.elevation,
                field_of_view: self.field_of_view,
                distance: self.distance,
            },
            environment: Environment { background, floor },
            sun: Sun { azimuth: self.sun_azimuth, elevation: self.sun_elevation, ambient: self.ambient },
            fresnel: !self.no_fresnel,
            max_surfaces: self.max_surfaces,
            double_hit_angle: self.double_hit_angle,
            normal_filter: self.normal_filter,
            fill: self.fill.map(Into::into),
            sheet_thickness: self.sheet_thickness,
        }
    }
}

/// [`Effect`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum EffectArg {
    /// Surfaces bend light.
    Refraction,
    /// Surfaces bend light and materials absorb it.
    #[default]
    Transmittance,
    /// The object is opaque, and its shadow as dark as what the light went through.
    TransparentShadow,
}

/// [`Surfaces`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum SurfacesArg {
    /// None: rays stay straight.
    None,
    /// The one where a ray enters and the one where it leaves.
    #[value(name = "2")]
    Two,
    /// All, with total internal reflection.
    #[default]
    Many,
}

/// [`Thickness`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum ThicknessArg {
    /// Along the bent ray; exact for convex objects.
    #[default]
    Refracted,
    /// Along the ray as it came, as in figure 5 of Chang and Lai 2011.
    Incident,
}

/// [`Floor`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum FloorArg {
    /// Nothing.
    None,
    /// Tiles of two colours.
    #[default]
    Checker,
    /// One light colour.
    Plain,
}

/// What `--material` says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Optics {
    /// The material; all of them if there is none.
    pub(crate) name: Option<String>,
    pub(crate) index: f64,
    pub(crate) absorption: Option<[f64; 3]>,
}

fn parse_optics(text: &str) -> Result<Optics, String> {
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("`{text}` is not a number"));
    let (name, optics) = match text.rsplit_once('=') {
        Some((name, optics)) => (Some(name.to_owned()), optics),
        None => (None, text),
    };
    let (index, absorption) = match optics.split_once(':') {
        Some((index, absorption)) => (index, Some(absorption)),
        None => (optics, None),
    };
    let index = number(index)?;
    let [least, most] = Medium::INDICES;
    if !(least..=most).contains(&index) {
        return Err(format!("a refraction index takes {least} to {most}"));
    }
    let absorption = absorption
        .map(|text| {
            let numbers = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
            if !numbers.iter().all(|a| (0.0..=Medium::MAX_ABSORPTION).contains(a)) {
                return Err(format!("an absorption takes 0 to {}", Medium::MAX_ABSORPTION));
            }
            match *numbers {
                [a] => Ok([a; 3]),
                [r, g, b] => Ok([r, g, b]),
                _ => Err("an absorption is one number, or three for red, green and blue".to_owned()),
            }
        })
        .transpose()?;
    Ok(Optics { name, index, absorption })
}

pub(crate) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|sides: &[u32; 2]| sides.iter().all(|side| (1..=8192).contains(side)))
        .ok_or_else(|| "a size is WxH, such as 800x600, each 1 to 8192".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optics_are_parsed() {
        let optics =
            |name: Option<&str>, index, absorption| Optics { name: name.map(str::to_owned), index, absorption };
        assert_eq!(parse_optics("1.5").unwrap(), optics(None, 1.5, None));
        assert_eq!(parse_optics("leaf=1:25").unwrap(), optics(Some("leaf"), 1.0, Some([25.0; 3])));
        assert_eq!(parse_optics("a=b=1.3:6,2,0.5").unwrap(), optics(Some("a=b"), 1.3, Some([6.0, 2.0, 0.5])));
        for wrong in ["", "glass", "0", "nan", "1.5:", "1.5:1,2", "1.5:-1", "1.5:1,2,3,4"] {
            assert!(parse_optics(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_are_parsed() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        for wrong in ["640", "0x4", "4x9000", "axb", "4x4x4"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
