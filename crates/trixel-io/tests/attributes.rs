//! What is in the voxels, in every format that can tell.

#![expect(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeSet;
use std::io::{Cursor, Read};
use std::path::Path;

use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Described, Values, VoxelAttributes, compute};
use trixel::lattice::LatticeMesh;
use trixel::{AlphaMode, Attribute, Grid, Job, Material, Mesh, Mode, Rank, UpAxis, Volume, voxelize};
use trixel_io::read::{ReadOptions, read_mesh};
use trixel_io::volume_read::read_volume;
use trixel_io::write::{WriteOptions, write_volume};

/// A volume and everything that can be known of it.
struct Case {
    volume: Volume,
    attributes: VoxelAttributes,
}

/// A tilted, slotted sheet: columns of a few colours, or of as many as corners allow, and one that the alpha test cuts out.
fn case(many_colors: bool, combine: Combine) -> Case {
    let mut mesh = Mesh::default();
    let mut colors = Vec::new();
    for i in 0..12u32 {
        let start = 4 * i;
        let [x0, x1] = [f64::from(i) * 2.0, f64::from(i) * 2.0 + 1.5];
        mesh.positions.extend([[x0, 0.0, 0.5], [x1, 0.0, 0.5], [x1, 11.0, 6.5], [x0, 11.0, 6.5]]);
        mesh.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
        mesh.triangle_materials.extend([u32::from(i == 5); 2]);
        let own = [i as f32 / 11.0, 0.25, 1.0 - i as f32 / 11.0, 1.0];
        let far = if many_colors { [1.0, i as f32 / 11.0, 0.0, 1.0] } else { own };
        colors.extend([own, own, far, far]);
    }
    mesh.colors = Some(Attribute::per_vertex(colors));
    let cut_out = Material {
        base_color: [1.0, 1.0, 1.0, 0.25],
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    mesh.materials = vec![Material::default(), cut_out];
    let grid = Grid::new([-1.0, -1.0, -2.0], [1.0, 1.0, 1.0], [26, 14, 70]).unwrap();
    let job = Job::new(grid, Mode::Conservative);
    let volume = voxelize(&mesh, &job).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let request = AttributeRequest::new(&AttributeKind::ALL, combine);
    let attributes = compute(&mesh, &lattice, &job, &volume, &request).unwrap();
    assert!(attributes.cuts_out());
    Case { volume, attributes }
}

impl Case {
    /// Writes the volume to `path` and gives what is described to `check`.
    fn write(&self, path: &Path, sparse: bool, check: impl FnOnce(&Described<'_>)) {
        let rank = Rank::new(&self.volume);
        let described = Described::new(&rank, &self.attributes).unwrap();
        // As the format has it, so that nothing is turned.
        let up = if path.extension().is_some_and(|extension| extension == "glb") { UpAxis::Y } else { UpAxis::Z };
        let options = WriteOptions { up, sparse, described: Some(described), progress: None };
        write_volume(path, &self.volume, &options).unwrap().commit().unwrap();
        check(&described);
    }
}

/// The shape and the bytes of an array of an `.npz` file.
fn array(archive: &mut zip::ZipArchive<Cursor<Vec<u8>>>, name: &str) -> (String, Vec<u8>) {
    let mut bytes = Vec::new();
    archive.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = String::from_utf8(bytes[10..header].to_vec()).unwrap();
    (text, bytes[header..].to_vec())
}

#[test]
fn npz_holds_every_attribute_dense_and_sparse() {
    let folder = tempfile::tempdir().unwrap();
    for combine in [Combine::Mean, Combine::All] {
        let case = case(true, combine);
        for sparse in [false, true] {
            let path = folder.path().join("volume.npz");
            case.write(&path, sparse, |described| {
                let mut archive = zip::ZipArchive::new(Cursor::new(std::fs::read(&path).unwrap())).unwrap();
                let rows = sparse || combine == Combine::All;
                if combine == Combine::All {
                    let (_, offsets) = array(&mut archive, "offsets");
                    let expected: Vec<u8> = described
                        .attributes()
                        .offsets()
                        .unwrap()
                        .iter()
                        .flat_map(|offset| offset.to_le_bytes())
                        .collect();
                    assert_eq!(offsets, expected);
                }
                for (kind, values) in described.attributes().columns() {
                    let (header, found) = array(&mut archive, kind.name());
                    let (dtype, channels) = values.layout();
                    assert!(header.contains(&format!("'{dtype}'")), "{header}");
                    let mut shape = if rows { vec![values.len()] } else { vec![26, 14, 70] };
                    if channels > 1 {
                        shape.push(usize::try_from(channels).unwrap());
                    }
                    let text = shape.iter().map(|n| format!("{n}, ")).collect::<String>();
                    assert!(header.contains(&format!("({})", text.trim_end())), "{header}");
                    let mut expected = Vec::new();
                    if rows {
                        (0..values.len()).for_each(|row| values.append_row(row, &mut expected));
                    } else {
                        for x in 0..26 {
                            for y in 0..14 {
                                for z in 0..70 {
                                    match described.row([x, y, z]) {
                                        Some(row) => values.append_row(row, &mut expected),
                                        None => values.append_nothing(&mut expected),
                                    }
                                }
                            }
                        }
                    }
                    assert!(found == expected, "{} differs", kind.name());
                }
            });
            assert_eq!(read_volume(&path, None).unwrap().volume, case.volume, "what it holds more does not disturb");
        }
    }
}

#[test]
fn vox_has_the_voxels_own_colours_as_long_as_there_are_few() {
    let folder = tempfile::tempdir().unwrap();
    for many in [false, true] {
        let case = case(many, Combine::Mean);
        let path = folder.path().join("volume.vox");
        case.write(&path, false, |described| {
            let shown = described.without_cut_out().unwrap().unwrap();
            let own: BTreeSet<_> = shown.iter().map(|voxel| described.color(voxel).unwrap()).collect();
            assert_eq!(own.len() > 255, many, "{} colours", own.len());
            let vox = dot_vox::load(path.to_str().unwrap()).unwrap();
            let model = &vox.models[0];
            assert_eq!(model.voxels.len() as u64, shown.count(), "what is cut out is left out");
            let mut worst = 0;
            for voxel in &model.voxels {
                let at = [voxel.x, voxel.y, voxel.z].map(u32::from);
                let expected = described.color(at).unwrap();
                let found = vox.palette[usize::from(voxel.i)];
                for (a, b) in [found.r, found.g, found.b].into_iter().zip(expected) {
                    worst = worst.max(a.abs_diff(b));
                }
            }
            if many {
                assert!(worst < 32, "quantized colours are up to {worst} off");
            } else {
                assert_eq!(worst, 0);
                let used: BTreeSet<_> = model.voxels.iter().map(|voxel| voxel.i).collect();
                assert_eq!(used.len(), own.len());
            }
        });
    }
}

#[test]
fn faces_have_the_colours_of_their_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let case = case(true, Combine::Mean);
    for extension in ["ply", "obj", "glb"] {
        let path = folder.path().join(format!("volume.{extension}"));
        case.write(&path, false, |described| {
            let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
            let colors = mesh.colors.as_ref().unwrap();
            let mut seen = BTreeSet::new();
            for (index, &triangle) in mesh.triangles.iter().enumerate() {
                let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                let linear = colors.on_triangle(index, triangle).unwrap();
                assert!(linear[0] == linear[1] && linear[1] == linear[2], "{extension}: one face, one colour");
                let srgb = |v: f32| if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
                let [r, g, b, _] = linear[0];
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
                let found = [r, g, b].map(|v| (srgb(v) * 255.0).round() as u8);
                // Half a voxel inside the face, at a corner of the face and at the middle of the triangle.
                let [a, b, c] = corners;
                let edge = |w: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| w[i] - a[i]) };
                let (u, v) = (edge(b), edge(c));
                let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
                let inside: [f64; 3] = std::array::from_fn(|i| {
                    let middle = (a[i] + b[i] + c[i]) / 3.0;
                    middle - 0.5 * normal[i] / length - case.volume.grid().origin()[i]
                });
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the grid")]
                let voxel = inside.map(|c| c.floor() as u32);
                let [r, g, b, _] = described.color(voxel).unwrap();
                for (a, b) in found.into_iter().zip([r, g, b]) {
                    assert!(a.abs_diff(b) <= 1, "{extension} {voxel:?}: {found:?} {:?}", [r, g, b]);
                }
                seen.insert(found);
            }
            assert!(seen.len() > 100, "{extension}: {} colours", seen.len());
        });
    }
}

