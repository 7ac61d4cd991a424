//! [`super::Fill::March`]: \[CL\] figure 3 along every column, and its low-pass filter.

use super::FillReport;
use super::columns::Columns;
use crate::volume::{Volume, WORD_BITS};

pub(super) fn correct(columns: &Columns<'_>, filled: &mut Volume) -> FillReport {
    let nz = filled.grid().dims()[2];
    let words = filled.column_words();
    let mut report = FillReport::default();
    for column in (0..columns.count()).filter(|column| columns.is_questionable(*column)) {
        report.questionable += 1;
        let good = columns.around(column).filter(|other| !columns.is_questionable(*other));
        let (mut sum, mut count) = (0, 0);
        let (mut firsts, mut entered) = (0, 0);
        for other in good {
            sum += columns.switched(other).map(|word| u64::from(word.count_ones())).sum::<u64>();
            count += 1;
            if let Some(first) = first_bit(columns.words(other)) {
                firsts += u64::from(first);
                entered += 1;
            }
        }
        if count == 0 {
            report.uncorrected += 1;
            continue;
        }
        let thickness = mean(sum, count);
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
