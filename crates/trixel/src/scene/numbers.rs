//! Sines, vectors and pseudo-random numbers that come out the same on every platform.
//!
//! The standard library's `sin` and `cos` are the platform's and differ in their last bits, hence the ones here.

/// A vector or point.
pub(super) type Vec3 = [f64; 3];

pub(super) fn add(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(super) fn scale(a: Vec3, s: f64) -> Vec3 {
    a.map(|c| c * s)
}

pub(super) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn normalize(a: Vec3) -> Vec3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

/// Two unit vectors that make a right-handed frame with the unit vector `axis` as the third.
pub(super) fn across(axis: Vec3) -> [Vec3; 2] {
    let other = if axis[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = normalize(cross(other, axis));
    [u, cross(axis, u)]
}

/// Sine and cosine of an angle in turns; exact at every quarter.
pub(super) fn sin_cos(turns: f64) -> (f64, f64) {
    // To within an eighth of a turn of the nearest quarter, without rounding, where short series are good to the last bit.
    let quarters = (turns * 4.0).round();
    let x = (turns - quarters / 4.0) * std::f64::consts::TAU;
    let xx = x * x;
    let series = |first: f64, start: f64| {
        let mut sum = 0.0;
        for i in (0..9).rev() {
            let k = start + 2.0 * f64::from(i);
            sum = first - xx / ((k + 1.0) * (k + 2.0)) * if i == 8 { first } else { sum };
        }
        sum
    };
    let (sin, cos) = (x * series(1.0, 1.0), series(1.0, 0.0));
    match quarters.rem_euclid(4.0) {
        0.0 => (sin, cos),
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The rotation by an angle in turns about a unit vector, as rows.
pub(super) fn rotation(axis: Vec3, turns: f64) -> [Vec3; 3] {
    let (sin, cos) = sin_cos(turns);
    let image = |v: Vec3| {
        let along = scale(axis, dot(axis, v) * (1.0 - cos));
        add(add(scale(v, cos), scale(cross(axis, v), sin)), along)
    };
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(image);
    std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row]))
}

/// A stream of pseudo-random numbers: SplitMix64 (G. Steele, D. Lea, C. Flood, OOPSLA 2014).
#[derive(Clone)]
pub(super) struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number in `0..below`.
    pub(super) fn below(&mut self, below: u32) -> u32 {
        (((self.next() >> 32) * u64::from(below)) >> 32) as u32
    }

    /// A number in `low..high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let unit = (self.next() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// A direction, evenly spread over the sphere.
    pub(super) fn direction(&mut self) -> Vec3 {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = sin_cos(self.between(0.0, 1.0));
        let r = (1.0 - z * z).sqrt();
        [r * cos, r * sin, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_agree_with_the_platform() {
        for i in -3000..3000 {
            let turns = f64::from(i) / 997.0;
            let (sin, cos) = sin_cos(turns);
            let (s, c) = (turns * std::f64::consts::TAU).sin_cos();
            assert!((sin - s).abs() < 4e-15 && (cos - c).abs() < 4e-15, "{turns}: {sin} {s} {cos} {c}");
        }
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75, 1.0].map(sin_cos),
            [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)]
        );
    }

    #[test]
    fn rotations_turn_counterclockwise_and_keep_lengths() {
        let quarter = rotation([0.0, 0.0, 1.0], 0.25);
        assert_eq!(quarter.map(|row| dot(row, [1.0, 0.0, 0.0])), [0.0, 1.0, 0.0]);
        let rows = rotation(normalize([1.0, 2.0, 3.0]), 0.123);
        for i in 0..3 {
            for j in 0..3 {
                assert!((dot(rows[i], rows[j]) - f64::from(u8::from(i == j))).abs() < 1e-15);
            }
        }
    }
}
