//! `.vox` files, read by `dot_vox`: every voxel is where it should be in the editor's world.
#![allow(clippy::unwrap_used, reason = "a test")]

mod common;

use std::collections::BTreeSet;
use std::fs;

use common::{CUBIC, ORIGIN, noise, samples, volume};
use dot_vox::{DotVoxData, SceneNode};
use trixel::{UpAxis, Volume};
use trixel_io::write::{WriteOptions, write_volume};

fn write_and_load(volume: &Volume, up: UpAxis) -> DotVoxData {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vox");
    let options = WriteOptions { up, ..WriteOptions::default() };
    write_volume(&path, volume, &options).unwrap().commit().unwrap();
    dot_vox::load_bytes(&fs::read(path).unwrap()).unwrap()
}

/// World positions of the voxels, by walking the scene from its root.
fn world(data: &DotVoxData) -> BTreeSet<[i64; 3]> {
    let mut found = BTreeSet::new();
    let mut rest = vec![(0u32, [0i64; 3])];
    while let Some((node, offset)) = rest.pop() {
        match &data.scenes[node as usize] {
            SceneNode::Transform { frames, child, .. } => {
                assert_eq!(frames.len(), 1);
                let at = frames[0].position().map_or([0; 3], |p| [p.x, p.y, p.z].map(i64::from));
                assert!(frames[0].attributes.keys().all(|key| key == "_t"));
                rest.push((*child, std::array::from_fn(|i| offset[i] + at[i])));
            }
            SceneNode::Group { children, .. } => rest.extend(children.iter().map(|&child| (child, offset))),
            SceneNode::Shape { models, .. } => {
                for shape in models {
                    let model = &data.models[shape.model_id as usize];
                    let size = [model.size.x, model.size.y, model.size.z].map(i64::from);
                    assert!(size.iter().all(|side| (1..=256).contains(side)));
                    for voxel in &model.voxels {
                        let local = [voxel.x, voxel.y, voxel.z].map(i64::from);
                        assert!((0..3).all(|i| local[i] < size[i]));
                        assert_eq!(
                            data.palette[usize::from(voxel.i)],
                            dot_vox::Color { r: 200, g: 200, b: 200, a: 255 }
                        );
                        let place = std::array::from_fn(|i| offset[i] + local[i] - size[i] / 2);
                        assert!(found.insert(place), "two voxels at {place:?}");
                    }
                }
            }
        }
    }
    found
}

/// The same places, from the definition: turned so that up is z, centred in x and y, on z = 0 or centred.
fn expected(volume: &Volume, up: UpAxis) -> BTreeSet<[i64; 3]> {
    let [nx, ny, nz] = volume.grid().dims().map(i64::from);
    let sides = match up {
        UpAxis::X => [ny, nz, nx],
        UpAxis::Y => [nx, nz, ny],
        UpAxis::Z => [nx, ny, nz],
    };
    let floor = if sides[2] > 1000 { -(sides[2] / 2) } else { 0 };
    volume
        .iter()
        .map(|voxel| {
            let [x, y, z] = voxel.map(i64::from);
            let turned = match up {
                UpAxis::X => [y, z, x],
                UpAxis::Y => [x, nz - 1 - z, y],
                UpAxis::Z => [x, y, z],
            };
            [turned[0] - sides[0] / 2, turned[1] - sides[1] / 2, turned[2] + floor]
        })
        .collect()
}

#[test]
fn every_voxel_is_in_its_place() {
    let long = volume([3, 600, 5], CUBIC, |v| noise(v) && !(256..512).contains(&v[1]));
    let extra = ["long", "high", "largest"].into_iter().zip([
        long,
        volume([2, 3, 1001], CUBIC, |v| v[2] % 100 == 0 || v[2] == 999),
        volume([2000, 1, 2000], CUBIC, |v| v[0] % 1999 == 0 && v[2] % 1999 == 0),
    ]);
    for (name, volume) in samples(CUBIC).into_iter().chain(extra) {
        for up in [UpAxis::X, UpAxis::Y, UpAxis::Z] {
            let data = write_and_load(&volume, up);
            let found = world(&data);
            assert_eq!(found, expected(&volume, up), "{name}, {up:?} up");
            assert!(found.iter().flatten().all(|place| (-1000..1000).contains(place)), "{name}, {up:?} up");
        }
    }
}

#[test]
fn parts_without_voxels_are_left_out() {
    let data = write_and_load(&volume([3, 600, 5], CUBIC, |v| !(256..512).contains(&v[1])), UpAxis::Z);
    assert_eq!(data.models.len(), 2);
    assert!(write_and_load(&volume([3, 600, 5], CUBIC, |_| false), UpAxis::Z).models.is_empty());
}

#[test]
fn the_root_node_holds_the_grid() {
    let data = write_and_load(&volume([3, 4, 5], CUBIC, |_| true), UpAxis::Z);
    let SceneNode::Transform { attributes, .. } = &data.scenes[0] else { panic!("the root is not a transform") };
    let numbers = |key: &str| attributes[key].split(' ').map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
    assert_eq!(numbers("trixel_origin"), ORIGIN);
    assert_eq!(numbers("trixel_voxel_size"), CUBIC);
    assert_eq!(numbers("trixel_dims"), [3.0, 4.0, 5.0]);
}
