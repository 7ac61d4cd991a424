//! `MagicaVoxel` scenes (`.vox`): <https://github.com/ephtracy/voxel-model>, `MagicaVoxel-file-format-vox.txt` and its
//! extension.
//!
//! z points up in the editor, so the mesh is turned: up = z stays, up = y maps (x, y, z) to (x, -z, y), up = x maps it to
//! (y, z, x); all are rotations. A model holds at most 256 voxels along an axis, so a volume becomes a scene of models;
//! parts without voxels are left out. The editor's world ends at -1000 and 999, so the scene is centred in x and y and
//! stands on z = 0 (or is centred there too where it is taller than 1000).
//!
//! Own code rather than `dot_vox`, whose writer wants all voxels of all models in memory first; its reader checks this
//! one's files in the tests.

use std::io::{self, Write};
use std::ops::Range;

use trixel::attributes::Described;
use trixel::{Grid, Occupancy, UpAxis, WORD_BITS};

use super::little_endian::put32;
use super::palette::Palette;
use super::{Failure, WriteOptions};
use crate::numbers::spaced;

/// Voxels of a model along an axis.
const MODEL_SIDE: u32 = 256;
/// Voxels of the editor's world along an axis, from -1000 to 999.
const WORLD_SIDE: u32 = 2000;
/// Lengths are read as signed 32-bit numbers.
const MAX_FILE_BYTES: u64 = i32::MAX as u64;
/// Voxels name their colour by its number, from 1; this one is all that occupancy needs. Where voxels have colours, the
/// palette holds them ([`Palette`]).
const COLOR: u8 = 1;
const LIGHT_GREY: [u8; 4] = [200, 200, 200, 255];

/// One axis of the scene: which axis of the volume it is and whether it runs against it.
#[derive(Clone, Copy)]
struct SceneAxis {
    from: usize,
    reversed: bool,
}

/// The colours of the scene's voxels.
struct Colors<'a> {
    described: Described<'a>,
    palette: Palette,
}

/// The volume as the editor shall see it.
struct Scene<'a, O> {
    volume: &'a O,
    colors: Option<Colors<'a>>,
    axes: [SceneAxis; 3],
}

/// A part of the scene that fits a model.
struct Part {
    /// Scene coordinates, from 0.
    range: [Range<u32>; 3],
    voxels: u64,
}

fn scene_axes(up: UpAxis) -> [SceneAxis; 3] {
    let axis = |from, reversed| SceneAxis { from, reversed };
    match up {
        UpAxis::X => [axis(1, false), axis(2, false), axis(0, false)],
        UpAxis::Y => [axis(0, false), axis(2, true), axis(1, false)],
        UpAxis::Z => [axis(0, false), axis(1, false), axis(2, false)],
    }
}

/// The editor's world is bounded.
pub(super) fn check(grid: &Grid) -> Result<(), String> {
    let [nx, ny, nz] = grid.dims();
    if grid.dims().iter().all(|&n| n <= WORLD_SIDE) {
        return Ok(());
    }
    Err(format!(
        "a grid of {nx} x {ny} x {nz} voxels does not fit a .vox scene, which ends at {WORLD_SIDE} along each axis; \
         choose a lower resolution, write parts of the mesh with explicit grids, or choose another format such as .npz"
    ))
}

/// Writes the volume, whose grid [`check`] has passed.
pub(super) fn write(volume: &impl Occupancy, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let colors = options.described.filter(Described::has_colors);
    let colors = colors.map(|described| Colors { palette: Palette::new(volume, &described), described });
    let scene = Scene { volume, colors, axes: scene_axes(options.up) };
    let parts = scene.parts();
    let graph = scene.graph(&parts);
    let models: u64 = parts.iter().map(Part::bytes).sum();
    let palette = chunk(b"RGBA", &palette(scene.colors.as_ref()));
    let children = models + graph.len() as u64 + palette.len() as u64;
    if children > MAX_FILE_BYTES {
        let voxels: u64 = parts.iter().map(|part| part.voxels).sum();
        return Err(Failure::Limit(format!(
            "{voxels} voxels take {children} bytes, and .vox files end at 2 GiB; choose a lower resolution or a \
             surface mode, or another format such as .npz"
        )));
    }
    out.write_all(b"VOX ")?;
    out.write_all(&150u32.to_le_bytes())?;
    out.write_all(&chunk_header(b"MAIN", 0, children))?;
    for (done, part) in (1..).zip(&parts) {
        scene.write_model(part, out)?;
        options.report(done, parts.len() as u64);
    }
    out.write_all(&graph)?;
    Ok(out.write_all(&palette)?)
}

