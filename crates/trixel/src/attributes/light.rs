//! Colours as integers: linear light in 16 bits, sRGB in 8.

use std::sync::OnceLock;

/// Full linear light, or an alpha of 1.
pub(crate) const FULL: u16 = u16::MAX;

/// `a * b` of fractions of [`FULL`], rounded.
#[inline]
pub(crate) fn multiply(a: u16, b: u16) -> u16 {
    let product = u32::from(a) * u32::from(b) + (1 << 15);
    // The exact rounded quotient by 65535, without a division.
    narrow((product + (product >> 16)) >> 16)
}

/// A number below 2^16; larger ones become the largest.
#[inline]
pub(crate) fn narrow(value: u32) -> u16 {
    u16::try_from(value).unwrap_or(FULL)
}

/// The fraction of [`FULL`] for a float from 0 to 1; `NaN` becomes 0.
pub(crate) fn quantize(value: f32) -> u16 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let quantized = (f64::from(value) * f64::from(FULL)).round_ties_even() as u16;
    quantized
}

struct Tables {
    linear: [u16; 256],
    srgb: Vec<u8>,
}

/// sRGB's curve (IEC 61966-2-1), tabulated both ways.
fn tables() -> &'static Tables {
    static TABLES: OnceLock<Tables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let linear = std::array::from_fn(|byte| {
            #[expect(clippy::cast_precision_loss, reason = "below 256")]
            let c = byte as f64 / 255.0;
            let value = if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65535")]
            let value = (value * f64::from(FULL)).round() as u16;
            value
        });
        let srgb = (0..=FULL).map(|value| {
            let v = f64::from(value) / f64::from(FULL);
            let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
            let byte = (encoded * 255.0).round() as u8;
            byte
        });
        Tables { linear, srgb: srgb.collect() }
    })
}

/// The linear light of an sRGB byte.
#[inline]
pub(crate) fn linear_of_srgb(byte: u8) -> u16 {
    tables().linear[usize::from(byte)]
}

/// The sRGB byte of linear light.
#[inline]
pub(crate) fn srgb_of_linear(value: u16) -> u8 {
    tables().srgb.get(usize::from(value)).copied().unwrap_or(u8::MAX)
}

/// A linear byte as a fraction of [`FULL`].
#[inline]
pub(crate) fn widen(byte: u8) -> u16 {
    u16::from(byte) * 257
}

/// The byte nearest to a fraction of [`FULL`].
#[inline]
pub(crate) fn byte(value: u16) -> u8 {
    u8::try_from((u32::from(value) * 255 + 32_767) / 65_535).unwrap_or(u8::MAX)
}

/// The 8-bit sRGB colour, with alpha, of a linear one.
pub(crate) fn encode([r, g, b, a]: [u16; 4]) -> [u8; 4] {
    [srgb_of_linear(r), srgb_of_linear(g), srgb_of_linear(b), byte(a)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_comes_back() {
        for value in 0..=u8::MAX {
            assert_eq!(srgb_of_linear(linear_of_srgb(value)), value);
            assert_eq!(byte(widen(value)), value);
        }
        assert_eq!([linear_of_srgb(0), linear_of_srgb(255)], [0, FULL]);
        // Half of the light is 188 in sRGB.
        assert_eq!(srgb_of_linear(FULL / 2), 188);
    }

    #[test]
    fn products_are_rounded_exactly() {
        for (a, b) in [(0, 5), (FULL, FULL), (FULL, 777), (32_768, 32_768), (1, 32_767), (1, 32_768), (12_345, 54_321)]
        {
            let exact = (f64::from(a) * f64::from(b) / f64::from(FULL)).round();
            assert_eq!(f64::from(multiply(a, b)), exact, "{a} {b}");
        }
        assert_eq!(
            [quantize(0.0), quantize(1.0), quantize(f32::NAN), quantize(-3.0), quantize(9.0)],
            [0, FULL, 0, 0, FULL]
        );
    }
}
