//! The real binary in a fresh folder: what it writes, what it says, how it exits.

#![expect(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder to run in.
struct Bench(TempDir);

/// What a run said.
struct Ran {
    status: i32,
    stdout: String,
    stderr: String,
}

impl Bench {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn run(&self, arguments: &str) -> Ran {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trixel"));
        let Output { status, stdout, stderr } =
            command.args(arguments.split_whitespace()).current_dir(&self.0).output().unwrap();
        Ran {
            status: status.code().unwrap(),
            stdout: String::from_utf8(stdout).unwrap(),
            stderr: String::from_utf8(stderr).unwrap(),
        }
    }

    /// Runs what must succeed without a warning.
    fn ok(&self, arguments: &str) -> Ran {
        let ran = self.run(arguments);
        assert_eq!(ran.status, 0, "{arguments}: {}", ran.stderr);
        ran
    }

    /// Runs what must fail with `status` and say each of `words`, leaving the folder as it was.
    fn fails(&self, status: i32, arguments: &str, words: &[&str]) {
        let before = self.files();
        let ran = self.run(arguments);
        assert_eq!(ran.status, status, "{arguments}: {}{}", ran.stdout, ran.stderr);
        for word in words {
            assert!(ran.stderr.contains(word), "{arguments}: no `{word}` in {}", ran.stderr);
        }
        assert!(!ran.stderr.contains("panicked"), "{arguments}: {}", ran.stderr);
        assert_eq!(self.files(), before, "{arguments} left files behind");
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(self.path(name)).unwrap()).unwrap()
    }

    fn files(&self) -> Vec<String> {
        let mut names: Vec<_> = std::fs::read_dir(&self.0)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

const TETRAHEDRON: &str = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn the_main_job_writes_a_volume_a_picture_and_a_report() {
    let bench = Bench::new();
    let ran = bench.ok("voxelize scene:torus:64 --resolution 32 -o torus.npz -o torus.png --report report.json");
    assert_eq!(bench.files(), ["report.json", "torus.npz", "torus.png"]);
    assert!(ran.stdout.is_empty(), "{}", ran.stdout);
    assert!(std::fs::read(bench.path("torus.png")).unwrap().starts_with(b"\x89PNG"));
    let report = bench.json("report.json");
    assert_eq!(report["mode"], "conservative");
    assert_eq!(report["backend"], "cpu");
    assert_eq!(report["strategy"], "column-runs");
    assert!(report["adapter"].is_null());
    assert_eq!(report["mesh"]["triangles"], 64 * 64);
    assert_eq!(report["mesh"]["open_edges"], 0);
    assert_eq!(report["grid"]["dims"], serde_json::json!([32, 32, 10]));
    assert!(report["voxels"].as_u64().unwrap() > 1000);
    for stage in ["read", "snap", "allocate", "voxelize", "write", "total"] {
        assert!(report["stages_ms"][stage].is_number(), "{stage}");
    }
    assert!(report["warnings"].as_array().unwrap().is_empty());
}

#[test]
fn repeat_reports_every_sample() {
    let bench = Bench::new();
    bench.ok("voxelize scene:cube --report r.json --repeat 5 -q");
    assert_eq!(bench.json("r.json")["samples_ms"]["voxelize"].as_array().unwrap().len(), 5);
}

#[test]
fn every_format_is_written() {
    let bench = Bench::new();
    for extension in ["npz", "npy", "binvox", "vox", "vti", "nrrd", "obj", "ply", "stl", "glb", "raw", "png", "NPZ"] {
        bench.ok(&format!("voxelize scene:cube -r 8 -o out.{extension}"));
        assert!(bench.path(&format!("out.{extension}")).metadata().unwrap().len() > 0);
    }
    assert!(bench.path("out.json").exists());
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let bench = Bench::new();
    for mode in ["conservative", "thin", "solid", "sliced"] {
        for threads in [1, 2, 5] {
            bench.ok(&format!(
                "voxelize scene:room:16 -r 100 -m {mode} -t {threads} -q -o {threads}.npz -o {threads}.vti"
            ));
        }
        for extension in ["npz", "vti"] {
            let bytes = |threads: i32| std::fs::read(bench.path(&format!("{threads}.{extension}"))).unwrap();
            assert_eq!(bytes(1), bytes(2));
            assert_eq!(bytes(1), bytes(5));
        }
    }
}

#[test]
fn grids_are_made_in_every_way() {
    let bench = Bench::new();
    bench.write("t.obj", TETRAHEDRON);
    let dims = |arguments: &str| {
        bench.ok(&format!("voxelize {arguments} --report r.json"));
        let grid = bench.json("r.json")["grid"].clone();
        (grid["dims"].clone(), grid["voxel_size"].clone(), grid["origin"].clone())
    };
    let json = |value: serde_json::Value| value;
    use serde_json::json as j;
    assert_eq!(dims("t.obj -r 10"), (j!([10, 10, 10]), j!([0.4, 0.4, 0.4]), j!([0.0, 0.0, 0.0])));
    assert_eq!(dims("t.obj"), (j!([128, 128, 128]), j!([0.03125, 0.03125, 0.03125]), j!([0.0, 0.0, 0.0])));
    assert_eq!(dims("t.obj --voxel-size 0.5"), (j!([8, 8, 8]), j!([0.5, 0.5, 0.5]), j!([0.0, 0.0, 0.0])));
    // The input may stand where --voxel-size would take up to three numbers.
    assert_eq!(dims("--voxel-size 0.5 t.obj"), (j!([8, 8, 8]), j!([0.5, 0.5, 0.5]), j!([0.0, 0.0, 0.0])));
    assert_eq!(dims("--voxel-size 0.5 1 2 t.obj"), (j!([8, 4, 2]), j!([0.5, 1.0, 2.0]), j!([0.0, 0.0, 0.0])));
    assert_eq!(
        dims("t.obj --voxel-size 1 --origin -2 -1 0"),
        (j!([6, 5, 4]), j!([1.0, 1.0, 1.0]), j!([-2.0, -1.0, 0.0]))
    );
    // Scientific notation is a negative number too.
    assert_eq!(
        dims("t.obj --voxel-size 1 --dims 2 2 2 --origin -5e-1 -2.5E-1 0"),
        (j!([2, 2, 2]), j!([1.0, 1.0, 1.0]), j!([-0.5, -0.25, 0.0]))
    );
    assert_eq!(dims("t.obj --dims 8 16 4"), (j!([8, 16, 4]), j!([1.0, 1.0, 1.0]), j!([0.0, 0.0, 0.0])));
    assert_eq!(
        dims("t.obj --dims 3 4 5 --origin 0.5 0.5 0.5 --voxel-size 0.25"),
        (j!([3, 4, 5]), j!([0.25, 0.25, 0.25]), j!([0.5, 0.5, 0.5]))
    );
    for like in ["like.npz", "like.vti", "like.nrrd", "like.raw"] {
        bench.ok(&format!("voxelize t.obj --dims 3 4 5 --origin 0.5 0.5 0.5 --voxel-size 0.25 0.5 1 -o {like}"));
        let expected = json(j!([0.25, 0.5, 1.0]));
        assert_eq!(dims(&format!("t.obj --like {like}")), (j!([3, 4, 5]), expected, j!([0.5, 0.5, 0.5])), "{like}");
    }
}

#[test]
fn verify_finds_what_differs() {
    let bench = Bench::new();
    bench.ok("voxelize scene:sphere:8 -r 20 -o s.npz -o s.vti");
    for volume in ["s.npz", "s.vti"] {
        let ran = bench.ok(&format!("verify {volume} scene:sphere:8 --mode conservative"));
        assert!(ran.stdout.contains("0 missing, 0 extra: equal"), "{}", ran.stdout);
    }
    let ran = bench.run("verify s.npz scene:sphere:8 --mode thin --list 2");
    assert_eq!(ran.status, 1);
    assert_eq!(ran.stdout.lines().filter(|line| line.starts_with("extra voxel [")).count(), 2, "{}", ran.stdout);
    assert!(ran.stdout.contains("more extra"));
    bench.ok("voxelize scene:sphere:8 --like s.npz --mode solid -o solid.npz --sparse");
    bench.ok("verify solid.npz scene:sphere:8 --mode solid");
    let ran = bench.run("verify solid.npz scene:sphere:8");
    assert!(ran.stdout.contains("missing voxel ["), "{}", ran.stdout);
}

#[test]
fn info_describes_meshes_and_volumes() {
    let bench = Bench::new();
    bench.write("t.obj", TETRAHEDRON);
    let ran = bench.ok("info t.obj");
    assert!(ran.stdout.contains("closed") && ran.stdout.contains("triangles            4"), "{}", ran.stdout);
    let info: serde_json::Value = serde_json::from_str(&bench.ok("info t.obj --json").stdout).unwrap();
    assert_eq!((&info["edges"], &info["open_edges"], &info["closed"]), (&6.into(), &0.into(), &true.into()));
    bench.ok("voxelize t.obj -r 4 -o t.npz");
    let info: serde_json::Value = serde_json::from_str(&bench.ok("info t.npz --json").stdout).unwrap();
    assert_eq!(info["grid"]["dims"], serde_json::json!([4, 4, 4]));
    assert!(bench.ok("info t.npz").stdout.contains("set voxels"));
    assert!(bench.ok("info scene:city:3").stdout.contains("components           9"));
}

#[test]
fn wrong_usage_exits_with_2() {
    let bench = Bench::new();
    for (arguments, words) in [
        ("voxelize", &["INPUT"][..]),
        ("voxelize scene:cube", &["-o", "--report"]),
        ("voxelize scene:cube -o a.npz --resolution 0", &["0"]),
        ("voxelize scene:cube -o a.npz --resolution 40000", &["32768"]),
        ("voxelize scene:cube -o a.npz --resolution 8 --voxel-size 1", &["cannot be used with"]),
        ("voxelize scene:cube -o a.npz --like b.npz --dims 1 1 1", &["cannot be used with"]),
        ("voxelize scene:cube -o a.npz --voxel-size -1", &["-1", "positive"]),
        ("voxelize scene:cube -o a.npz --voxel-size nan", &["nan", "positive"]),
        ("voxelize scene:cube -o a.npz --voxel-size 1 2", &["HX HY HZ"]),
        ("voxelize scene:cube -o a.npz --origin 0 0 0", &["--voxel-size", "--dims"]),
        ("voxelize scene:cube -o a.npz --voxel-size 1 --origin inf 0 0", &["finite"]),
        ("voxelize scene:cube -o a.npz --mode sold", &["solid"]),
        ("voxelize scene:cube -o a.npz --overlap 1", &["sliced"]),
        ("voxelize scene:cube -o a.npz --mode sliced --overlap -1", &["0 to 1024"]),
        ("voxelize scene:cube -o a.npz --threads 0", &["0"]),
        ("voxelize scene:cube -o a.npz --repeat 0", &["0"]),
        ("voxelize scene:cube -o a.npz -o a.npz", &["twice"]),
        ("voxelize scene:cube -o a.npz -o ./a.npz", &["twice"]),
        ("voxelize scene:cube -o a.raw --report a.json", &["a.json", "twice"]),
        ("voxelise scene:cube", &["voxelize"]),
        ("verify a.npz", &["MESH"]),
    ] {
        bench.fails(2, arguments, words);
    }
}

#[test]
fn failures_exit_with_1_and_say_what_to_do() {
    let bench = Bench::new();
    bench.write("t.obj", TETRAHEDRON);
    bench.write("nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("far.obj", "v 0 0 0\nv 1 1e30 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("point.obj", "v 1 1 1\nf 1 1 1\n");
    bench.write("points.obj", "v 1 1 1\nv 2 2 2\n");
    bench.write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    bench.write("vast.obj", "v -1e308 0 0\nv 1e308 0 0\nv 0 1e308 0\nf 1 2 3\n");
    bench.write("denormal.obj", "v 0 0 0\nv 1e-320 0 0\nv 0 1e-320 0\nf 1 2 3\n");
    bench.write("what.xyz", "1 2 3\n");
    bench.write("broken.npz", "PK");
    std::fs::create_dir(bench.path("folder.png")).unwrap();
    for (arguments, words) in [
        ("voxelize none.obj -o a.npz", &["none.obj", "No such file"][..]),
        ("voxelize what.xyz -o a.npz", &["what.xyz", ".obj"]),
        ("voxelize scene:tours -o a.npz", &["tours", "torus"]),
        ("voxelize scene:torus:0 -o a.npz", &["torus", "6"]),
        ("voxelize nan.obj -o a.npz", &["nan.obj", "vertex 1"]),
        ("voxelize far.obj -o a.npz --voxel-size 1", &["voxels"]),
        ("voxelize far.obj -o a.npz --voxel-size 1 --dims 4 4 4", &["far.obj", "vertex 1", "16,777,216"]),
        ("voxelize vast.obj -o a.npz", &["inf", "scale the mesh"]),
        ("voxelize vast.obj -o a.npz --voxel-size 1e306", &["32768"]),
        ("voxelize denormal.obj -o a.npz", &["e-320", "scale the mesh"]),
        ("voxelize point.obj -o a.npz", &["single point", "voxel size"]),
        ("voxelize points.obj -o a.npz", &["points.obj", "no triangle"]),
        ("voxelize index.obj -o a.npz", &["index.obj", "9"]),
        ("voxelize t.obj -o a.xyz", &["a.xyz", ".npz", ".png"]),
        ("voxelize t.obj -o a", &["a", ".npz"]),
        ("voxelize t.obj -o a.npz -o none/b.npz", &["none"]),
        ("voxelize t.obj -o a.npz -o none/b.png", &["none"]),
        ("voxelize t.obj -o a.npz --report none/r.json", &["none"]),
        ("voxelize t.obj -o a.npz -o none/b.png", &["no folder none; create it"]),
        ("voxelize t.obj -o a.npz --report none/r.json", &["no folder none; create it"]),
        ("voxelize t.obj -o a.npz -o folder.png", &["folder.png", "names a folder"]),
        ("voxelize t.obj -o a.npz --report folder.png", &["folder.png", "names a folder"]),
        ("voxelize t.obj -o a.npz -o b.npz/", &["b.npz/", "folder"]),
        ("voxelize t.obj -o t.obj", &["t.obj", "input"]),
        ("voxelize t.obj -o a.npz -o a.vox -r 3000", &["a.vox", "2000"]),
        ("voxelize t.obj -o a.binvox --voxel-size 1 2 3", &["a.binvox"]),
        ("voxelize t.obj -o a.vti --dims 32768 32768 32768", &["4.0 TiB", "available", "resolution"]),
        ("voxelize t.obj -o a.npz --voxel-size 1e-9", &["32768"]),
        ("voxelize t.obj -o a.npz --like none.npz", &["none.npz"]),
        ("voxelize t.obj -o a.npz --like broken.npz", &["broken.npz"]),
        ("voxelize t.obj -o a.npz --like t.obj", &["t.obj"]),
        ("info none.obj", &["none.obj"]),
        ("info broken.npz", &["broken.npz"]),
        ("verify broken.npz t.obj", &["broken.npz"]),
    ] {
        bench.fails(1, arguments, words);
    }
}

#[test]
fn a_failed_run_leaves_earlier_outputs_alone() {
    let bench = Bench::new();
    bench.write("a.npz", "mine");
    bench.fails(1, "voxelize scene:cube -r 3000 -o a.npz -o b.vox", &[]);
    assert_eq!(std::fs::read(bench.path("a.npz")).unwrap(), b"mine");
    bench.ok("voxelize scene:cube -r 8 -o a.npz");
    assert!(std::fs::read(bench.path("a.npz")).unwrap().starts_with(b"PK"));
}

#[test]
fn warnings_are_printed_and_reported() {
    let bench = Bench::new();
    bench.write("open.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nf 1 3 2\nf 1 2 4\nf 1 4 3\n");
    let ran = bench.ok("voxelize open.obj -r 8 --mode solid --report r.json");
    assert!(ran.stderr.contains("warning: the mesh is not closed: 3 open and 0 non-manifold edges"), "{}", ran.stderr);
    assert_eq!(bench.json("r.json")["warnings"].as_array().unwrap().len(), 1);
    let ran = bench.ok("voxelize open.obj -r 8 --mode solid --quiet -o a.npz");
    assert!(ran.stderr.is_empty(), "{}", ran.stderr);
    let ran = bench.ok("voxelize open.obj --dims 4 4 4 --origin 9 9 9 --voxel-size 1 -o a.npz");
    assert!(ran.stderr.contains("no voxel is set"), "{}", ran.stderr);
}

#[test]
fn help_and_completions_are_there() {
    let bench = Bench::new();
    let help = bench.ok("voxelize --help").stdout;
    for word in ["--resolution", "--mode", "26-separating", "scene:torus", "hairball", "Exit status", ".binvox"] {
        assert!(help.contains(word), "no `{word}` in the help");
    }
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(bench.ok(&format!("completions {shell}")).stdout.contains("trixel"));
    }
    assert!(bench.ok("--version").stdout.contains(env!("CARGO_PKG_VERSION")));
    assert!(Path::new(env!("CARGO_BIN_EXE_trixel")).exists());
}

/// On a software GPU, which `scripts/test` installs.
#[test]
fn a_gpu_gives_the_same_bytes_and_reports_itself() {
    let bench = Bench::new();
    bench.ok("voxelize scene:room --resolution 60 --backend cpu -o cpu.npz");
    for strategy in
        ["triangle-parallel", "fragment-parallel", "hybrid", "hybrid-two-pass", "balanced", "case-sorted", "tiled"]
    {
        let arguments = format!("--adapter llvmpipe --strategy {strategy} --counters --cutoff 30");
        bench.ok(&format!("voxelize scene:room --resolution 60 {arguments} -o gpu.npz --report r.json"));
        assert_eq!(std::fs::read(bench.path("cpu.npz")).unwrap(), std::fs::read(bench.path("gpu.npz")).unwrap());
        let report = bench.json("r.json");
        assert_eq!(report["backend"], "gpu");
        assert_eq!(report["strategy"], strategy);
        assert_eq!(report["adapter"]["software"], true);
        assert_eq!(report["counters"]["voxels_written"], report["voxels"]);
        for stage in ["upload", "voxelize", "download"] {
            assert!(report["stages_ms"][stage].is_number(), "{stage}");
        }
    }
    bench.ok("verify gpu.npz scene:room --adapter llvmpipe");
    assert!(bench.ok("info --adapters").stdout.contains("llvmpipe"));
    let curve = bench.ok("tune scene:room --resolution 20 --adapter llvmpipe --repeat 1 --dry-run").stdout;
    assert!(curve.contains("best") && curve.contains("fragment-parallel"), "{curve}");
}

#[test]
fn a_gpu_finds_the_same_attributes_and_lists_by_every_method() {
    let bench = Bench::new();
    square(&bench);
    let arguments = "--resolution 40 --attributes color,normal,triangle,barycentric --sparse";
    bench.ok(&format!("voxelize square.obj {arguments} --backend cpu -o cpu.npz"));
    for method in ["scan", "histopyramid", "atomic", "fragment-list"] {
        let gpu = format!("--adapter llvmpipe --list-method {method} --report r.json");
        let said = bench.ok(&format!("voxelize square.obj {arguments} {gpu} -o gpu.npz")).stderr;
        assert!(said.contains(&format!("{method}: ")) && !said.contains("instead"), "{said}");
        assert_eq!(std::fs::read(bench.path("cpu.npz")).unwrap(), std::fs::read(bench.path("gpu.npz")).unwrap());
        let report = bench.json("r.json");
        assert_eq!((&report["list"]["method"], &report["list"]["entries"]), (&method.into(), &report["voxels"]));
        assert!(report["list"]["ms"].as_f64() > Some(0.0) && report["list"]["scratch_bytes"].is_u64());
        assert!(report["stages_ms"]["attributes"].is_number());
    }
    // Longer than the shaders take: the processor does it, and says so.
    bench.write("long.obj", "v -9000 0 1.5\nv 9000 0 1.5\nv 0 9000 1.5\nf 1 2 3\n");
    let grid = "--dims 4 4 4 --origin 0 0 0 --voxel-size 1 --attributes triangle";
    let said = bench.ok(&format!("voxelize long.obj {grid} --adapter llvmpipe -o long.npz")).stderr;
    assert!(said.contains("the processor finds the attributes instead"), "{said}");
}

#[test]
fn contradicting_gpu_arguments_are_refused() {
    let bench = Bench::new();
    for (status, arguments, words) in [
        (2, "voxelize scene:torus -o t.npz --backend cpu --strategy hybrid", ["hybrid", "--backend gpu"]),
        (2, "voxelize scene:torus -o t.npz --backend cpu --adapter x", ["--adapter", "--backend cpu"]),
        (2, "voxelize scene:torus -o t.npz --backend gpu --strategy column-runs", ["column-runs", "--backend cpu"]),
        (2, "voxelize scene:torus -o t.npz --list-method scan", ["--list-method", "--backend gpu"]),
        (
            1,
            "voxelize scene:torus -o t.npz -m solid --adapter llvmpipe --list-method fragment-list",
            ["solid", "atomic"],
        ),
        (2, "voxelize scene:torus -o t.npz --backend gpu --cutoff -1", ["cutoff", "0 or more"]),
        (1, "voxelize scene:torus -o t.npz --adapter no-such-gpu", ["no-such-gpu", "there are"]),
    ] {
        bench.fails(status, arguments, &words);
    }
}

#[test]
fn light_is_rendered_and_compared_and_filmed() {
    let bench = Bench::new();
    let small = "--size 24x18 -r 16 --samples 1";
    bench.ok(&format!("render scene:torus:24 --effect refraction --reference {small} -o traced.png"));
    let said = bench.ok(&format!(
        "render scene:torus:24 --effect refraction --adapter llvmpipe {small} -o lit.png --compare traced.png"
    ));
    let decibels: f64 = said.stderr.split("traced.png: ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(decibels > 15.0, "{}", said.stderr);

    let film = format!("animate scene:glass-ball:4 --frames 3 --seconds 0.5 --adapter llvmpipe {small}");
    bench.ok(&format!("{film} -o film.gif --report r.json"));
    assert!(std::fs::read(bench.path("film.gif")).unwrap().starts_with(b"GIF89a"));
    let report = bench.json("r.json");
    assert_eq!((report["frames_ms"].as_array().unwrap().len(), &report["seconds"]), (3, &0.5.into()));
    bench.ok(&format!("{film} -o frames/"));
    bench.ok(&format!("{film} -o film.apng"));
    assert_eq!(std::fs::read_dir(bench.path("frames")).unwrap().count(), 3);

    let table = bench.ok("bench --table effects scene:cube -r 8 --repeat 1 --adapter llvmpipe").stdout;
    assert_eq!((table.lines().count(), table.matches("cube ").count()), (7, 4), "{table}");

    for (status, arguments, words) in [
        (1, "render scene:torus -o a.jpg", ["a.jpg", ".png"]),
        (1, "render scene:glass-ball --material wood=1.5 -o a.png", ["wood", "`amber`"]),
        (2, "render scene:torus --material 0 -o a.png", ["refraction index", "0.1"]),
        (1, "render scene:torus --environment none.hdr -o a.png", ["none.hdr", "sky, white, black"]),
        (1, "animate scene:torus -o a.mp4", ["a.mp4", ".gif"]),
        (1, "animate scene:torus --animation run -o b/", ["run", "no animation"]),
        (2, "animate scene:torus --seconds 0 -o a.gif", ["0.02", "600"]),
        (1, "animate scene:torus --adapter no-such-gpu -o c/", ["no-such-gpu", "there are"]),
    ] {
        bench.fails(status, arguments, &words);
    }
}

/// A square of two materials, one with a texture that is not there.
fn square(bench: &Bench) {
    bench.write(
        "square.obj",
        "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nusemtl red\nf 1/1 2/1 3/1\nusemtl blue\nf 1 3 4\n",
    );
    bench.write("square.mtl", "newmtl red\nKd 1 0 0\nmap_Kd broken.png\nnewmtl blue\nKd 0 0 1\n");
    bench.write("broken.png", "not a picture");
}

#[test]
fn attributes_are_written_and_reported() {
    let bench = Bench::new();
    square(&bench);
    let arguments =
        "voxelize square.obj -r 8 --attributes color,normal,material --combine nearest --sparse --report r.json";
    let ran = bench.ok(&format!("{arguments} -o a.npz -o a.vox -o a.png -o a.vti -o a.ply -o a.glb -o a.obj"));
    assert!(ran.stderr.contains("broken.png") && ran.stderr.contains("left out"), "{}", ran.stderr);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("r.json")).unwrap()).unwrap();
    assert_eq!(report["attributes"]["names"], serde_json::json!(["color", "normal", "material"]));
    assert_eq!(report["attributes"]["combine"], "nearest");
    assert_eq!(report["attributes"]["covered"], report["voxels"]);
    for stage in ["textures", "rank", "attributes"] {
        assert!(report["stages_ms"][stage].is_f64(), "{stage}");
    }
    // Red, blue: the palette has just these two.
    let vox = std::fs::read(bench.path("a.vox")).unwrap();
    let at = vox.windows(4).position(|window| window == b"RGBA").unwrap() + 12;
    let mut palette: Vec<_> = vox[at..at + 12].chunks(4).collect();
    palette.sort_unstable();
    assert_eq!(palette, [[0, 0, 0, 255], [0, 0, 255, 255], [255, 0, 0, 255]]);
    // Threads do not matter.
    bench.ok(&format!("{arguments} -o b.npz -t 1"));
    bench.ok(&format!("{arguments} -o c.npz -t 5"));
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    assert!(read("a.npz") == read("b.npz") && read("b.npz") == read("c.npz"));
}

