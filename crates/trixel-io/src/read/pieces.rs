//! Text files cut at line ends, so that several threads can read them, each a piece of its own.
//!
//! Whoever starts a piece where the one before it has ended, between two records, reads what one thread would have read.
//! So a piece counts only if all those before it ended so; where one did not, one thread reads the whole, and tells what is
//! wrong.

use memchr::{memchr, memchr_iter};
use rayon::prelude::*;

use super::Problem;
use super::text::Scanner;

/// Bytes of a piece, about: enough to be worth a task, and few enough for many of them.
const PIECE: usize = if cfg!(test) { 48 } else { 1 << 20 };

/// The pieces of a text, each of which but the first starts at a line for which `may_start` holds.
pub(super) fn cut(bytes: &[u8], may_start: impl Fn(usize) -> bool) -> Vec<Piece<'_>> {
    let mut starts = vec![0];
    let mut at = PIECE;
    while rayon::current_num_threads() > 1
        && let Some(length) = bytes.get(at..).and_then(|rest| memchr(b'\n', rest))
    {
        at += length + 1;
        if at < bytes.len() && may_start(at) {
            starts.push(at);
            at += PIECE;
        }
    }
    let ends = starts.iter().skip(1).copied().chain([bytes.len()]);
    starts.iter().zip(ends).map(|(&start, end)| Piece { start, bytes: &bytes[start..end] }).collect()
}

/// Part of a text.
#[derive(Clone, Copy)]
pub(super) struct Piece<'a> {
    /// Where it starts in the whole.
    pub(super) start: usize,
    pub(super) bytes: &'a [u8],
}

/// Where rows are read from.
pub(super) trait Text<'a>: Sized + Sync {
    fn scanner(&mut self) -> &mut Scanner<'a>;

    /// The same for part of the text.
    fn of(&self, piece: &'a [u8]) -> Self;
}

impl<'a> Text<'a> for Scanner<'a> {
    fn scanner(&mut self) -> &mut Scanner<'a> {
        self
    }

    fn of(&self, piece: &'a [u8]) -> Self {
        self.like(piece)
    }
}

/// What is read from part of a text.
pub(super) trait Part: Default + Send {
    /// Adds what was read behind it.
    fn append(&mut self, more: Self);
}

/// Reads `count` rows into `all` with `row`, which is told the number of each and moves over at least one word.
pub(super) fn rows<'a, S: Text<'a>, T: Part>(
    source: &mut S,
    count: u64,
    all: &mut T,
    row: impl Fn(&mut S, &mut T, u64) -> Result<(), Problem> + Sync,
) -> Result<(), Problem> {
    match rows_at_once(source, count, &row) {
        Some(parts) => parts.into_iter().for_each(|(part, _)| all.append(part)),
        None => (0..count).try_for_each(|number| row(source, all, number))?,
    }
    Ok(())
}

