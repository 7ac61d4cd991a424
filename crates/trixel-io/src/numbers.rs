//! Numbers as file formats hold them.

/// The nearest `f32`. Shading data needs no more; formats whose coordinates are `f32` check their range first.
#[expect(clippy::cast_possible_truncation, reason = "rounds to nearest, overflow becomes infinite")]
pub(crate) fn narrow(value: f64) -> f32 {
    value as f32
}

/// The numbers with spaces between them, each with the fewest digits that read as the same `f64`.
pub(crate) fn spaced(values: [f64; 3]) -> String {
    values.map(|value| format!("{value:?}")).join(" ")
}