#[test]
fn priorities_name_materials() {
    let bench = Bench::new();
    square(&bench);
    let arguments = "voxelize square.obj -r 8 --attributes material --sparse";
    bench.ok(&format!("{arguments} --priority blue -o blue.npz"));
    bench.ok(&format!("{arguments} --priority red,blue -o red.npz"));
    bench.ok(&format!("{arguments} -o none.npz"));
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    assert!(read("blue.npz") != read("red.npz"));
    bench.fails(1, &format!("{arguments} --priority green -o green.npz"), &["green", "red, blue"]);
    bench.fails(2, "voxelize square.obj -r 8 --combine first -o a.npz", &["--attributes"]);
    bench.fails(2, "voxelize square.obj -r 8 --attributes colour -o a.npz", &["colour", "color"]);
}

#[test]
fn several_inputs_share_one_grid_and_keep_their_names() {
    let bench = Bench::new();
    square(&bench);
    // Through the square, and beyond.
    bench.write("wall.obj", "v 0.3 0.3 -0.5\nv 0.7 0.4 0.5\nv 0.5 0.9 0.5\nf 1 2 3\n");
    let both = "voxelize wall.obj square.obj -r 8 --attributes material --sparse";
    bench.ok(&format!("{both} -o both.npz --report r.json"));
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("r.json")).unwrap()).unwrap();
    assert_eq!(report["attributes"]["material_names"], serde_json::json!(["wall", "square/red", "square/blue"]));
    // The union of both, each alone on the same grid.
    let counts = ["wall.obj square.obj", "wall.obj", "square.obj"].map(|inputs| {
        bench.ok(&format!("voxelize {inputs} --like both.npz -o one.npz"));
        trixel_io::volume_read::read_volume(&bench.path("one.npz"), None).unwrap().volume
    });
    let [all, wall, flat] = counts;
    assert!(all.words().iter().zip(wall.words().iter().zip(flat.words())).all(|(all, (a, b))| *all == a | b));
    assert!(all != wall && all != flat);
    // An input's name stands for all of its materials.
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    bench.ok(&format!("{both} --priority square,wall -o square.npz"));
    bench.ok(&format!("{both} --priority square/blue,square/red,wall -o blue.npz"));
    bench.ok(&format!("{both} --priority wall -o wall.npz"));
    assert!(read("square.npz") != read("wall.npz") && read("square.npz") != read("blue.npz"));
    bench.fails(1, &format!("{both} --priority squ -o green.npz"), &["squ", "wall, square/red"]);
    // Swallowed by --voxel-size, and given back.
    bench.ok("voxelize --voxel-size 0.25 wall.obj square.obj -o swallowed.npz");
    bench.fails(2, "voxelize wall.obj --voxel-size 0.25 square.obj -o a.npz", &["inputs go before"]);
    bench.fails(1, "voxelize wall.obj nothing.obj -o a.npz", &["nothing.obj"]);
    bench.fails(1, "voxelize wall.obj square.obj -o square.obj", &["is an input"]);
}