/// The rows in several parts, with the number of rows in each; `None`, and the source stays where it is, if they are not
/// what one thread would read.
fn rows_at_once<'a, S: Text<'a>, T: Part>(
    source: &mut S,
    count: u64,
    row: &(impl Fn(&mut S, &mut T, u64) -> Result<(), Problem> + Sync),
) -> Option<Vec<(T, u64)>> {
    let rest = source.scanner().rest();
    if rest.len() <= PIECE || rayon::current_num_threads() == 1 {
        return None;
    }
    // As many lines as rows; the last may lack its end.
    let last = usize::try_from(count).ok()?.checked_sub(1)?;
    let end = memchr_iter(b'\n', rest).nth(last).map_or(rest.len(), |at| at + 1);
    let read = |piece: &Piece<'a>| {
        let mut source = source.of(piece.bytes);
        let (mut part, mut rows) = (T::default(), 0);
        while source.scanner().skip_space().is_some() {
            row(&mut source, &mut part, rows).ok()?;
            rows += 1;
        }
        Some((part, rows))
    };
    let parts: Vec<(T, u64)> = cut(&rest[..end], |_| true).par_iter().map(read).collect::<Option<_>>()?;
    if parts.iter().map(|part| part.1).sum::<u64>() != count {
        return None;
    }
    source.scanner().skip(end);
    Some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::testing::{Memory, Reader, for_each_damage};
    use crate::read::{ReadOptions, obj, off, ply, stl};

    #[derive(Default, Debug, PartialEq)]
    struct Numbers(Vec<f64>);

    impl Part for Numbers {
        fn append(&mut self, more: Self) {
            self.0.extend(more.0);
        }
    }

    /// A row of two numbers.
    fn row(scanner: &mut Scanner<'_>, numbers: &mut Numbers, _row: u64) -> Result<(), Problem> {
        for _ in 0..2 {
            let number = scanner.float().ok_or_else(|| scanner.unexpected("a number"))?;
            numbers.0.push(number);
        }
        Ok(())
    }

    /// The parts in which two threads read rows, if they do, and what is left behind them.
    fn parts(text: &str, count: u64) -> (Option<usize>, usize) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let mut scanner = Scanner::new(text.as_bytes());
        let parts =
            pool.install(|| rows_at_once(&mut scanner, count, &row).map(|parts: Vec<(Numbers, u64)>| parts.len()));
        (parts, scanner.rest().len())
    }

    #[test]
    fn rows_that_are_lines_are_read_in_pieces() {
        let text = "1 2\n".repeat(100);
        assert_eq!(parts(&text, 100), (Some(8), 0));
        assert_eq!(parts(&text, 60), (Some(5), 160));
        assert_eq!(parts(text.trim_end(), 100), (Some(8), 0));
    }

    #[test]
    fn others_are_not() {
        for (text, count) in [
            // One row on two lines, too few rows, one that is none, and a line between.
            (format!("{}1\n2\n{}", "1 2\n".repeat(30), "1 2\n".repeat(30)), 61),
            ("1 2\n".repeat(60), 61),
            (format!("{}1 x\n{}", "1 2\n".repeat(30), "1 2\n".repeat(30)), 61),
            (format!("{}\n{}", "1 2\n".repeat(30), "1 2\n".repeat(30)), 60),
        ] {
            assert_eq!(parts(&text, count), (None, text.len()), "{text}");
        }
    }

    #[test]
    fn both_ways_read_the_same() {
        let text = (0..100).map(|i| format!("{i} -{i}.5\n")).collect::<String>();
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [one, two] = [1, 2].map(|threads| {
            let (mut numbers, mut scanner) = (Numbers::default(), Scanner::new(text.as_bytes()));
            pool(threads).install(|| rows(&mut scanner, 90, &mut numbers, row)).unwrap();
            (numbers, scanner.rest().trim_ascii().to_vec())
        });
        assert_eq!(one, two);
        assert_eq!(one.0.0.len(), 180);
    }

    #[test]
    fn pieces_start_where_they_may() {
        let text = "line\n".repeat(100);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let pieces = pool.install(|| cut(text.as_bytes(), |at| at % 10 == 0));
        assert!(pieces.len() > 5);
        assert!(pieces.iter().all(|piece| piece.start % 10 == 0));
        assert_eq!(pieces.iter().map(|piece| piece.bytes.len()).sum::<usize>(), text.len());
    }

    /// Samples with all that readers carry from one line to another.
    fn samples() -> [(Reader, String); 4] {
        let obj = "mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nv 4 4 4 2\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1 2 3\n\
                   usemtl red\nf 1/1/1 2/2/1 3/3/1\n# a folder\\\nf -1 -2 -3 \\\n-4\nusemtl blue\nv 1 1 1\r\nvt .5 .5\n\
                   f -1/-1 -2/-2 -3//\nnonsense\nusemtl red\nf 1//1 2//1 5\nvn 1 0 0\nf 1//-1 2//-1 3//2 4\nf 1 2\ncurv 1\n\
                   v 0 0 9 .5 .5 .5 .5\nf 6 5 4 3 1\n";
        let ply = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 6\nproperty float x\nproperty float y\n\
                   property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
                   property uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nelement face 7\n\
                   property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
                   end_header\n0 0 0 0 0 1 255 0 0 0 0\n1 0 0 0 0 1 0 255 0 1 0\n0 1 0 0 0 1 0 0 255 0 1\n\
                   1 1 0 0 0 1 9 9 9 1 1\n2 1 0 0 0 1 9 9 9 1 1\n2 2 1 0 0 1 9 9 9 1 1\n3 0 1 2 0 0\n3 1 2 3 6 0 0 1 0 1 1 0\n\
                   4 0 1 3 2 8 0 0 1 0 1 1 0 1 0\n2 0 1 0 1\n3 3 4 5 0 0\n3 0 4 5 6 0 0 1 0 1 1 0\n5 0 1 4 5 2 0 -1\n";
        let off = "STCNOFF\n# vertices\n5 5 0\n0 0 0 0 0 1 1 0 0 1 0 0\n1 0 0 0 0 1 0 1 0 1 1 0\n0 1 0 0 0 1 0 0 1 1 0 1\n\
                   1 1 0 0 0 1 1 1 1 1 1 1\n2 2 0 0 0 1 .5 .5 .5 1 1 1\n3 0 1 2\n3 1 3 2 255 0 0\n4 0 1 3 2\n2 0 1\n3 2 3 4\n";
        let facet = |z: u32, corners: &[[u32; 2]]| {
            let vertices: String = corners.iter().map(|[x, y]| format!("  vertex {x} {y} {z}\n")).collect();
            format!("facet normal 0 0 1\n outer loop\n{vertices} endloop\nendfacet\n")
        };
        let triangle = [[0, 0], [1, 0], [0, 1]];
        let stl = format!(
            "solid facet\n{}{}nonsense\n{}endsolid facet\nSOLID b\n{}{}",
            facet(0, &triangle),
            facet(1, &[[0, 0], [4, 0], [1, 1], [0, 4]]),
            facet(2, &triangle[..2]),
            facet(3, &triangle),
            facet(4, &triangle),
        );
        let text = str::to_owned;
        [(obj::read, text(obj)), (ply::read, text(ply)), (off::read, text(off)), (stl::read, stl)]
    }

    #[test]
    fn several_threads_read_what_one_reads() {
        let [one, two] = [1, 2].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
        for (reader, text) in samples() {
            let resources = Memory::with("a.mtl", b"newmtl blue\nKd 0 0 1\n".to_vec());
            let loaded = reader(text.as_bytes(), &ReadOptions::default(), &resources).unwrap();
            assert!(loaded.mesh.triangles.len() > 3, "{text}");
            let compare = |bytes: &[u8]| {
                for attributes in [true, false] {
                    // As text, so that NaN equals itself.
                    let read = || format!("{:?}", reader(bytes, &ReadOptions { attributes }, &resources));
                    assert_eq!(one.install(read), two.install(read), "{}", String::from_utf8_lossy(bytes));
                }
            };
            compare(text.as_bytes());
            for_each_damage(text.as_bytes(), 2000, compare);
        }
    }
}
