//! The surface of the set voxels: faces between a set voxel and an unset one (or the grid's border), coplanar ones merged
//! into rectangles.
//!
//! Merging is greedy within each slice, row by row (M. Lysenko, "Meshing in a Minecraft Game", 2012). Rectangles cover
//! each exposed face exactly once, so area and enclosed volume are exact; but a corner of one may lie inside an edge of
//! another (a T-junction), so the mesh is closed as a set of points, not as a graph of shared edges.
//!
//! Faces are found 64 at a time from the volume's words. Memory is in proportion to the surface.

use rayon::prelude::*;
use trixel::attributes::Described;
use trixel::{Grid, Volume};

use super::colored::colored_rectangles;
use super::{Failure, WriteOptions};
use crate::bits::{WORD, transpose, words_for};

/// A rectangle of merged faces. Its normal points along `axis`; `u` and `v` are the two axes that follow it cyclically,
/// so that `(low, low), (high, low), (high, high), (low, high)` turns counter-clockwise seen from `+axis`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) axis: usize,
    /// Whether the normal points towards larger coordinates.
    pub(super) positive: bool,
    /// Place along `axis`, in voxels from the grid's origin.
    pub(super) plane: u32,
    pub(super) u: [u32; 2],
    pub(super) v: [u32; 2],
}

impl Rectangle {
    /// The corners in voxels from the grid's origin, counter-clockwise seen from outside.
    pub(super) fn corners(&self) -> [[u32; 3]; 4] {
        let [u0, u1] = self.u;
        let [v0, v1] = self.v;
        let corner = |u, v| {
            let mut corner = [0; 3];
            corner[self.axis] = self.plane;
            corner[(self.axis + 1) % 3] = u;
            corner[(self.axis + 2) % 3] = v;
            corner
        };
        if self.positive {
            [corner(u0, v0), corner(u1, v0), corner(u1, v1), corner(u0, v1)]
        } else {
            [corner(u0, v0), corner(u0, v1), corner(u1, v1), corner(u1, v0)]
        }
    }
}

/// The rectangles of all exposed faces, in an order that depends on the volume alone.
pub(super) fn rectangles(volume: &Volume, options: &WriteOptions<'_>) -> Vec<Rectangle> {
    let [nx, ny, _] = volume.grid().dims();
    let layers = volume.column_words();
    let steps = 3;
    let mut all = Vec::new();
    let slices: Vec<_> = (0..nx).into_par_iter().map(|x| x_faces(volume, x)).collect();
    all.extend(slices.into_iter().flatten());
    options.report(1, 2 * steps);
    let slices: Vec<_> = (0..ny).into_par_iter().map(|y| y_faces(volume, y)).collect();
    all.extend(slices.into_iter().flatten());
    options.report(2, 2 * steps);
    for word in 0..layers {
        for positive in [false, true] {
            z_faces(volume, word, positive, &mut all);
        }
    }
    options.report(3, 2 * steps);
    all
}

/// Faces along x of slice `x`: rows along y, bits along z.
fn x_faces(volume: &Volume, x: u32) -> Vec<Rectangle> {
    let [nx, ny, _] = volume.grid().dims();
    let mut found = Vec::new();
    for (positive, neighbor) in [(false, x.checked_sub(1)), (true, (x + 1 < nx).then_some(x + 1))] {
        let mut mask = Vec::with_capacity(ny as usize * volume.column_words());
        for y in 0..ny {
            exposed(volume.column(x, y), neighbor.map(|x| volume.column(x, y)), &mut mask);
        }
        let plane = x + u32::from(positive);
        merge(&mut mask, volume.column_words(), |u, v| found.push(Rectangle { axis: 0, positive, plane, u, v }));
    }
    found
}

/// Faces along y of slice `y`: rows along x, bits along z.
fn y_faces(volume: &Volume, y: u32) -> Vec<Rectangle> {
    let [nx, ny, _] = volume.grid().dims();
    let mut found = Vec::new();
    for (positive, neighbor) in [(false, y.checked_sub(1)), (true, (y + 1 < ny).then_some(y + 1))] {
        let mut mask = Vec::with_capacity(nx as usize * volume.column_words());
        for x in 0..nx {
            exposed(volume.column(x, y), neighbor.map(|y| volume.column(x, y)), &mut mask);
        }
        let plane = y + u32::from(positive);
        merge(&mut mask, volume.column_words(), |x, z| {
            found.push(Rectangle { axis: 1, positive, plane, u: z, v: x });
        });
    }
    found
}

/// Appends the bits of `column` that `neighbor` lacks.
fn exposed(column: &[u64], neighbor: Option<&[u64]>, mask: &mut Vec<u64>) {
    match neighbor {
        Some(neighbor) => mask.extend(column.iter().zip(neighbor).map(|(&set, &beside)| set & !beside)),
        None => mask.extend(column),
    }
}