#[test]
fn attributes_that_no_output_holds_are_told_of() {
    let bench = Bench::new();
    let warned = bench.ok("voxelize scene:cube -r 4 --attributes color,normal -o a.vox");
    assert!(warned.stderr.contains("no output holds normal:"), "{}", warned.stderr);
    let silent = bench.ok("voxelize scene:cube -r 4 --attributes color,normal -o a.vox -o a.vti");
    assert!(!silent.stderr.contains("no output holds"), "{}", silent.stderr);
}

#[test]
fn sparse_outputs_take_grids_far_beyond_the_memory() {
    let bench = Bench::new();
    // Dense, 4 TiB.
    let huge = "voxelize scene:sphere:8 --dims 32768 32768 32768 --voxel-size 0.05 --origin -2 -3 -4";
    bench.ok(&format!("{huge} -o huge.npz -o huge.ply --report huge.json"));
    bench.ok("voxelize scene:sphere:8 --dims 70 90 110 --voxel-size 0.05 --origin -2 -3 -4 -o small.ply --sparse");
    let centres = |name: &str| {
        let bytes = std::fs::read(bench.path(name)).unwrap();
        let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        bytes[end..].to_vec()
    };
    assert!(!centres("small.ply").is_empty());
    assert!(centres("huge.ply") == centres("small.ply"));
    bench.fails(1, &format!("{huge} -o huge.npz -o huge.vti"), &["huge.vti takes a dense grid", "4.0 TiB"]);
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(bench.path("huge.json")).unwrap()).unwrap();
    assert_eq!(report["voxels"].as_u64().unwrap() * 24, centres("huge.ply").len() as u64);
}

