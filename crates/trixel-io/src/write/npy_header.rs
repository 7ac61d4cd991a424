//! The header of NumPy's `.npy` format, version 1.0.

/// Length of the magic string, the version and the length field.
const PREFIX: usize = 10;

/// NumPy aligns the data, so that files can be memory-mapped.
const ALIGNMENT: usize = 64;

/// The header of a C-order array of `dtype` (as in NumPy's `descr`, for example `<f8`).
pub(super) fn npy_header(dtype: &str, shape: &[u64]) -> Vec<u8> {
    // A tuple of one needs its comma; NumPy writes it always.
    let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut dictionary = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}), }}", shape.trim_end());
    let end = (PREFIX + dictionary.len() + 1).next_multiple_of(ALIGNMENT);
    while PREFIX + dictionary.len() + 1 < end {
        dictionary.push(' ');
    }
    dictionary.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // At most a few numbers: far below 2^16.
    header.extend(u16::try_from(dictionary.len()).unwrap_or(u16::MAX).to_le_bytes());
    header.extend(dictionary.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::npy_header;

    #[test]
    fn header_is_aligned_and_complete() {
        for shape in [&[][..], &[3], &[7, 70, 131], &[1; 20]] {
            let header = npy_header("|b1", shape);
            assert_eq!(header.len() % 64, 0);
            assert_eq!(usize::from(u16::from_le_bytes([header[8], header[9]])) + 10, header.len());
        }
        assert!(String::from_utf8_lossy(&npy_header("<f8", &[3])).contains("'shape': (3,), }"));
    }
}
