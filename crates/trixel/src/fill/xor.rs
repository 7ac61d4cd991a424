//! [`super::Fill::Xor`]'s hole repair: in each slice, what most of the good columns around have.

use super::columns::Columns;
use super::{FillReport, XOR_PASSES};
use crate::volume::Volume;

pub(super) fn correct(columns: &Columns<'_>, filled: &mut Volume) -> FillReport {
    let mut rest: Vec<usize> = (0..columns.count()).filter(|column| columns.is_questionable(*column)).collect();
    let questionable = rest.len() as u64;
    let mut good = vec![true; columns.count()];
    rest.iter().for_each(|column| good[*column] = false);
    for _ in 0..XOR_PASSES {
        let (near, far): (Vec<_>, Vec<_>) =
            rest.into_iter().partition(|column| columns.around(*column).any(|other| good[other]));
        rest = far;
        // All of a pass look at what was before it.
        for &column in &near {
            let voters: Vec<usize> = columns.around(column).filter(|other| good[*other]).collect();
            vote(columns, filled, column, &voters);
        }
        near.iter().for_each(|column| good[*column] = true);
    }
    FillReport { questionable, uncorrected: rest.len() as u64 }
}

/// Where as many neighbours say one as the other, the column's own switching decides.
fn vote(columns: &Columns<'_>, filled: &mut Volume, column: usize, voters: &[usize]) {
    let words = filled.column_words();
    for (i, own) in columns.switched(column).enumerate() {
        let (mut majority, mut tie) = (0, 0);
        let votes: Vec<u64> =
            voters.iter().filter_map(|voter| filled.words().get(voter * words + i).copied()).collect();
        for bit in 0..64 {
            let inside = votes.iter().filter(|word| *word >> bit & 1 == 1).count();
            majority |= u64::from(2 * inside > votes.len()) << bit;
            tie |= u64::from(2 * inside == votes.len()) << bit;
        }
        if let Some(word) = filled.words_mut().get_mut(column * words + i) {
            *word = majority | tie & own;
        }
    }
}
