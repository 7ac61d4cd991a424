//! One mesh on one grid, as files that every tool reads.

use std::error::Error;
use std::fs;
use std::path::Path;

use serde_json::json;
use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mesh, Mode, Volume};
use trixel_io::read::{ReadOptions, read_mesh};

/// A mesh in units of voxels, from the corner of its grid on.
pub struct Case {
    pub vertices: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub grid: Grid,
    folder: std::path::PathBuf,
}

const STEPS: f64 = 65_536.0;

pub fn mode(name: &str) -> Result<Mode, Box<dyn Error>> {
    Mode::ALL.into_iter().find(|mode| mode.name() == name).ok_or_else(|| format!("no mode {name}").into())
}

/// The longest triangle that fits a grid, from corner to corner.
fn spanning_triangle() -> Mesh {
    Mesh::new(vec![[0.0, 0.0, 0.0], [1.0, 0.11, 0.93], [0.07, 1.0, 0.52]], vec![[0, 1, 2]])
}

pub fn prepare(mesh: &str, resolution: u32, folder: &Path) -> Result<(), Box<dyn Error>> {
    let mesh = match mesh.strip_prefix("scene:") {
        Some("spanning-triangle") => spanning_triangle(),
        Some(scene) => trixel::scene::build(scene)?,
        None => read_mesh(Path::new(mesh), &ReadOptions { attributes: false })?.mesh,
    };
    let grid = Grid::fit(&mesh.bounds().ok_or("an empty mesh")?, resolution)?;
    let lattice = LatticeMesh::snap(&mesh, &grid)?;
    // A lattice position is below 2^53 steps, so nothing rounds.
    let vertices: Vec<[f64; 3]> =
        (0..lattice.positions.len()).map(|i| lattice.positions.get(i as u32).map(|c| c as f64 / STEPS)).collect();
    let case = Case {
        vertices,
        triangles: mesh.triangles.clone(),
        grid: Grid::new([0.0; 3], [1.0; 3], grid.dims())?,
        folder: folder.to_owned(),
    };
    fs::create_dir_all(folder)?;
    case.write()
}

impl Case {
    pub fn mesh(&self) -> Mesh {
        Mesh::new(self.vertices.clone(), self.triangles.clone())
    }

    fn write(&self) -> Result<(), Box<dyn Error>> {
        let vertices: Vec<u8> = self.vertices.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let triangles: Vec<u8> = self.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let (v, t) = (self.vertices.len(), self.triangles.len());
        let mut ply = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {v}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {t}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        .into_bytes();
        ply.extend(&vertices);
        for triangle in triangles.as_chunks::<12>().0 {
            ply.push(3);
            ply.extend(triangle);
        }
        fs::write(self.folder.join("mesh.ply"), ply)?;
        fs::write(self.folder.join("vertices.f64"), vertices)?;
        fs::write(self.folder.join("triangles.u32"), triangles)?;
        let mesh = self.mesh();
        let mut counts = serde_json::Map::new();
        let mut words = 0;
        for mode in [Mode::Conservative, Mode::Solid] {
            let volume = trixel::voxelize(&mesh, &Job::new(self.grid, mode))?;
            words = volume.column_words();
            counts.insert(mode.name().to_owned(), volume.count().into());
            let bits: Vec<u8> = volume.words().iter().flat_map(|word| word.to_le_bytes()).collect();
            fs::write(self.folder.join(format!("{}.bits", mode.name())), bits)?;
        }
        let about = json!({
            "dims": self.grid.dims(), "triangles": t, "vertices": v, "column_bytes": 8 * words, "voxels": counts,
        });
        fs::write(self.folder.join("case.json"), about.to_string())?;
        Ok(())
    }

    pub fn read(folder: &Path) -> Result<Self, Box<dyn Error>> {
        let about: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("case.json"))?)?;
        let mut dims = [0; 3];
        for (axis, side) in dims.iter_mut().enumerate() {
            *side = about["dims"][axis].as_u64().and_then(|side| side.try_into().ok()).ok_or("case.json has no dims")?;
        }
        let vertices = fs::read(folder.join("vertices.f64"))?;
        let triangles = fs::read(folder.join("triangles.u32"))?;
        let vertices: Vec<f64> = vertices.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let triangles: Vec<u32> = triangles.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
        Ok(Self {
            vertices: vertices.as_chunks::<3>().0.to_vec(),
            triangles: triangles.as_chunks::<3>().0.to_vec(),
            grid: Grid::new([0.0; 3], [1.0; 3], dims)?,
            folder: folder.to_owned(),
        })
    }

    /// Voxels missing and extra.
    pub fn compare(&self, mode: &str, found: &Volume) -> Result<[u64; 2], Box<dyn Error>> {
        let exact = fs::read(self.folder.join(format!("{mode}.bits")))?;
        let mut wrong = [0; 2];
        for (exact, found) in exact.as_chunks::<8>().0.iter().zip(found.words()) {
            let exact = u64::from_le_bytes(*exact);
            wrong[0] += u64::from((exact & !found).count_ones());
            wrong[1] += u64::from((found & !exact).count_ones());
        }
        Ok(wrong)
    }
}
