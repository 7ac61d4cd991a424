//! Words of 64 voxels to bytes and back, and their transposition.

use trixel::WORD_BITS;

/// Bits of a word, as an index type.
pub(crate) const WORD: usize = WORD_BITS as usize;

/// Words that hold `bits` bits.
pub(crate) fn words_for(bits: u32) -> usize {
    bits.div_ceil(WORD_BITS) as usize
}

/// The bits of each byte value as eight bytes 0 or 1, lowest bit first.
const SPREAD: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut value = 0;
    while value < 256 {
        let mut bit = 0;
        while bit < 8 {
            if value >> bit & 1 == 1 {
                table[value][bit] = 1;
            }
            bit += 1;
        }
        value += 1;
    }
    table
};

/// Appends the first `bits` bits of `words` to `out`, one byte 0 or 1 each.
pub(crate) fn expand(words: &[u64], bits: u32, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + bits as usize, 0);
    for (bytes, &word) in out[start..].chunks_mut(WORD).zip(words) {
        // The bytes are zero already.
        if word == 0 {
            continue;
        }
        if word == u64::MAX {
            bytes.fill(1);
            continue;
        }
        for (eight, &value) in bytes.chunks_mut(8).zip(&word.to_le_bytes()) {
            let spread = &SPREAD[usize::from(value)];
            // A whole group is one store; only the last of a row may be shorter.
            if let Ok(eight) = <&mut [u8; 8]>::try_from(&mut *eight) {
                *eight = *spread;
            } else {
                eight.copy_from_slice(&spread[..eight.len()]);
            }
        }
    }
}

/// Packs bytes into bits, nonzero being 1: `words` is overwritten and holds bit i for byte i.
pub(crate) fn pack(bytes: &[u8], words: &mut [u64]) {
    for (group, word) in bytes.chunks(WORD).zip(words) {
        *word = 0;
        for (i, eight) in group.chunks(8).enumerate() {
            let mut padded = [0; 8];
            padded[..eight.len()].copy_from_slice(eight);
            *word |= u64::from(nonzero_mask(u64::from_le_bytes(padded))) << (8 * i);
        }
    }
}

/// Bit i of the result tells whether byte i is nonzero.
fn nonzero_mask(bytes: u64) -> u8 {
    const LOW7: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    // Adding 0x7f carries into bit 7 iff one of the lower seven bits is set; no carry leaves its byte.
    let ones = ((((bytes & LOW7) + LOW7) | bytes) & !LOW7) >> 7;
    // Byte i, now 0 or 1, is moved to bit 56 + i; no two of the products meet.
    (ones.wrapping_mul(0x0102_0408_1020_4080) >> 56).to_le_bytes()[0]
}

/// Transposes a 64 x 64 bit matrix: bit j of word i becomes bit i of word j. Swaps the off-diagonal blocks of ever
/// smaller squares.
pub(crate) fn transpose(matrix: &mut [u64; WORD]) {
    // Most of a typical grid is empty.
    if matrix.iter().all(|&row| row == 0) {
        return;
    }
    let mut width = WORD / 2;
    let mut mask = u64::from(u32::MAX);
    while width != 0 {
        let mut row = 0;
        while row < WORD {
            let swap = ((matrix[row] >> width) ^ matrix[row + width]) & mask;
            matrix[row] ^= swap << width;
            matrix[row + width] ^= swap;
            // The next row whose `width` bit is 0.
            row = (row + width + 1) & !width;
        }
        width /= 2;
        mask ^= mask << width;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64) -> impl FnMut() -> u64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state ^ (state >> 29)
        }
    }

    #[test]
    fn transposing_swaps_row_and_column() {
        let mut next = noise(1);
        let matrix: [u64; WORD] = std::array::from_fn(|_| next());
        let mut turned = matrix;
        transpose(&mut turned);
        for (i, row) in matrix.iter().enumerate() {
            for (j, column) in turned.iter().enumerate() {
                assert_eq!(row >> j & 1, column >> i & 1, "{i}, {j}");
            }
        }
    }

    #[test]
    fn bytes_and_bits_round_trip() {
        let mut next = noise(2);
        for bits in [1u32, 7, 8, 63, 64, 65, 128, 131, 200] {
            let mut words: Vec<u64> = (0..words_for(bits)).map(|_| next()).collect();
            if bits % 64 != 0 {
                *words.last_mut().unwrap() &= (1 << (bits % 64)) - 1;
            }
            let mut bytes = vec![9];
            expand(&words, bits, &mut bytes);
            assert_eq!(bytes.len(), bits as usize + 1);
            for (i, &byte) in bytes[1..].iter().enumerate() {
                assert_eq!(u64::from(byte), words[i / 64] >> (i % 64) & 1);
            }
            let mut packed = vec![u64::MAX; words.len()];
            pack(&bytes[1..], &mut packed);
            assert_eq!(packed, words);
        }
    }

    #[test]
    fn every_nonzero_byte_counts_as_set() {
        for value in 1..=255u8 {
            let mut words = [0];
            pack(&[0, value, 0, value], &mut words);
            assert_eq!(words[0], 0b1010, "{value}");
        }
    }
}