/// Every file of a folder, by its path in it.
fn files_of(folder: &Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(current) = folders.pop() {
        for entry in std::fs::read_dir(current).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn a_killed_run_is_resumed_and_gives_the_identical_result() {
    let bench = Bench::new();
    // A file to be read in passes, from the faces of voxels.
    bench.ok("voxelize scene:torus:64 -r 400 --mode solid -o mesh.stl");
    let arguments =
        |name: &str| format!("voxelize mesh.stl -r 1500 -m solid -o {name} --memory-limit 120MiB --threads 2");
    let whole = bench.ok(&arguments("whole.zarr"));
    assert!(whole.stderr.contains("plan: ") && whole.stderr.contains(" to read"), "{}", whole.stderr);

    let mut kills = 0;
    for round in 0..5 {
        let resume = if bench.path("killed.zarr.partial").exists() { " --resume" } else { "" };
        let mut child = Command::new(env!("CARGO_BIN_EXE_trixel"))
            .args((arguments("killed.zarr") + resume).split_whitespace())
            .current_dir(&bench.0)
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        // Some more tiles each time, and then at whatever it is doing.
        let journal = bench.path("killed.zarr.partial").join("trixel-journal");
        let tiles = || std::fs::read_to_string(&journal).map_or(0, |text| text.lines().count());
        let goal = tiles() + 3 + 2 * round;
        while tiles() < goal && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        kills += u32::from(child.kill().is_ok() && !bench.path("killed.zarr").exists());
        child.wait().unwrap();
    }
    assert!(kills >= 2, "it was too fast to be killed");
    if !bench.path("killed.zarr").exists() {
        bench.ok(&(arguments("killed.zarr") + " --resume --report killed.json"));
        let report: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(bench.path("killed.json")).unwrap()).unwrap();
        assert!(report["resumed_tiles"].as_u64().unwrap() > 5, "{report}");
    }
    assert!(!bench.path("killed.zarr.partial").exists());
    assert!(files_of(&bench.path("killed.zarr")) == files_of(&bench.path("whole.zarr")));
}

#[test]
fn slices_by_both_strategies() {
    let bench = Bench::new();
    bench.ok("voxelize scene:torus:24 -r 30 --mode sliced --overlap 0.25 -q -o cpu.npz");
    for strategy in ["sliced", "slice-per-pass"] {
        let asked = format!("--mode sliced --overlap 0.25 --strategy {strategy} --adapter llvmpipe");
        bench.ok(&format!("voxelize scene:torus:24 -r 30 {asked} -q -o gpu.npz --report r.json"));
        bench.ok("verify gpu.npz scene:torus:24 --mode sliced --overlap 0.25");
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("r.json")).unwrap()).unwrap();
        assert_eq!((&report["strategy"], &report["fill"]), (&strategy.into(), &serde_json::Value::Null));
    }
    let refused = "voxelize scene:cube -o a.npz --strategy sliced";
    bench.fails(2, refused, &["--strategy sliced", "--mode sliced", "conservative"]);
}

