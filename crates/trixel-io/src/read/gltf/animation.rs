//! Animations: what moves which node when, and the values between their keys (glTF 2.0, section 3.11 and appendix C).

use super::accessor::Accessors;
use super::json::{Animation, Channel, Document};
use crate::read::Problem;
use crate::read::assemble::Budget;

/// An animation.
#[derive(Debug)]
pub(crate) struct Clip {
    pub(crate) name: String,
    /// The last key's time in seconds.
    pub(crate) seconds: f64,
    tracks: Vec<Track>,
}

/// A new value of a node.
#[derive(Debug, PartialEq)]
pub(super) enum Motion {
    Translation([f64; 3]),
    Rotation([f64; 4]),
    Scale([f64; 3]),
    Weights(Vec<f64>),
}

#[derive(Debug)]
struct Track {
    node: usize,
    path: Path,
    interpolation: Interpolation,
    /// Seconds, ascending.
    times: Vec<f64>,
    /// Keys one after another, each `width` values; for splines a tangent before and one after each.
    values: Vec<f64>,
    width: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

/// Reads all animations; channels of what trixel does not animate are skipped with a warning.
pub(super) fn read(
    document: &Document<'_>,
    accessors: &Accessors<'_>,
    budget: &mut Budget,
    warnings: &mut Vec<String>,
) -> Result<Vec<Clip>, Problem> {
    let mut clips = Vec::new();
    let mut skipped = 0_usize;
    for (i, animation) in document.animations.iter().enumerate() {
        let mut tracks = Vec::new();
        for (c, channel) in animation.channels.iter().enumerate() {
            let at = format!("animation {i}, channel {c}");
            match track(document, animation, channel, accessors, budget, &at)? {
                Some(track) => tracks.push(track),
                None => skipped += 1,
            }
        }
        let seconds = tracks.iter().filter_map(|track| track.times.last()).copied().fold(0.0, f64::max);
        clips.push(Clip { name: animation.name.clone().into_owned(), seconds, tracks });
    }
    if skipped > 0 {
        warnings.push(format!("{skipped} channels of animations skipped: they move no node's place or morph weights"));
    }
    Ok(clips)
}

fn track(
    document: &Document<'_>,
    animation: &Animation<'_>,
    channel: &Channel<'_>,
    accessors: &Accessors<'_>,
    budget: &mut Budget,
    at: &str,
) -> Result<Option<Track>, Problem> {
    let path = match &*channel.target.path {
        "translation" => Path::Translation,
        "rotation" => Path::Rotation,
        "scale" => Path::Scale,
        "weights" => Path::Weights,
        _ => return Ok(None),
    };
    let Some(node) = channel.target.node else { return Ok(None) };
    if node >= document.nodes.len() {
        return Err(Problem::new(at, format!("moves node {node}, which does not exist; the file is damaged")));
    }
    let Some(sampler) = animation.samplers.get(channel.sampler) else {
        return Err(Problem::new(at, format!("names sampler {}, which does not exist", channel.sampler)));
    };
    let interpolation = match &*sampler.interpolation {
        "" | "LINEAR" => Interpolation::Linear,
        "STEP" => Interpolation::Step,
        "CUBICSPLINE" => Interpolation::CubicSpline,
        other => return Err(Problem::new(at, format!("has the interpolation {other}, which glTF does not define"))),
    };
    let times: Vec<f64> = accessors.vectors::<1>(sampler.input, budget)?.into_iter().flatten().collect();
    if times.is_empty() || !times.is_sorted() || times.iter().any(|t| !t.is_finite()) {
        return Err(Problem::new(
            at,
            "its times are none, not finite or not in ascending order; export the file again",
        ));
    }
    let values: Vec<f64> = match path {
        Path::Translation | Path::Scale => {
            accessors.vectors::<3>(sampler.output, budget)?.into_iter().flatten().collect()
        }
        Path::Rotation => accessors.vectors::<4>(sampler.output, budget)?.into_iter().flatten().collect(),
        Path::Weights => accessors.vectors::<1>(sampler.output, budget)?.into_iter().flatten().collect(),
    };
    if let Some(place) = values.iter().position(|value| !value.is_finite()) {
        return Err(Problem::new(at, format!("value {place} of its keys is not finite; export the file again")));
    }
    let per_key = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let width = values.len() / per_key;
    let expected = match path {
        Path::Translation | Path::Scale => 3,
        Path::Rotation => 4,
        Path::Weights => width,
    };
    if width == 0 || width != expected || width * per_key != values.len() {
        return Err(Problem::new(
            at,
            format!("has {} values for {} keys; the file is damaged", values.len(), times.len()),
        ));
    }
    Ok(Some(Track { node, path, interpolation, times, values, width }))
}

impl Clip {
    /// The values at a time, which is held between the first key and the last.
    pub(super) fn at(&self, seconds: f64) -> impl Iterator<Item = (usize, Motion)> {
        self.tracks.iter().map(move |track| (track.node, track.at(seconds)))
    }
}

impl Track {
    fn at(&self, seconds: f64) -> Motion {
        let values = self.values_at(seconds);
        let three = || std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
        match self.path {
            Path::Translation => Motion::Translation(three()),
            Path::Scale => Motion::Scale(three()),
            Path::Rotation => Motion::Rotation(std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))),
            Path::Weights => Motion::Weights(values),
        }
    }

    /// The values at key `key`: 0 those before it, 1 its own, 2 those after it, of a spline; else its own.
    fn key(&self, key: usize, which: usize) -> &[f64] {
        let index = if self.interpolation == Interpolation::CubicSpline { 3 * key + which } else { key };
        self.values.get(index * self.width..(index + 1) * self.width).unwrap_or_default()
    }

    fn values_at(&self, seconds: f64) -> Vec<f64> {
        let after = self.times.partition_point(|&t| t <= seconds);
        if after == 0 || after == self.times.len() {
            return self.key(after.saturating_sub(1).min(self.times.len() - 1), 1).to_vec();
        }
        let before = after - 1;
        let length = self.times[after] - self.times[before];
        let t = (seconds - self.times[before]) / length;
        let (a, b) = (self.key(before, 1), self.key(after, 1));
        match self.interpolation {
            Interpolation::Step => a.to_vec(),
            Interpolation::Linear if self.path == Path::Rotation => slerp(a, b, t),
            Interpolation::Linear => a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect(),
            Interpolation::CubicSpline => {
                let (out, into) = (self.key(before, 2), self.key(after, 0));
                let (t2, t3) = (t * t, t * t * t);
                let mix = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                        + length * (t3 - 2.0 * t2 + t) * out[i]
                        + (3.0 * t2 - 2.0 * t3) * b[i]
                        + length * (t3 - t2) * into[i]
                };
                (0..self.width).map(mix).collect()
            }
        }
    }
}