#[test]
fn vti_has_attributes_as_cell_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let case = case(true, Combine::Nearest);
    let path = folder.path().join("volume.vti");
    case.write(&path, false, |described| {
        let bytes = std::fs::read(&path).unwrap();
        let start = bytes.windows(14).position(|window| window == b"encoding=\"raw\"").unwrap();
        let start = start + bytes[start..].iter().position(|&b| b == b'_').unwrap() + 1;
        let text = String::from_utf8_lossy(&bytes[..start]).into_owned();
        for (kind, values) in described.attributes().columns() {
            let at = text.find(&format!("Name=\"{}\"", kind.name())).unwrap();
            let (offset, _) = text[at..].split_once("offset=\"").unwrap().1.split_once('"').unwrap();
            let mut data = &bytes[start + offset.parse::<usize>().unwrap()..];
            let mut word = || {
                let (word, rest) = data.split_first_chunk::<8>().unwrap();
                data = rest;
                usize::try_from(u64::from_le_bytes(*word)).unwrap()
            };
            let [blocks, _, _] = [word(), word(), word()];
            let sizes: Vec<_> = (0..blocks).map(|_| word()).collect();
            let mut found = Vec::new();
            for size in sizes {
                flate2::read::ZlibDecoder::new(&data[..size]).read_to_end(&mut found).unwrap();
                data = &data[size..];
            }
            let mut expected = Vec::new();
            for z in 0..70 {
                for y in 0..14 {
                    for x in 0..26 {
                        match described.row([x, y, z]) {
                            Some(row) => values.append_row(row, &mut expected),
                            None => values.append_nothing(&mut expected),
                        }
                    }
                }
            }
            assert!(found == expected, "{} differs", kind.name());
        }
    });
    assert_eq!(read_volume(&path, None).unwrap().volume, case.volume);
}