#[test]
fn solids_are_filled_in_three_ways() {
    let bench = Bench::new();
    for fill in ["parity", "xor", "march"] {
        let arguments = format!("scene:torus:24 -r 40 --mode solid --fill {fill} -q");
        bench.ok(&format!("voxelize {arguments} -o cpu-{fill}.npz --report r.json"));
        bench.ok(&format!("voxelize {arguments} --adapter llvmpipe -o gpu-{fill}.npz"));
        let verify = format!("verify gpu-{fill}.npz scene:torus:24 --mode solid");
        bench.ok(&format!("{verify} --fill {fill}"));
        // Against the exact solid only one is right.
        let ran = bench.run(&format!("{verify} --list 1"));
        assert_eq!(ran.stdout.contains(": equal"), fill == "parity", "{}", ran.stdout);
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("r.json")).unwrap()).unwrap();
        assert_eq!(report["fill"]["name"], fill);
        assert_eq!(report["fill"]["uncorrected_columns"].is_null(), fill == "parity");
    }
    bench.fails(2, "voxelize scene:cube -o a.npz --fill xor", &["--fill", "--mode solid"]);
    bench.fails(2, "voxelize scene:cube -o a.zarr --mode solid --fill xor", &["--fill", ".zarr"]);
    bench.ok("voxelize scene:cube -r 20 -o sparse.npz --sparse --mode solid --fill march");
}

