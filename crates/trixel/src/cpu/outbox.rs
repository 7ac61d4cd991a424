//! Where threads leave voxels for each other: an outbox a thread, with a compartment for each slab.

use std::ops::Range;

use fearless_simd::{Simd, i32x16, i64x8, prelude::*};

use super::sink::{ColumnSink, CubeSink, Place, Sink, Slab};
use super::triangles::{LANES, Lanes};
use crate::volume::WORD_BITS;

/// Where slabs begin and end along x.
pub(super) struct Cuts {
    /// The first x of each slab, and the grid's end.
    at: Vec<u32>,
    /// The slab of each x.
    of_x: Vec<OfX>,
    columns: usize,
    column_words: usize,
    /// From y to a strip, by shifting.
    strip_shift: u32,
}

/// The slab of a layer across x.
#[derive(Clone, Copy)]
struct OfX {
    slab: u32,
    /// Layers from this one to the slab's end.
    left: u32,
}

/// Parts along y by which the triangles of a slab are sorted.
pub(super) const STRIPS: usize = 8;

impl Cuts {
    /// Slabs that begin at each but the last of `at`, which is the grid's end, for columns along y and words of a column.
    pub(super) fn new(at: Vec<u32>, columns: usize, column_words: usize) -> Self {
        let of_x = (0u32..).zip(at.windows(2)).flat_map(|(slab, range)| {
            let end = range[1];
            (range[0]..end).map(move |x| OfX { slab, left: end - x })
        });
        let of_x = of_x.collect();
        let strip_shift = (0..usize::BITS).find(|shift| columns.saturating_sub(1) >> shift < STRIPS).unwrap_or(0);
        Self { at, of_x, columns, column_words, strip_shift }
    }

    /// The number of slabs.
    pub(super) fn len(&self) -> usize {
        self.at.len() - 1
    }

    /// The x of a slab.
    pub(super) fn x(&self, slab: usize) -> Range<u32> {
        self.at[slab]..self.at[slab + 1]
    }

    /// Cuts the volume's words into slabs.
    pub(super) fn slabs<'a>(&self, mut words: &'a mut [u64]) -> Vec<Slab<'a>> {
        let mut slabs = vec![];
        for slab in 0..self.len() {
            let x = self.x(slab);
            let (mine, rest) = words.split_at_mut(x.len() * self.layer());
            words = rest;
            let start = [i64::from(x.start), 0, 0];
            slabs.push(Slab { words: mine, start, columns: self.columns, column_words: self.column_words });
        }
        slabs
    }

    /// The words of a layer across x.
    #[inline(always)]
    fn layer(&self) -> usize {
        self.columns * self.column_words
    }

    /// The slab with x, if it is inside the grid.
    #[inline(always)]
    fn of(&self, x: i64) -> Option<usize> {
        self.of_x.get(usize::try_from(x).ok()?).map(|of_x| of_x.slab as usize)
    }

    /// What is added to words of the grid so that those of all cubes are at least 0: cubes begin at most two columns before a
    /// layer.
    #[inline(always)]
    fn bias(&self) -> usize {
        2 * self.column_words
    }
}

/// What waits for one slab.
#[derive(Debug, Default)]
pub(super) struct Compartment {
    /// Cubes of 2^3 voxels, or toggles: a place and the bits.
    small: Vec<u64>,
    /// Cubes of 3^3: their bits, and a place.
    cubes: Vec<[u64; 2]>,
    /// The numbers of triangles to be voxelized inside the slab, by the strip in which their boxes begin.
    triangles: [Vec<u32>; STRIPS],
}

/// What one thread has found for all slabs: the voxels of tiny triangles, and the numbers of all others.
pub(super) struct Outbox<'a> {
    cuts: &'a Cuts,
    slabs: Vec<Compartment>,
}

/// Bits of a small cube.
const SMALL_BITS: u32 = 8;
/// Bits of a shift.
const SHIFT_BITS: u32 = WORD_BITS.trailing_zeros();

impl<'a> Outbox<'a> {
    /// Entries that it should hold at most, or little more: 8 to 16 MiB, and so few in tests that some leave more.
    const MOST_ENTRIES: usize = if cfg!(test) { 1 << 10 } else { 1 << 20 };

    /// An empty one, in the memory of `kept` compartments.
    pub(super) fn new(cuts: &'a Cuts, mut kept: Vec<Compartment>) -> Self {
        for Compartment { small, cubes, triangles } in &mut kept {
            small.clear();
            cubes.clear();
            triangles.iter_mut().for_each(Vec::clear);
        }
        kept.resize_with(cuts.len(), Compartment::default);
        Self { cuts, slabs: kept }
    }

    /// The compartments, to be used again.
    pub(super) fn into_compartments(self) -> Vec<Compartment> {
        self.slabs
    }

    /// The triangles left to a slab that begin in a strip.
    pub(super) fn triangles(&self, slab: usize, strip: usize) -> &[u32] {
        &self.slabs[slab].triangles[strip]
    }

