//! The real meshes, where they are, against the table beside them.

use trixel_io::read::{MeshFormat, ReadOptions, read_mesh};

/// One row of the table.
#[derive(Debug)]
struct Row {
    file: String,
    triangles: usize,
    vertices: usize,
    min: Vec<f64>,
    max: Vec<f64>,
}

fn parse(row: &str) -> Option<Row> {
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    let numbers = |corner: &str| -> Vec<f64> {
        corner.trim_matches(['(', ')']).split(' ').filter_map(|n| n.parse().ok()).collect()
    };
    let (min, max) = cells.get(7)?.split_once("..(")?;
    Some(Row {
        file: cells[1].strip_prefix('`')?.strip_suffix('`')?.to_owned(),
        triangles: cells[3].parse().ok()?,
        vertices: cells[4].parse().ok()?,
        min: numbers(min),
        max: numbers(max),
    })
}

/// Whether a coordinate is what the table prints with five digits.
fn close(printed: f64, found: f64) -> bool {
    (printed - found).abs() <= 1.001 * 0.5 * 10f64.powf(printed.abs().log10().floor() - 4.0) || printed == found
}

#[test]
fn real_polygon_meshes_match_their_table() {
    let Some(folder) = super::real::models_folder() else { return };
    let Ok(table) = std::fs::read_to_string(folder.join("README.md")) else {
        println!("skipped: no README.md in {}", folder.display());
        return;
    };
    let mut read = 0;
    for row in table.lines().filter_map(parse) {
        let path = folder.join(&row.file);
        let format = MeshFormat::from_path(&path).unwrap();
        if !matches!(format, MeshFormat::Obj | MeshFormat::Stl | MeshFormat::Ply | MeshFormat::Off) {
            continue;
        }
        if !path.exists() {
            println!("skipped: no {}", path.display());
            continue;
        }
        let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
        mesh.check().unwrap();
        assert_eq!(mesh.triangles.len(), row.triangles, "{}", row.file);
        match format {
            // The table counts vertices after splitting them at seams, which this reader never does.
            MeshFormat::Obj => assert!(mesh.positions.len() <= row.vertices, "{}", row.file),
            MeshFormat::Stl => assert_eq!(mesh.positions.len(), 3 * row.triangles, "{}", row.file),
            MeshFormat::Ply if !mesh.uvs.is_empty() => assert!(mesh.positions.len() <= row.vertices, "{}", row.file),
            _ => assert_eq!(mesh.positions.len(), row.vertices, "{}", row.file),
        }
        let bounds = mesh.bounds().unwrap();
        let coordinates = row.min.iter().zip(bounds.min).chain(row.max.iter().zip(bounds.max));
        assert_eq!((row.min.len(), row.max.len()), (3, 3));
        for (&printed, found) in coordinates {
            assert!(close(printed, found), "{}: {printed} in the table, {found} here", row.file);
        }
        let bare = read_mesh(&path, &ReadOptions { attributes: false }).unwrap().mesh;
        assert_eq!((bare.positions, bare.triangles), (mesh.positions, mesh.triangles), "{}", row.file);
        read += 1;
    }
    println!("read {read} meshes");
    assert!(read >= 40, "the table has more than 40 of these formats, read only {read}");
}