#[test]
fn bench_compares_slicing_and_fills() {
    let bench = Bench::new();
    let ran = bench.ok("bench --table cl scene:torus:12 -r 16 --adapter llvmpipe --repeat 1 --html r.html");
    for said in ["mode sliced", "slice-per-pass  ratio", "HD5850", "1282", "53.8"] {
        assert!(ran.stdout.contains(said), "no {said} in {}", ran.stdout);
    }
    assert!(std::fs::read_to_string(bench.path("r.html")).unwrap().contains("HD5850"));
    let ran = bench.ok("bench --table fills scene:torus -r 20,45");
    assert_eq!(ran.stdout.lines().filter(|line| line.starts_with("torus")).count(), 16, "{}", ran.stdout);
    bench.fails(2, "bench --table fills --json r.json", &["--table fills", "--json"]);
    bench.fails(2, "bench scene:cube --strategy sliced", &["sliced", "conservative"]);
}

#[test]
fn out_of_core_says_what_is_wrong() {
    let bench = Bench::new();
    bench.fails(2, "voxelize scene:cube -o a.npz --memory-limit 1GiB", &["--memory-limit", ".zarr"]);
    bench.fails(2, "voxelize scene:cube -o a.zarr -o a.npz", &[".zarr", "only"]);
    bench.fails(2, "voxelize scene:cube -o a.zarr --memory-limit 3potatoes", &["2GiB or 500MB"]);
    bench.fails(1, "voxelize scene:cube -o a.zarr --memory-limit 10MiB", &["10.0 MiB is too small"]);
    bench.fails(1, "voxelize scene:cube -o a.zarr --resume", &["a.zarr.partial", "without --resume"]);
    bench.fails(1, "voxelize scene:cube -o none/a.zarr", &["no folder none"]);
    bench.ok("voxelize scene:cube -r 20 -o a.zarr --memory-limit 1GiB");
    bench.fails(1, "voxelize scene:cube -r 20 -o a.zarr", &["a.zarr exists already"]);
}

