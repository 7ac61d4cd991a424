//! [`super::Fill::March`]: \[CL\] figure 3 along every column, and its low-pass filter.

use super::columns::Columns;
use super::{FillReport, Thickness};
use crate::volume::{Volume, WORD_BITS};

pub(super) fn correct(columns: &Columns<'_>, filled: &mut Volume) -> FillReport {
    let nz = filled.grid().dims()[2];
    let words = filled.column_words();
    let mut report = FillReport::default();
    for column in (0..columns.count()).filter(|column| columns.is_questionable(*column)) {
        report.questionable += 1;
        let Some(thickness) = mean_around(columns, column) else {
            report.uncorrected += 1;
            continue;
        };
        let (mut firsts, mut entered) = (0, 0);
        for other in good_around(columns, column) {
            if let Some(first) = first_bit(columns.words(other)) {
                firsts += u64::from(first);
                entered += 1;
            }
        }
        let first = if entered > 0 { mean(firsts, entered) } else { first_bit(columns.words(column)).unwrap_or(nz) };
        let end = first.saturating_add(thickness).min(nz);
        for (at, word) in
            (0..).step_by(WORD_BITS as usize).zip(filled.words_mut().iter_mut().skip(column * words).take(words))
        {
            *word = below(end.saturating_sub(at)) & !below(first.saturating_sub(at));
        }
    }
    report
}

/// \[CL\] figure 3 for every column.
pub(super) fn thicknesses(columns: &Columns<'_>) -> Vec<Thickness> {
    let of = |column| {
        let questionable = columns.is_questionable(column);
        let slices = if questionable { mean_around(columns, column) } else { None };
        Thickness { slices: slices.unwrap_or_else(|| inside(columns, column)), questionable }
    };
    (0..columns.count()).map(of).collect()
}

fn good_around(columns: &Columns<'_>, column: usize) -> impl Iterator<Item = usize> {
    columns.around(column).filter(|other| !columns.is_questionable(*other))
}

/// The slices of a column that are inside.
fn inside(columns: &Columns<'_>, column: usize) -> u32 {
    columns.switched(column).map(u64::count_ones).sum()
}

/// The mean thickness of the good columns around one, if there are any.
fn mean_around(columns: &Columns<'_>, column: usize) -> Option<u32> {
    let add = |(sum, count), other| (sum + u64::from(inside(columns, other)), count + 1);
    let (sum, count) = good_around(columns, column).fold((0, 0), add);
    (count > 0).then(|| mean(sum, count))
}

/// The mean, rounded.
fn mean(sum: u64, count: u64) -> u32 {
    u32::try_from((2 * sum + count) / (2 * count)).unwrap_or(u32::MAX)
}

/// The first set bit of a column, if it has one.
fn first_bit(words: &[u64]) -> Option<u32> {
    (0..)
        .step_by(WORD_BITS as usize)
        .zip(words)
        .find(|(_, word)| **word != 0)
        .map(|(at, word)| at + word.trailing_zeros())
}

/// The lowest so many bits.
fn below(bits: u32) -> u64 {
    u64::MAX.checked_shr(WORD_BITS - bits.min(WORD_BITS)).unwrap_or(0)
}