/// Faces along z of the 64 layers of one word: rows along x, bits along y after transposing.
fn z_faces(volume: &Volume, word: usize, positive: bool, found: &mut Vec<Rectangle>) {
    let [nx, ny, nz] = volume.grid().dims();
    let row_words = words_for(ny);
    let first = word * WORD;
    let layers = (nz as usize - first).min(WORD);
    let row_length = layers * row_words;
    let mut slab = vec![0; nx as usize * row_length];
    slab.par_chunks_mut(row_length).zip(0..nx).for_each(|(rows, x)| {
        for (group, first_y) in (0..ny).step_by(WORD).enumerate() {
            let mut square = [0; WORD];
            for (y, row) in (first_y..ny).zip(&mut square) {
                let column = volume.column(x, y);
                let set = column[word];
                let beside = if positive {
                    let next = column.get(word + 1).map_or(0, |next| next << (WORD - 1));
                    set >> 1 | next
                } else {
                    let previous = word.checked_sub(1).map_or(0, |word| column[word] >> (WORD - 1));
                    set << 1 | previous
                };
                *row = set & !beside;
            }
            transpose(&mut square);
            for (z, row) in square.into_iter().enumerate().take(layers) {
                rows[z * row_words + group] = row;
            }
        }
    });
    let slices: Vec<Vec<Rectangle>> = (0..layers)
        .into_par_iter()
        .map(|z| {
            let mut mask = Vec::with_capacity(nx as usize * row_words);
            for rows in slab.chunks(row_length) {
                mask.extend(&rows[z * row_words..(z + 1) * row_words]);
            }
            // At most `Grid::MAX_DIM`.
            let plane = u32::try_from(first + z).unwrap_or(u32::MAX) + u32::from(positive);
            let mut found = Vec::new();
            merge(&mut mask, row_words, |u, v| found.push(Rectangle { axis: 2, positive, plane, u, v }));
            found
        })
        .collect();
    found.extend(slices.into_iter().flatten());
}

/// Covers the bits of `mask` by disjoint rectangles, given as a range of rows and a range of bits: each run of bits grows
/// over the following rows as far as they hold all of it. Clears the mask.
fn merge(mask: &mut [u64], row_words: usize, mut emit: impl FnMut([u32; 2], [u32; 2])) {
    let rows = mask.len() / row_words;
    // Rows and bits are at most `Grid::MAX_DIM`.
    let narrow = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    for row in 0..rows {
        let mut word = 0;
        while word < row_words {
            let bits = mask[row * row_words + word];
            if bits == 0 {
                word += 1;
                continue;
            }
            let first = word * WORD + bits.trailing_zeros() as usize;
            let end = run_end(&mask[row * row_words..(row + 1) * row_words], first);
            let mut last = row + 1;
            while last < rows && take_run(&mut mask[last * row_words..(last + 1) * row_words], first, end) {
                last += 1;
            }
            let taken = take_run(&mut mask[row * row_words..(row + 1) * row_words], first, end);
            debug_assert!(taken, "the run was just seen");
            emit([narrow(row), narrow(last)], [narrow(first), narrow(end)]);
        }
    }
}

/// The first unset bit after `first`.
fn run_end(row: &[u64], first: usize) -> usize {
    let mut word = first / WORD;
    let mut unset = !row[word] & (u64::MAX << (first % WORD));
    while unset == 0 {
        word += 1;
        match row.get(word) {
            Some(&bits) => unset = !bits,
            None => return word * WORD,
        }
    }
    word * WORD + unset.trailing_zeros() as usize
}

/// Clears the bits `first..end` of a row if all of them are set.
fn take_run(row: &mut [u64], first: usize, end: usize) -> bool {
    let (start, last) = (first / WORD, (end - 1) / WORD);
    let mask = |word: usize| {
        let from = if word == start { u64::MAX << (first % WORD) } else { u64::MAX };
        let to = if word == last { u64::MAX >> (WORD - 1 - (end - 1) % WORD) } else { u64::MAX };
        from & to
    };
    let words = &mut row[start..=last];
    if !(start..).zip(words.iter()).all(|(word, bits)| bits & mask(word) == mask(word)) {
        return false;
    }
    for (word, bits) in (start..).zip(words) {
        *bits &= !mask(word);
    }
    true
}

/// Where the sides of voxels are: `origin + i * voxel_size` for i from 0 to the dimension inclusive, of each axis.
pub(super) fn coordinates(grid: &Grid) -> [Vec<f64>; 3] {
    let (origin, size) = (grid.origin(), grid.voxel_size());
    std::array::from_fn(|axis| (0..=grid.dims()[axis]).map(|i| origin[axis] + f64::from(i) * size[axis]).collect())
}

/// Rectangles with shared corners.
pub(super) struct IndexedSurface {
    /// Corners in voxels from the grid's origin, sorted by x, y, z.
    pub(super) vertices: Vec<[u32; 3]>,
    /// Indices of the corners of each rectangle, counter-clockwise seen from outside.
    pub(super) quads: Vec<[u32; 4]>,
    /// The corners' colours, sRGB and alpha, where there are any; corners are then shared by one colour only.
    pub(super) colors: Option<Vec<[u8; 4]>>,
}