    /// Sets the voxels left to a slab.
    pub(super) fn set(&self, slab: usize, into: &mut Slab<'_>) {
        // What is behind a reference to a slab would be loaded again after each word.
        let steps = Steps::of(into);
        let words = &mut *into.words;
        for &entry in &self.slabs[slab].small {
            let (word, shift) = self.unpack(slab, entry >> SMALL_BITS);
            paint_cube::<2>(words, steps, word, entry & ((1 << SMALL_BITS) - 1), shift);
        }
        for &[bits, place] in &self.slabs[slab].cubes {
            let (word, shift) = self.unpack(slab, place);
            paint_cube::<3>(words, steps, word, bits, shift);
        }
    }

    /// Toggles the voxels left to a slab.
    pub(super) fn toggle(&self, slab: usize, into: &mut Slab<'_>) {
        for &entry in &self.slabs[slab].small {
            let (word, shift) = self.unpack(slab, entry >> SMALL_BITS);
            if let Some(word) = usize::try_from(word).ok().and_then(|word| into.words.get_mut(word)) {
                *word ^= 1 << shift;
            }
        }
    }

    /// A word and a shift.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_wrap, reason = "not below 0 with the bias; below 2^40")]
    fn place(&self, word: isize, shift: u32) -> u64 {
        ((word + self.cuts.bias() as isize) as u64) << SHIFT_BITS | u64::from(shift)
    }

    /// The opposite of [`Self::place`], as a slab sees it.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "packed so")]
    fn unpack(&self, slab: usize, place: u64) -> (isize, u32) {
        let start = self.cuts.at[slab] as usize * self.cuts.layer() + self.cuts.bias();
        ((place >> SHIFT_BITS) as isize - start as isize, place as u32 % WORD_BITS)
    }

    #[inline(always)]
    fn push<const SIDE: usize>(&mut self, slab: usize, place: u64, bits: u64) {
        let Compartment { small, cubes, .. } = &mut self.slabs[slab];
        if SIDE == 2 {
            small.push(place << SMALL_BITS | bits);
        } else {
            cubes.push([bits, place]);
        }
    }

    /// A cube that is not all in one slab, layer by layer.
    #[cold]
    #[inline(never)]
    fn push_layers<const SIDE: usize>(&mut self, mut x: i64, mut place: u64, mut bits: u64) {
        while bits != 0 {
            let here = bits & ((1 << (SIDE * SIDE)) - 1);
            if let Some(slab) = self.cuts.of(x).filter(|_| here != 0) {
                self.push::<SIDE>(slab, place, here);
            }
            bits >>= SIDE * SIDE;
            x += 1;
            // Layers before the grid have places below 0.
            place = place.wrapping_add((self.cuts.layer() as u64) << SHIFT_BITS);
        }
    }
}

impl Sink for Outbox<'_> {
    /// A toggle: runs of other modes are their triangles'.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        reason = "inside the grid"
    )]
    fn run(&mut self, x: i64, y: i64, from: i64, _to: i64) {
        let Some(slab) = self.cuts.of(x) else { return };
        let column = x as usize * self.cuts.columns + y as usize;
        let word = column * self.cuts.column_words + (from as u32 / WORD_BITS) as usize;
        self.push::<2>(slab, self.place(word as isize, from as u32 % WORD_BITS), 0);
    }

    const LEAVES: bool = true;

    #[inline(always)]
    fn leave(&mut self, number: usize, x: [i64; 2], y: i64) {
        let strip = usize::try_from(y >> self.cuts.strip_shift).unwrap_or(0) % STRIPS;
        if let (Some(first), Some(last)) = (self.cuts.of(x[0]), self.cuts.of(x[1])) {
            for slab in &mut self.slabs[first..=last] {
                #[expect(clippy::cast_possible_truncation, reason = "meshes with more are voxelized by one thread")]
                slab.triangles[strip].push(number as u32);
            }
        }
    }

    /// Whether the slabs should be painted before more is put in.
    #[inline(always)]
    fn is_full(&self) -> bool {
        let entries = |slab: &Compartment| {
            slab.small.len() + 2 * slab.cubes.len() + slab.triangles.iter().map(Vec::len).sum::<usize>()
        };
        self.slabs.iter().map(entries).sum::<usize>() >= Self::MOST_ENTRIES
    }
}

/// Words from a column to the next along x, and along y.
#[derive(Clone, Copy)]
struct Steps {
    layer: u32,
    beside: u32,
}

impl Steps {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^15 columns of 2^9 words")]
    fn of(slab: &Slab<'_>) -> Self {
        Self { layer: slab.layer() as u32, beside: slab.column_words as u32 }
    }
}

