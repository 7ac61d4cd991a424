//! Vertex colours, collected as the file writes them and made linear at the end.

use trixel::Attribute;

use crate::numbers::narrow;

/// Vertex colours of a file, in sRGB, by vertex; the scale (0 to 1, or 0 to 255) is only known once all are read.
#[derive(Default)]
pub(super) struct VertexColors {
    values: Vec<[f32; 4]>,
}

/// How the numbers of a colour are meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// 0 to 1, unless any is above 1: then 0 to 255.
    Guess,
    /// 0 to this number.
    Of(f32),
}

impl VertexColors {
    /// Sets the colour of `vertex`; those skipped before it have none. A `NaN` component counts as absent.
    pub(super) fn set(&mut self, vertex: usize, rgba: [f64; 4]) {
        self.values.resize(vertex, [f32::NAN; 4]);
        self.values.push(rgba.map(narrow));
    }

    /// Adds those of the vertices behind the first `vertices`.
    pub(super) fn append(&mut self, vertices: usize, more: Self) {
        if !more.values.is_empty() {
            self.values.resize(vertices, [f32::NAN; 4]);
            self.values.extend(more.values);
        }
    }

    /// Linear colours for `vertices` vertices, white where the file gave none; `None` if it gave none at all.
    pub(super) fn finish(mut self, vertices: usize, scale: Scale) -> Option<Attribute<[f32; 4]>> {
        if self.values.is_empty() {
            return None;
        }
        self.values.resize(vertices, [f32::NAN; 4]);
        let full = match scale {
            Scale::Of(full) => full,
            Scale::Guess if self.values.iter().flatten().any(|&c| c > 1.0) => 255.0,
            Scale::Guess => 1.0,
        };
        // Bytes are by far the most common: convert those by table.
        let table: Vec<f32> = (0..=255u8).map(|byte| srgb_to_linear(f32::from(byte) / 255.0)).collect();
        let linear = |c: f32| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturates; looked up with get"
            )]
            let byte = c as usize;
            match table.get(byte) {
                #[expect(clippy::cast_precision_loss, reason = "compared, and at most 255 where it matters")]
                Some(&value) if full == 255.0 && byte as f32 == c => value,
                _ => srgb_to_linear((c / full).clamp(0.0, 1.0)),
            }
        };
        for color in &mut self.values {
            for c in color.iter_mut().take(3) {
                *c = if c.is_nan() { 1.0 } else { linear(*c) };
            }
            color[3] = if color[3].is_nan() { 1.0 } else { (color[3] / full).clamp(0.0, 1.0) };
        }
        Some(Attribute::per_vertex(self.values))
    }
}

/// The linear value of an sRGB component (IEC 61966-2-1), both 0 to 1.
fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The linear colour of an sRGB one, from 0 to 1; alpha is linear always.
pub(crate) fn linear([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(rgba: [f64; 4], scale: Scale) -> [f32; 4] {
        let mut colors = VertexColors::default();
        colors.set(0, rgba);
        colors.finish(1, scale).unwrap().values[0]
    }

    #[test]
    fn bytes_and_fractions_of_the_same_colour_agree() {
        let bytes = one([255.0, 51.0, 0.0, 255.0], Scale::Guess);
        let fractions = one([1.0, 0.2, 0.0, 1.0], Scale::Guess);
        for (a, b) in bytes.iter().zip(fractions) {
            assert!((a - b).abs() < 1e-6, "{bytes:?} {fractions:?}");
        }
        assert!((bytes[1] - 0.033_105).abs() < 1e-5, "0.2 in sRGB is 0.0331 in linear light");
    }

    #[test]
    fn srgb_ends_are_exact_and_alpha_stays() {
        assert_eq!(linear([0.0, 1.0, 0.0, 0.5]), [0.0, 1.0, 0.0, 0.5]);
        assert!((linear([0.5; 4])[2] - 0.214_041).abs() < 1e-6);
    }

    #[test]
    fn vertices_without_a_colour_are_white() {
        let mut colors = VertexColors::default();
        colors.set(2, [0.0, 0.0, 0.0, f64::NAN]);
        let values = colors.finish(4, Scale::Guess).unwrap().values;
        assert_eq!(values, [[1.0; 4], [1.0; 4], [0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
        assert!(VertexColors::default().finish(4, Scale::Guess).is_none());
    }

    #[test]
    fn dark_bytes_are_not_taken_for_fractions() {
        assert!(one([1.0, 1.0, 1.0, 255.0], Scale::Of(255.0))[0] < 0.001);
    }
}