/// The rotation a share `t` of the shorter way from `a` to `b`.
fn slerp(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    let cosine: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let (cosine, sign) = if cosine < 0.0 { (-cosine, -1.0) } else { (cosine, 1.0) };
    // Nearly the same: the angle's sine is too small to divide by.
    let (from, to) = if cosine > 0.9995 {
        (1.0 - t, t)
    } else {
        let angle = cosine.acos();
        (((1.0 - t) * angle).sin() / angle.sin(), (t * angle).sin() / angle.sin())
    };
    a.iter().zip(b).map(|(a, b)| from * a + sign * to * b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(path: Path, interpolation: Interpolation, times: &[f64], values: &[f64]) -> Track {
        let keys = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let width = values.len() / keys;
        Track { node: 0, path, interpolation, times: times.to_vec(), values: values.to_vec(), width }
    }

    #[test]
    fn values_between_keys_are_mixed_and_held_outside() {
        let line = track(Path::Weights, Interpolation::Linear, &[1.0, 3.0], &[0.0, 10.0, 4.0, 20.0]);
        for (t, expected) in
            [(0.0, [0.0, 10.0]), (1.0, [0.0, 10.0]), (1.5, [1.0, 12.5]), (3.0, [4.0, 20.0]), (9.0, [4.0, 20.0])]
        {
            assert_eq!(line.at(t), Motion::Weights(expected.to_vec()), "{t}");
        }
        let step = track(Path::Weights, Interpolation::Step, &[1.0, 3.0], &[5.0, 7.0]);
        assert_eq!([0.9, 2.999, 3.0].map(|t| step.at(t)), [5.0, 5.0, 7.0].map(|w| Motion::Weights(vec![w])));
    }

    #[test]
    fn rotations_go_the_shorter_way_at_even_speed() {
        let half = 0.5_f64.sqrt();
        // A quarter turn about z, written as the quaternion on the far side.
        let turn =
            track(Path::Rotation, Interpolation::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -half, -half]);
        let Motion::Rotation([_, _, z, w]) = turn.at(1.0 / 3.0) else { panic!("no rotation") };
        let angle = 30.0_f64.to_radians();
        assert!((z - (angle / 2.0).sin()).abs() < 1e-12 && (w - (angle / 2.0).cos()).abs() < 1e-12, "{z} {w}");
    }

    #[test]
    fn splines_keep_keys_and_slopes() {
        // A cubic is its own spline: t^3 from 0 to 2, with slopes 0 and 12.
        let spline = track(Path::Weights, Interpolation::CubicSpline, &[0.0, 2.0], &[9.0, 0.0, 0.0, 12.0, 8.0, 9.0]);
        for t in [0.0, 0.5, 1.0, 1.7, 2.0] {
            let Motion::Weights(values) = spline.at(t) else { panic!("no weights") };
            assert!((values[0] - t * t * t).abs() < 1e-12, "{t}: {values:?}");
        }
    }
}