impl Part {
    fn size(&self) -> [u32; 3] {
        std::array::from_fn(|i| self.range[i].end - self.range[i].start)
    }

    /// Bytes of its SIZE and XYZI chunks.
    fn bytes(&self) -> u64 {
        12 + 12 + 12 + 4 + self.voxels * 4
    }
}

impl<O: Occupancy> Scene<'_, O> {
    fn dims(&self) -> [u32; 3] {
        self.axes.map(|axis| self.volume.grid().dims()[axis.from])
    }

    /// The parts that have voxels.
    fn parts(&self) -> Vec<Part> {
        let dims = self.dims();
        let ranges = |n: u32| (0..n).step_by(MODEL_SIDE as usize).map(move |start| start..n.min(start + MODEL_SIDE));
        let mut parts = Vec::new();
        for z in ranges(dims[2]) {
            for y in ranges(dims[1]) {
                for x in ranges(dims[0]) {
                    let mut part = Part { range: [x.clone(), y.clone(), z.clone()], voxels: 0 };
                    let mut voxels = 0;
                    self.for_each_word(&part, |_, bits| voxels += u64::from(bits.count_ones()));
                    if voxels > 0 {
                        part.voxels = voxels;
                        parts.push(part);
                    }
                }
            }
        }
        parts
    }

    /// Calls `visit` with the volume's words inside a part.
    fn for_each_word(&self, part: &Part, visit: impl FnMut([u32; 3], u64)) {
        // The part in the volume's coordinates.
        let mut range: [Range<u32>; 3] = Default::default();
        for (axis, along) in self.axes.iter().zip(&part.range) {
            let n = self.volume.grid().dims()[axis.from];
            range[axis.from] = if axis.reversed { n - along.end..n - along.start } else { along.clone() };
        }
        self.volume.for_each_word(&range, visit);
    }

    fn write_model(&self, part: &Part, out: &mut impl Write) -> io::Result<()> {
        out.write_all(&chunk_header(b"SIZE", 12, 0))?;
        for side in part.size() {
            out.write_all(&side.to_le_bytes())?;
        }
        out.write_all(&chunk_header(b"XYZI", 4 + part.voxels * 4, 0))?;
        // At most 256^3.
        out.write_all(&u32::try_from(part.voxels).unwrap_or(u32::MAX).to_le_bytes())?;
        let dims = self.volume.grid().dims();
        let mut result = Ok(());
        let mut records = [0; WORD_BITS as usize * 4];
        self.for_each_word(part, |voxel, bits| {
            // A record is x, y and z in the model, each below its side of 256, and the colour: as one little-endian
            // number, whose change from one voxel of the column to the next is the same for all.
            let (mut first, mut step) = (u32::from(COLOR) << 24, 0u32);
            for (place, (axis, range)) in self.axes.iter().zip(&part.range).enumerate() {
                let (n, at) = (dims[axis.from], voxel[axis.from]);
                // The word may start before the part; what is too little or too much cancels out.
                let at = if axis.reversed { n.wrapping_sub(1 + at) } else { at }.wrapping_sub(range.start);
                first = first.wrapping_add(at << (8 * place));
                if axis.from == 2 {
                    step = if axis.reversed { 1u32.wrapping_neg() } else { 1 } << (8 * place);
                }
            }
            let mut rest = bits;
            let mut length = 0;
            for record in records.as_chunks_mut().0 {
                if rest == 0 {
                    break;
                }
                *record = first.wrapping_add(step.wrapping_mul(rest.trailing_zeros())).to_le_bytes();
                if let Some(Colors { described, palette }) = &self.colors {
                    let [x, y, z] = voxel;
                    record[3] = palette.number(described.color([x, y, z + rest.trailing_zeros()]));
                }
                rest &= rest - 1;
                length += record.len();
            }
            if result.is_ok() {
                result = out.write_all(&records[..length]);
            }
        });
        result
    }

    /// Where the scene's voxel 0 lies in the world.
    fn world_start(&self) -> [i64; 3] {
        let [nx, ny, nz] = self.dims().map(i64::from);
        [-(nx / 2), -(ny / 2), if nz > i64::from(WORLD_SIDE / 2) { -(nz / 2) } else { 0 }]
    }

    /// The chunks of the scene graph: a root transform, a group, and a transform and a shape for each model.
    fn graph(&self, parts: &[Part]) -> Vec<u8> {
        let grid = self.volume.grid();
        let [nx, ny, nz] = grid.dims();
        // The editor ignores attributes it does not know.
        let attributes = [
            ("trixel_origin", spaced(grid.origin())),
            ("trixel_voxel_size", spaced(grid.voxel_size())),
            ("trixel_dims", format!("{nx} {ny} {nz}")),
        ];
        // At most 8^3 parts.
        let count = u32::try_from(parts.len()).unwrap_or(u32::MAX);
        let mut graph = transform(0, &attributes, 1, u32::MAX, None);
        let mut group = Vec::new();
        put32(&mut group, 1); // its id
        put_dictionary(&mut group, &[]);
        put32(&mut group, count);
        for model in 0..count {
            put32(&mut group, 2 + 2 * model);
        }
        graph.extend(chunk(b"nGRP", &group));
        let start = self.world_start();
        for (model, part) in (0..).zip(parts) {
            // A translation places the voxel at floor(size / 2) of the model.
            let translation: [i64; 3] =
                std::array::from_fn(|i| start[i] + i64::from(part.range[i].start) + i64::from(part.size()[i] / 2));
            graph.extend(transform(2 + 2 * model, &[], 3 + 2 * model, 0, Some(translation)));
            let mut shape = Vec::new();
            put32(&mut shape, 3 + 2 * model); // its id
            put_dictionary(&mut shape, &[]);
            put32(&mut shape, 1); // models
            put32(&mut shape, model);
            put_dictionary(&mut shape, &[]);
            graph.extend(chunk(b"nSHP", &shape));
        }
        graph
    }
}