/// Bits of a corner's coordinate, which goes up to [`trixel::Grid::MAX_DIM`] inclusive.
const KEY_BITS: u32 = 17;

impl IndexedSurface {
    /// The exposed faces of `volume`.
    ///
    /// # Errors
    /// When there are more corners than 32 bits can number.
    pub(super) fn new(volume: &Volume, options: &WriteOptions<'_>) -> Result<Self, Failure> {
        let (rectangles, face_colors): (Vec<_>, Option<Vec<_>>) = match options.described.filter(Described::has_colors)
        {
            Some(described) => {
                let colored = colored_rectangles(volume, &described, options);
                let (rectangles, colors) = colored.into_iter().map(|face| (face.rectangle, face.color)).unzip();
                (rectangles, Some(colors))
            }
            None => (rectangles(volume, options), None),
        };
        let Ok(corner_count) = u32::try_from(rectangles.len() as u64 * 4) else {
            return Err(Failure::Limit(format!(
                "the surface has {} rectangles, more than this format can index; choose a lower resolution or .stl",
                rectangles.len()
            )));
        };
        let color_of = |face: usize| {
            face_colors.as_ref().and_then(|colors| colors.get(face)).map_or(0, |&color| u32::from_be_bytes(color))
        };
        // Sorting corners by place and then numbering them costs less than hashing and gives one order always.
        let mut corners: Vec<(u64, u32, u32)> = rectangles
            .iter()
            .flat_map(Rectangle::corners)
            .map(|[x, y, z]| u64::from(x) << (2 * KEY_BITS) | u64::from(y) << KEY_BITS | u64::from(z))
            .zip(0..corner_count)
            .map(|(key, slot)| (key, color_of(slot as usize / 4), slot))
            .collect();
        corners.par_sort_unstable();
        let mut quads = vec![[0; 4]; rectangles.len()];
        let mut vertices: Vec<[u32; 3]> = Vec::new();
        let mut colors = Vec::new();
        let mut previous = None;
        let mut index = 0;
        for (key, color, slot) in corners {
            if previous != Some((key, color)) {
                previous = Some((key, color));
                // Fewer than the corners, which fit.
                index = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
                vertices.push([2, 1, 0].map(|axis: u32| {
                    u32::try_from(key >> (axis * KEY_BITS) & ((1 << KEY_BITS) - 1)).unwrap_or(u32::MAX)
                }));
                colors.push(color.to_be_bytes());
            }
            quads[slot as usize / 4][slot as usize % 4] = index;
        }
        options.report(4, 6);
        Ok(Self { vertices, quads, colors: face_colors.map(|_| colors) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(dims: [u32; 3], set: impl Fn([u32; 3]) -> bool) -> usize {
        let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
        for x in 0..dims[0] {
            for y in 0..dims[1] {
                for z in 0..dims[2] {
                    if set([x, y, z]) {
                        volume.set([x, y, z]);
                    }
                }
            }
        }
        // Every exposed face, found one by one, and how often rectangles cover it.
        let mut expected = std::collections::BTreeSet::new();
        for voxel in volume.iter() {
            for axis in 0..3 {
                for positive in [false, true] {
                    let mut beside = voxel;
                    beside[axis] = if positive { voxel[axis] + 1 } else { voxel[axis].wrapping_sub(1) };
                    if !volume.get(beside) {
                        expected.insert((axis, positive, voxel));
                    }
                }
            }
        }
        let rectangles = rectangles(&volume, &WriteOptions::default());
        for rectangle in &rectangles {
            for u in rectangle.u[0]..rectangle.u[1] {
                for v in rectangle.v[0]..rectangle.v[1] {
                    let mut voxel = [0; 3];
                    voxel[rectangle.axis] = rectangle.plane - u32::from(rectangle.positive);
                    voxel[(rectangle.axis + 1) % 3] = u;
                    voxel[(rectangle.axis + 2) % 3] = v;
                    let face = (rectangle.axis, rectangle.positive, voxel);
                    assert!(expected.remove(&face), "{face:?} is not exposed, or covered twice");
                }
            }
        }
        assert!(expected.is_empty(), "not covered: {expected:?}");
        rectangles.len()
    }

    #[test]
    fn every_exposed_face_is_covered_once() {
        let noise = |[x, y, z]: [u32; 3]| {
            let mixed = x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791);
            (mixed >> 7).wrapping_mul(2_654_435_761) >> 31 == 0
        };
        check([7, 70, 131], noise);
        check([65, 3, 64], noise);
        check([3, 129, 5], |v| noise(v.map(|c| c / 3)));
        assert_eq!(check([1, 1, 1], |_| false), 0);
    }

    #[test]
    fn a_box_has_six_rectangles() {
        assert_eq!(check([1, 1, 1], |_| true), 6);
        assert_eq!(check([3, 65, 130], |_| true), 6);
        assert_eq!(check([5, 70, 131], |[x, y, z]| x > 0 && y > 2 && (3..130).contains(&z)), 6);
    }
}
