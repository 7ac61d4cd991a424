//! Damaged files of every kind: an error or a mesh, soon, and never a panic.

use std::time::{Duration, Instant};

use trixel_io::read::{Loaded, MeshFormat, ReadError, ReadOptions, read_mesh_bytes};

/// Small valid files that between them use every feature.
fn seeds() -> Vec<(MeshFormat, Vec<u8>)> {
    let obj = "mtllib a.mtl b.mtl\nv 0 0 0 1 0 0\nv 1.5e0 0 0\nv 1 1 0 2\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nusemtl a b\n\
               f 1/1/1 2/2/1 \\\n 3/1/1\nf -4 -3 -2 -1\ncurv 1\nf 1//1 2//1 3//1\nf 2 1 4 3 2\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
               facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\n\
               endsolid a\n";
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty float x\nproperty float y\n\
               property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\n\
               element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
               element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
               0 0 0 1 2 3 0 0\n1 0 0 1 2 3 0 1\n1 1 0 9 9 9 1 1\n0 1 0 0 0 0 1 1\n3 0 1 2 6 0 0 1 0 1 1 0\n4 0 1 2 3 0 0\n\
               6 0 1 2 -1 2 3\n";
    let off = "STCNOFF\n# c\n4 2 0\n0 0 0 0 0 1 1 0 0 0.5 0.25\n1 0 0 0 0 1 0 1 0 1 0.5 0.25\n1 1 0 0 0 1 0 0 1 0 0\n\
               0 1 0 0 0 1 0 0 1 0 0\n3 0 1 2\n4 0 1 2 3 255 0 0\n";
    vec![
        (MeshFormat::Obj, obj.into()),
        (MeshFormat::Stl, stl.into()),
        (MeshFormat::Stl, super::stl::binary("solid")),
        (MeshFormat::Ply, ply.into()),
        (MeshFormat::Ply, super::ply::binary(false)),
        (MeshFormat::Ply, super::ply::binary(true)),
        (MeshFormat::Ply, super::ply::plain_binary(false, &[&[0, 1, 2], &[0, 1, 2, 3], &[0, 2, 3]])),
        (MeshFormat::Off, off.into()),
    ]
}

/// Reads with and without attributes; what comes out must be sound.
fn try_read(format: MeshFormat, bytes: &[u8]) -> Result<Loaded, ReadError> {
    for attributes in [false, true] {
        let start = Instant::now();
        let result = read_mesh_bytes(format, bytes, &ReadOptions { attributes });
        assert!(start.elapsed() < Duration::from_secs(5), "{format:?} took {:?}", start.elapsed());
        if let Ok(loaded) = &result {
            let mesh = &loaded.mesh;
            mesh.check().unwrap();
            assert!(!mesh.triangles.is_empty());
            assert!(mesh.triangle_materials.is_empty() || mesh.triangle_materials.len() == mesh.triangles.len());
            for corners in mesh.uvs.iter().filter_map(|uvs| uvs.corners.as_ref()) {
                assert_eq!(corners.len(), mesh.triangles.len());
            }
            // Corners are at most one to a byte of file; nothing is larger than a few words a corner.
            assert!(mesh.positions.len() <= bytes.len() && mesh.triangles.len() <= bytes.len());
        }
        if attributes {
            return result;
        }
    }
    unreachable!()
}

#[test]
fn the_seeds_themselves_are_fine() {
    for (format, bytes) in seeds() {
        try_read(format, &bytes).unwrap();
    }
}

#[test]
fn truncated_anywhere() {
    for (format, bytes) in seeds() {
        for length in 0..bytes.len() {
            let result = try_read(format, &bytes[..length]);
            // The binary formats know how much there must be.
            if bytes.contains(&0) {
                assert!(result.is_err(), "{format:?} cut at {length} of {}", bytes.len());
            }
        }
    }
}

/// Numbers that look random and are the same in every run (SplitMix64).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((z ^ (z >> 31)) % end as u64).unwrap()
    }
}

#[test]
fn thousands_of_mutations() {
    const WORDS: [&[u8]; 12] = [
        b"nan",
        b"1e400",
        b"-1",
        b"4294967295",
        b"18446744073709551616",
        b" ",
        b"\n",
        b"\\\n",
        b"/",
        b"\xff",
        b"#",
        b"\0\0\0\0",
    ];
    let mut random = Random(1);
    for (format, seed) in seeds() {
        for _ in 0..4000 {
            let mut bytes = seed.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bytes.len());
                match random.below(5) {
                    0 => bytes[at] = u8::try_from(random.below(256)).unwrap(),
                    1 => bytes[at] ^= 1 << random.below(8),
                    2 => {
                        let word = WORDS[random.below(WORDS.len())];
                        bytes.splice(at..(at + random.below(4)).min(bytes.len()), word.iter().copied());
                    }
                    3 => {
                        let end = (at + random.below(40)).min(bytes.len());
                        let piece = bytes[at..end].to_vec();
                        let to = random.below(bytes.len());
                        bytes.splice(to..to, piece);
                    }
                    _ => {
                        bytes.drain(at..(at + random.below(9)).min(bytes.len()));
                        bytes.push(b'\n');
                    }
                }
            }
            let _ = try_read(format, &bytes);
        }
    }
}