fn transform(id: u32, attributes: &[(&str, String)], child: u32, layer: u32, at: Option<[i64; 3]>) -> Vec<u8> {
    let mut content = Vec::new();
    put32(&mut content, id);
    put_dictionary(&mut content, attributes);
    put32(&mut content, child);
    put32(&mut content, u32::MAX); // reserved, -1
    put32(&mut content, layer); // -1 is none
    put32(&mut content, 1); // frames
    let frame = at.map(|[x, y, z]| ("_t", format!("{x} {y} {z}")));
    put_dictionary(&mut content, frame.as_slice());
    chunk(b"nTRN", &content)
}

fn palette(colors: Option<&Colors<'_>>) -> Vec<u8> {
    // Entry i is colour i + 1; those that are not used are black.
    let mut entries = [[0, 0, 0, 255]; 256];
    match colors {
        Some(colors) => entries.iter_mut().zip(&colors.palette.entries).for_each(|(entry, color)| *entry = *color),
        None => entries[usize::from(COLOR) - 1] = LIGHT_GREY,
    }
    entries.as_flattened().to_vec()
}

fn chunk(id: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut chunk = chunk_header(id, content.len() as u64, 0).to_vec();
    chunk.extend(content);
    chunk
}

fn chunk_header(id: &[u8; 4], content: u64, children: u64) -> [u8; 12] {
    // Both are within `MAX_FILE_BYTES`, which was checked before anything is written.
    let [content, children] = [content, children].map(|n| u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes());
    let mut header = [0; 12];
    header[..4].copy_from_slice(id);
    header[4..8].copy_from_slice(&content);
    header[8..].copy_from_slice(&children);
    header
}

fn put_dictionary(out: &mut Vec<u8>, entries: &[(&str, String)]) {
    let length = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    put32(out, length(entries.len()));
    for (key, value) in entries {
        for text in [*key, value.as_str()] {
            put32(out, length(text.len()));
            out.extend(text.as_bytes());
        }
    }
}
