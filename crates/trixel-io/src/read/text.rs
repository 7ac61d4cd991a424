//! Words and numbers of the text formats, scanned from bytes.
//!
//! Bytes, not `str`: names may be in any encoding, and checking megabytes of digits for UTF-8 buys nothing. Decimal
//! numbers become the nearest `f64` (`fast-float2` rounds correctly), several times faster than `str::parse`.

use memchr::memchr2;

use super::Problem;

/// A place in a text, moving forward.
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
    /// `#` starts a comment that ends with the line.
    comments: bool,
}

pub(super) fn is_line_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

/// Whether a word ends before this byte: at spaces and all control characters.
fn is_space(byte: u8) -> bool {
    byte <= b' '
}

impl<'a> Scanner<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, comments: false }
    }

    pub(super) fn with_comments(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, comments: true }
    }

    /// One for another text, with or without comments as this one.
    pub(super) fn like<'b>(&self, bytes: &'b [u8]) -> Scanner<'b> {
        Scanner { bytes, at: 0, comments: self.comments }
    }

    /// Where the scanner is, in bytes from the start.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Moves over `length` bytes.
    pub(super) fn skip(&mut self, length: usize) {
        self.at = self.bytes.len().min(self.at.saturating_add(length));
    }

    /// Moves to the next word, over line ends and comments; the word's first byte, or `None` at the end.
    pub(super) fn skip_space(&mut self) -> Option<u8> {
        while let Some(&byte) = self.bytes.get(self.at) {
            if self.comments && byte == b'#' {
                self.skip_line();
            } else if is_space(byte) {
                self.at += 1;
            } else {
                return Some(byte);
            }
        }
        None
    }

    /// As [`Self::skip_space`], but stays on the line: `None` when no word is left on it.
    pub(super) fn skip_space_on_line(&mut self) -> Option<u8> {
        while let Some(&byte) = self.bytes.get(self.at) {
            if is_line_end(byte) || (self.comments && byte == b'#') {
                return None;
            } else if is_space(byte) {
                self.at += 1;
            } else {
                return Some(byte);
            }
        }
        None
    }

    /// Moves behind the end of this line.
    pub(super) fn skip_line(&mut self) {
        self.at = match memchr2(b'\n', b'\r', self.rest()) {
            Some(length) => self.at + length + 1,
            None => self.bytes.len(),
        };
    }

    /// The rest of this line without spaces around it; moves to the line's end.
    pub(super) fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let length = memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        self.at += length;
        rest[..length].trim_ascii()
    }

    /// The next word, on this line or a later one.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_space()?;
        Some(self.take_word())
    }

    /// The next word on this line.
    pub(super) fn word_on_line(&mut self) -> Option<&'a [u8]> {
        self.skip_space_on_line()?;
        Some(self.take_word())
    }

    fn take_word(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let length = rest.iter().position(|&b| is_space(b)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// The next word as a number; `None`, without moving over the word, when there is none or it is not a number.
    pub(super) fn float(&mut self) -> Option<f64> {
        self.skip_space()?;
        self.take_float()
    }

    /// As [`Self::float`], but on this line only.
    pub(super) fn float_on_line(&mut self) -> Option<f64> {
        self.skip_space_on_line()?;
        self.take_float()
    }

    fn take_float(&mut self) -> Option<f64> {
        let rest = self.rest();
        let (value, length) = fast_float2::parse_partial::<f64, _>(rest).ok()?;
        if rest.get(length).is_some_and(|&b| !is_space(b)) {
            return None;
        }
        self.at += length;
        Some(value)
    }

    /// The next word as a whole number of at least 0; fails like [`Self::float`].
    pub(super) fn count(&mut self) -> Option<u64> {
        self.skip_space()?;
        let mut value: u64 = 0;
        let mut at = self.at;
        while let Some(digit) = self.bytes.get(at).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            value = value.checked_mul(10)?.checked_add(u64::from(digit))?;
            at += 1;
        }
        if at == self.at || self.bytes.get(at).is_some_and(|&b| !is_space(b)) {
            return None;
        }
        self.at = at;
        Some(value)
    }

    /// What stands here instead of `wanted`, for an error.
    pub(super) fn expected(&mut self, wanted: &str) -> String {
        match self.word() {
            Some(word) => format!("expected {wanted}, found `{}`", shown(word)),
            None => format!("expected {wanted}, but the file ends here; it is truncated"),
        }
    }

    /// A problem on the line where the scanner is.
    pub(super) fn problem(&self, what: impl Into<String>) -> Problem {
        Problem::new(line_at(self.bytes, self.at), what)
    }

    /// The problem that `wanted` is not what stands here.
    pub(super) fn unexpected(&mut self, wanted: &str) -> Problem {
        // The line of the word that is there, not of the spaces before it.
        self.skip_space();
        let at = line_at(self.bytes, self.at);
        Problem::new(at, self.expected(wanted))
    }
}

/// "line 12": the line that holds byte `offset`.
pub(super) fn line_at(bytes: &[u8], offset: usize) -> String {
    let before = bytes.get(..offset).unwrap_or(bytes);
    let count = |end: u8| memchr::memchr_iter(end, before).count();
    // Files from old Macs end lines with a carriage return alone.
    let ends = if memchr::memchr(b'\n', bytes).is_some() { count(b'\n') } else { count(b'\r') };
    format!("line {}", ends + 1)
}

/// A word or name from the file as text for a message or a name: replaced where not UTF-8, cut where absurdly long.
pub(crate) fn shown(word: &[u8]) -> String {
    const LONGEST: usize = 200;
    let mut text = String::from_utf8_lossy(&word[..word.len().min(LONGEST)]).into_owned();
    if word.len() > LONGEST {
        text.push_str("...");
    }
    text
}

/// The text behind a UTF-8 byte order mark, which some exporters write.
pub(super) fn without_byte_order_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_the_nearest_f64() {
        for text in
            ["0.1", "-2.7427900000000002e-11", "1e30", "+5", ".5", "5.", "1E-3", "123456789012345678901234567890"]
        {
            assert_eq!(Scanner::new(text.as_bytes()).float(), Some(text.parse().unwrap()), "{text}");
        }
        assert_eq!(Scanner::new(b"1e400").float(), Some(f64::INFINITY));
    }

    #[test]
    fn words_with_a_number_in_front_are_not_numbers() {
        for text in ["1.5x", "1/2", "1.#QNAN", "--1", "x", "", "1,5"] {
            assert_eq!(Scanner::new(text.as_bytes()).float(), None, "{text}");
        }
        for text in ["1.5", "-1", "99999999999999999999999", ""] {
            assert_eq!(Scanner::new(text.as_bytes()).count(), None, "{text}");
        }
    }

    #[test]
    fn lines_are_counted_for_every_line_end() {
        assert_eq!(line_at(b"a\nb\nc", 4), "line 3");
        assert_eq!(line_at(b"a\r\nb\r\nc", 6), "line 3");
        assert_eq!(line_at(b"a\rb\rc", 4), "line 3");
    }

    #[test]
    fn an_error_names_the_line_of_the_wrong_word() {
        let mut scanner = Scanner::new(b"1 2\n\n  oops");
        scanner.float();
        scanner.float();
        assert_eq!(scanner.unexpected("a number").to_string(), "line 3: expected a number, found `oops`");
    }
}