#[test]
fn any_bytes_at_all() {
    let mut random = Random(2);
    for format in [MeshFormat::Obj, MeshFormat::Stl, MeshFormat::Ply, MeshFormat::Off] {
        for _ in 0..500 {
            let bytes: Vec<u8> = (0..random.below(300)).map(|_| u8::try_from(random.below(256)).unwrap()).collect();
            let _ = try_read(format, &bytes);
        }
    }
}

/// A line of a megabyte and more, of each kind.
#[test]
fn huge_lines_words_and_polygons() {
    const N: usize = 1_000_000;
    let many = |word: &str| word.repeat(N);
    let _ = try_read(MeshFormat::Obj, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", many("1 2 3 ")).as_bytes());
    let _ = try_read(MeshFormat::Obj, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {}\n", many("3")).as_bytes());
    let _ = try_read(MeshFormat::Obj, many("\\\n").as_bytes());
    let _ = try_read(MeshFormat::Obj, many("v 0 0 0\\").as_bytes());
    let _ = try_read(MeshFormat::Obj, format!("usemtl {}", many("x")).as_bytes());
    let _ = try_read(MeshFormat::Obj, format!("mtllib {}", many("x ")).as_bytes());
    let _ = try_read(MeshFormat::Obj, many("usemtl x\n").as_bytes());
    let _ = try_read(MeshFormat::Obj, many("mtllib x\n").as_bytes());
    let _ = try_read(MeshFormat::Off, format!("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3000000 {}", many("0 1 2 ")).as_bytes());
    let _ = try_read(MeshFormat::Off, format!("OFF {}", many("9")).as_bytes());
    let _ = try_read(MeshFormat::Off, many("#\n").as_bytes());
    let _ = try_read(MeshFormat::Stl, format!("solid {}", many("vertex 0 0 0 ")).as_bytes());
    let _ = try_read(MeshFormat::Stl, format!("solid\nfacet\n{}endfacet", many("vertex 0 0 0 ")).as_bytes());
    let _ = try_read(MeshFormat::Ply, format!("ply\n{}", many("element a 1\n")).as_bytes());
    let _ =
        try_read(MeshFormat::Ply, format!("ply\nformat ascii 1.0\n{}end_header\n", many("element a 9\n")).as_bytes());
}

/// Names of files that are not there cost a look each; in a real folder, for the look into it.
#[test]
fn hundreds_of_thousands_of_missing_files() {
    let folder = std::env::temp_dir().join(format!("trixel-missing-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let lines = |prefix: &str| -> String { (0..300_000).map(|i| format!("{prefix}{i}\n")).collect() };
    let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}{}f 1 2 3\n", lines("mtllib "), lines("usemtl "));
    let ply = format!(
        "ply\nformat ascii 1.0\n{}element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
         property list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        lines("comment TextureFile ")
    );
    for (name, text) in [("mesh.obj", obj), ("mesh.ply", ply)] {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        let start = Instant::now();
        let loaded = trixel_io::read::read_mesh(&path, &ReadOptions::default()).unwrap();
        assert!(start.elapsed() < Duration::from_secs(3), "{name} took {:?}", start.elapsed());
        assert!(loaded.warnings.len() < 20 && loaded.mesh.materials.len() <= 65_536);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// Concave, self-crossing and huge: the worst for ear clipping.
#[test]
fn a_polygon_of_a_hundred_thousand_random_corners() {
    let mut random = Random(3);
    let mut text = String::new();
    for _ in 0..100_000 {
        text += &format!("v {} {} 0\n", random.below(10_000), random.below(10_000));
    }
    text += "f";
    for vertex in 1..=100_000 {
        text += &format!(" {vertex}");
    }
    let loaded = try_read(MeshFormat::Obj, text.as_bytes()).unwrap();
    assert_eq!(loaded.mesh.triangles.len(), 99_998);
}

/// The same for a sane outline: a comb of many teeth is cut exactly.
#[test]
fn a_comb_of_ten_thousand_teeth_keeps_its_area() {
    let (mut text, mut face) = (String::new(), String::from("f"));
    let mut corners = Vec::new();
    for tooth in 0..10_000 {
        let x = f64::from(tooth);
        corners.extend([[x, 0.0], [x + 0.5, 0.0], [x + 0.5, 5.0], [x + 1.0, 5.0]]);
    }
    corners.extend([[10_000.0, 6.0], [0.0, 6.0]]);
    for (index, [x, y]) in corners.iter().enumerate() {
        text += &format!("v {x} {y} 0\n");
        face += &format!(" {}", index + 1);
    }
    let mesh = try_read(MeshFormat::Obj, (text + &face).as_bytes()).unwrap().mesh;
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            assert!(doubled >= 0.0, "no triangle is inside out");
            doubled / 2.0
        })
        .sum();
    assert!((area - (60_000.0 - 25_000.0)).abs() < 1e-6, "{area}");
}