/// Sets the voxels of a cube whose columns' bits are in the words from `first` on, and `steps` further along x and y: of all
/// columns without asking which have any, as that guess is wrong too often. `false`, and nothing done, where a column needs
/// two words, or some would not be among the words: then it is for [`set_columns`].
#[inline(always)]
#[expect(clippy::cast_sign_loss, reason = "too large, then")]
fn set_cube<const SIDE: usize>(words: &mut [u64], steps: Steps, first: isize, bits: u64, shift: u32) -> bool {
    if shift > WORD_BITS - side::<SIDE>() {
        return false;
    }
    // Of numbers known to be small, the compiler sees that no word is past the last.
    let (layer, beside) = (steps.layer as usize, steps.beside as usize);
    let last = (SIDE - 1) * (layer + beside);
    // At the end of a row, the column beside is the first of the next: its bits are 0 then.
    let Some(words) = words.get_mut(first as usize..) else { return false };
    if words.len() <= last {
        return false;
    }
    for x in 0..SIDE {
        for y in 0..SIDE {
            let run = bits >> ((SIDE * x + y) * SIDE) & ((1 << SIDE) - 1);
            words[x * layer + y * beside] |= run << shift;
        }
    }
    true
}

/// [`set_cube`] column by column; those without voxels may lie outside the words.
#[cold]
#[inline(never)]
#[expect(clippy::cast_sign_loss, reason = "voxels are inside the slab")]
fn set_columns<const SIDE: usize>(words: &mut [u64], steps: Steps, first: isize, mut bits: u64, shift: u32) {
    let side = side::<SIDE>();
    while bits != 0 {
        let column = bits.trailing_zeros() / side;
        let run = bits >> (column * side) & ((1 << side) - 1);
        bits ^= run << (column * side);
        let (x, y) = ((column / side) as usize, (column % side) as usize);
        let word = first.wrapping_add_unsigned(x * steps.layer as usize + y * steps.beside as usize) as usize;
        words[word] |= run << shift;
        if shift > WORD_BITS - side {
            let above = run >> (WORD_BITS - shift);
            if above != 0 {
                words[word + 1] |= above;
            }
        }
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most 3")]
const fn side<const SIDE: usize>() -> u32 {
    SIDE as u32
}

#[inline(always)]
fn paint_cube<const SIDE: usize>(words: &mut [u64], steps: Steps, first: isize, bits: u64, shift: u32) {
    if !set_cube::<SIDE>(words, steps, first, bits, shift) {
        set_columns::<SIDE>(words, steps, first, bits, shift);
    }
}

/// Where cubes are in the grid.
pub(super) struct PlaceInGrid<V: Simd> {
    x: i32x16<V>,
    /// The word of the low corner: of a cube that is partly outside the grid perhaps past its end, or below 0, or one for which
    /// no bit will be set.
    words: [i64x8<V>; 2],
    /// The low corner's bit in its word.
    shifts: i32x16<V>,
}

impl ColumnSink for Outbox<'_> {
    fn place<V: Simd>(&self, low: &[i32x16<V>; 3], _base: [i64; 3]) -> Place<V> {
        Place { column: low[0], z: low[2], row: 0 }
    }

    /// There are none: triangles with more than small cubes are left.
    fn columns<V: Simd>(&mut self, _simd: V, _at: i32x16<V>, _from: i32x16<V>, _bits: i32x16<V>, lanes: Lanes) {
        debug_assert_eq!(lanes, 0, "triangles of columns are left");
    }

    fn finish<V: Simd>(&mut self, _simd: V) {}
}

impl CubeSink for Outbox<'_> {
    type Places<V: Simd> = PlaceInGrid<V>;

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "all in or near a grid, of at most 2^15 voxels along an axis"
    )]
    fn places<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> PlaceInGrid<V> {
        let Cuts { columns, column_words, .. } = *self.cuts;
        let [x, y, z] = [low[0] + base[0] as i32, low[1] + base[1] as i32, low[2] + base[2] as i32];
        let (first, second) = (x * columns as i32 + y).widening_mul(column_words as i32);
        let (above_first, above_second) = (z >> SHIFT_BITS).widen();
        PlaceInGrid { x, words: [first + above_first, second + above_second], shifts: z & (WORD_BITS as i32 - 1) }
    }

    #[inline(always)]
    #[expect(
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "places as in `place`; an x below 0 is too large then"
    )]
    fn cubes<V: Simd, const SIDE: usize>(
        &mut self,
        _simd: V,
        at: &PlaceInGrid<V>,
        voxels: i32x16<V>,
        mut lanes: Lanes,
    ) {
        let bias = self.cuts.bias() as i64;
        let (first, second) = at.shifts.widen();
        let places = [(at.words[0] + bias) << SHIFT_BITS | first, (at.words[1] + bias) << SHIFT_BITS | second];
        let (x, places, bits) = (*at.x, [*places[0], *places[1]], *voxels);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % LANES;
            let (place, bits) = (places.as_flattened()[lane] as u64, u64::from(bits[lane].cast_unsigned()));
            match self.cuts.of_x.get(x[lane] as u32 as usize) {
                Some(of_x) if of_x.left as usize >= SIDE => self.push::<SIDE>(of_x.slab as usize, place, bits),
                _ => self.push_layers::<SIDE>(i64::from(x[lane]), place, bits),
            }
            lanes &= lanes - 1;
        }
    }
}