#[test]
fn a_solid_has_white_where_a_border_cuts_it_open() {
    let mut mesh = trixel::scene::build("cube").unwrap();
    mesh.materials = vec![Material { base_color: [1.0, 0.0, 0.0, 1.0], ..Material::default() }];
    mesh.triangle_materials = vec![0; mesh.triangles.len()];
    let bounds = mesh.bounds().unwrap();
    let whole = Grid::fit(&bounds, 16).unwrap();
    // The lower half: its upper side is the grid's border.
    let grid = Grid::new(whole.origin(), whole.voxel_size(), [16, 16, 8]).unwrap();
    let job = Job::new(grid, Mode::Solid);
    let volume = voxelize(&mesh, &job).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let request = AttributeRequest::new(&[AttributeKind::Color], Combine::Mean);
    let attributes = compute(&mesh, &lattice, &job, &volume, &request).unwrap();
    let Some(Values::U8x4(colors)) = attributes.get(AttributeKind::Color) else { panic!("no colours") };
    assert!(colors.iter().all(|color| *color == [255, 0, 0, 255] || *color == [0; 4]));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.vox");
    Case { volume, attributes }.write(&path, false, |described| {
        assert!(described.without_cut_out().unwrap().is_none());
        let vox = dot_vox::load(path.to_str().unwrap()).unwrap();
        assert_eq!(vox.models[0].voxels.len(), 16 * 16 * 8);
        let used: BTreeSet<_> = vox.models[0].voxels.iter().map(|voxel| voxel.i).collect();
        let colors: Vec<_> = used.into_iter().map(|i| vox.palette[usize::from(i)]).map(|c| [c.r, c.g, c.b]).collect();
        assert_eq!(colors, [[255, 0, 0], [255, 255, 255]]);
    });
}
