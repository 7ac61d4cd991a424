//! Directions as integers of 15 bits.

/// The length of a unit vector.
pub(crate) const UNIT: i64 = 1 << 15;

/// The vector of length [`UNIT`] along `v`, rounded; `None` when `v` is 0. Decided on the 15 highest bits of `v`.
pub(crate) fn normalized(v: [i64; 3]) -> Option<[i64; 3]> {
    let largest = v.iter().map(|c| c.unsigned_abs()).max().unwrap_or(0);
    if largest == 0 {
        return None;
    }
    let bits = u64::BITS - largest.leading_zeros();
    let v = v.map(|c| if bits > 15 { c >> (bits - 15) } else { c << (15 - bits) });
    let squared: i64 = v.iter().map(|c| c * c).sum();
    let length = squared.isqrt();
    Some(v.map(|c| {
        let scaled = c.abs() * UNIT + length / 2;
        c.signum() * (scaled / length)
    }))
}

/// A direction of any length as integers; `None` when it has none.
pub(crate) fn quantized(v: [f64; 3]) -> Option<[i64; 3]> {
    // Scaled first, so that squares neither overflow nor vanish.
    let largest = v.iter().fold(0.0, |largest: f64, c| largest.max(c.abs()));
    if !largest.is_normal() {
        return None;
    }
    let v = v.map(|c| c / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length.is_nan() {
        return None;
    }
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "at most 2^15")]
    let quantized = v.map(|c| (c / length * UNIT as f64).round_ties_even() as i64);
    Some(quantized)
}

/// The floats of a quantized direction.
pub(crate) fn floats(v: [i64; 3]) -> [f32; 3] {
    #[expect(clippy::cast_precision_loss, reason = "at most 16 bits")]
    v.map(|c| c as f32 / UNIT as f32)
}

/// The quantized direction that [`floats`] made these of.
pub(crate) fn integers(v: [f32; 3]) -> [i64; 3] {
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "whole numbers of 16 bits")]
    v.map(|c| (c * UNIT as f32) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_exact_and_lengths_are_one() {
        for scale in [1, 7, 32_768, 1 << 40] {
            assert_eq!(normalized([0, -scale, 0]), Some([0, -UNIT, 0]));
        }
        assert_eq!(normalized([0; 3]), None);
        for v in [[3, -4, 12], [1, 1, 1], [-70_000, 1 << 33, 5], [i64::MIN / 2, 9, i64::MAX / 2]] {
            let n = floats(normalized(v).unwrap());
            let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
            assert!((length - 1.0).abs() < 2e-4, "{v:?} {n:?}");
            let exact = v.map(|c| c as f64);
            let exact_length = exact.iter().map(|c| c * c).sum::<f64>().sqrt();
            for i in 0..3 {
                assert!((f64::from(n[i]) - exact[i] / exact_length).abs() < 2e-4, "{v:?} {n:?}");
            }
        }
    }

    #[test]
    fn floats_hold_the_integers() {
        for c in -UNIT..=UNIT {
            assert_eq!(integers(floats([c, 0, -c])), [c, 0, -c]);
        }
    }

    #[test]
    fn floats_of_any_size_are_quantized() {
        assert_eq!(quantized([0.0, 0.0, 1e-300]), Some([0, 0, UNIT]));
        assert_eq!(quantized([-3e300, 0.0, 4e300]), Some([-19661, 0, 26214]));
        for bad in [[0.0; 3], [f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [f64::NAN, 1.0, 0.0]] {
            assert_eq!(quantized(bad), None);
        }
    }
}
