//! Exposed faces by colour: rectangles of one colour each.

use rayon::prelude::*;
use trixel::Volume;
use trixel::attributes::Described;

use super::WriteOptions;
use super::surface::{Rectangle, rectangles};

/// The colour of voxels without one, deep inside a solid, where a grid's border cuts it open: white.
const WHITE: [u8; 4] = [u8::MAX; 4];

/// A rectangle of exposed faces of one colour, sRGB and alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ColoredRectangle {
    pub(super) rectangle: Rectangle,
    pub(super) color: [u8; 4],
}

/// The exposed faces of `volume`, which may be part of what is described, merged where they have one colour, in an order
/// that depends on the volume and its colours alone.
pub(super) fn colored_rectangles(
    volume: &Volume,
    described: &Described<'_>,
    options: &WriteOptions<'_>,
) -> Vec<ColoredRectangle> {
    rectangles(volume, options).into_par_iter().flat_map_iter(|rectangle| split(rectangle, described)).collect()
}

/// Cuts a rectangle into rectangles of one colour: greedily, each run of a row grows over the following rows.
fn split(rectangle: Rectangle, described: &Described<'_>) -> Vec<ColoredRectangle> {
    let [u0, u1] = rectangle.u;
    let [v0, v1] = rectangle.v;
    let color = |u: u32, v: u32| {
        let mut voxel = [0; 3];
        voxel[rectangle.axis] = rectangle.plane - u32::from(rectangle.positive);
        voxel[(rectangle.axis + 1) % 3] = u;
        voxel[(rectangle.axis + 2) % 3] = v;
        described.color(voxel).unwrap_or(WHITE)
    };
    let width = (u1 - u0) as usize;
    let mut colors: Vec<Option<[u8; 4]>> =
        (v0..v1).flat_map(|v| (u0..u1).map(move |u| (u, v))).map(|(u, v)| Some(color(u, v))).collect();
    let mut found = Vec::new();
    for (row, v) in (v0..v1).enumerate() {
        let mut column = 0;
        while column < width {
            let Some(color) = colors[row * width + column] else {
                column += 1;
                continue;
            };
            let is_same = |other: &&Option<[u8; 4]>| **other == Some(color);
            let length = colors[row * width + column..(row + 1) * width].iter().take_while(is_same).count();
            let mut height = 1;
            while row + height < (v1 - v0) as usize {
                let below = (row + height) * width + column;
                if !colors[below..below + length].iter().all(|other| *other == Some(color)) {
                    break;
                }
                height += 1;
            }
            for taken in row..row + height {
                colors[taken * width + column..taken * width + column + length].fill(None);
            }
            // At most `Grid::MAX_DIM`.
            let [column_u, length_u, height_v] = [column, length, height].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
            let u = [u0 + column_u, u0 + column_u + length_u];
            found.push(ColoredRectangle { rectangle: Rectangle { u, v: [v, v + height_v], ..rectangle }, color });
            column += length;
        }
    }
    found
}