#[test]
fn bench_measures_every_strategy_and_counts_wrong_voxels() {
    let bench = Bench::new();
    let arguments = "bench scene:room:8 scene:triangle -r 12,20 --adapter llvmpipe --repeat 2 --cutoff 9";
    let ran = bench.ok(&format!("{arguments} --table hcv --figure 3.14 --counters --json r.json --html r.html"));
    for said in [
        "SOFTWARE adapter",
        "llvmpipe",
        "mode thin",
        "GeForce GTX 480",
        "hybrid-two-pass",
        "discarded",
        "lane use",
        "tiled",
    ] {
        assert!(ran.stdout.contains(said), "no {said} in {}", ran.stdout);
    }
    let results: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("r.json")).unwrap()).unwrap();
    let cells = results["cells"].as_array().unwrap();
    // The CPU's strategy and seven of the GPU's, on two meshes at two resolutions.
    assert_eq!(cells.len(), 8 * 2 * 2);
    assert!(cells.iter().all(|cell| cell["wrong_voxels"] == 0 && cell["voxels"].as_u64() > Some(0)));
    assert!(cells.iter().all(|cell| cell["min_ms"].as_f64() <= cell["median_ms"].as_f64()));
    assert_eq!(results["sweeps"].as_array().unwrap().len(), 2);
    let page = std::fs::read_to_string(bench.path("r.html")).unwrap();
    assert!(page.matches("<svg").count() >= 7, "{}", page.matches("<svg").count());
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());

    let compared = bench.ok(&format!("{arguments} --mode thin --compare r.json"));
    assert!(compared.stdout.contains("room at 20, gpu hybrid: "), "{}", compared.stdout);
    let lists =
        bench.ok("bench --lists scene:room:8 -r 20 --adapter llvmpipe --repeat 1 --json l.json --html l.html").stdout;
    for said in ["scan", "histopyramid", "atomic", "fragment-list", "memory"] {
        assert!(lists.contains(said), "no {said} in {lists}");
    }
    let results: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("l.json")).unwrap()).unwrap();
    let cells = results["lists"].as_array().unwrap();
    assert_eq!(cells.len(), 4);
    assert!(cells.iter().all(|cell| cell["wrong_entries"] == 0 && cell["voxels"] == cells[0]["voxels"]));
    assert!(std::fs::read_to_string(bench.path("l.html")).unwrap().contains("<h2>Voxel lists</h2>"));
    bench.fails(2, "bench --lists --counters scene:cube", &["--lists", "--counters"]);
    bench.ok("bench scene:cube -r 8 --backend cpu --repeat 1");
    bench.fails(1, "bench scene:cube -r 8 --compare r.html", &["r.html", "bench --json"]);
    bench.fails(1, "bench --models nowhere", &["models.json", "Stanford Bunny"]);
    bench.fails(2, "bench scene:cube scene:cube", &["two inputs are called cube"]);
    bench.fails(2, "bench --strategy column-runs", &["column-runs", "--backend cpu"]);
}
