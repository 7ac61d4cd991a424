//! How many voxels the fills of \[CL\] section 2.3 get wrong, against exact parity.

use trixel::fill::{Fill, fill};
use trixel::{Grid, Job, Mesh, Mode, Topology, Volume};

use crate::measure::MeasureError;
use crate::text::aligned;

/// The table.
#[derive(Clone, Debug, Default)]
pub struct Fills {
    rows: Vec<Row>,
}

/// One in so many triangles is left out to make holes.
const HOLES: usize = 50;

/// One way to fill one mesh on one grid.
#[derive(Clone, Debug)]
pub struct Row {
    /// The mesh.
    pub mesh: String,
    /// Its open edges.
    pub open_edges: usize,
    /// Voxels along the grid's longest side.
    pub resolution: u32,
    /// The fill, or `uncorrected`: what switching at each boundary voxel gives alone.
    pub fill: &'static str,
    /// Voxels inside: those of the whole mesh by parity.
    pub inside: u64,
    /// Boundary voxels.
    pub boundary: u64,
    /// Columns with an odd number of boundary voxels.
    pub questionable: u64,
    /// Boundary voxels on the other side of the surface than by parity: there its height in the voxel decides, which the
    /// fills do not know.
    pub wrong_on_boundary: u64,
    /// All other wrong voxels.
    pub wrong_elsewhere: u64,
}

impl Fills {
    /// Adds a mesh at a resolution, and the same with holes: one in fifty triangles left out.
    ///
    /// # Errors
    /// When the mesh is empty or broken, or memory is short.
    pub fn count(&mut self, name: &str, mesh: &Mesh, resolution: u32) -> Result<(), MeasureError> {
        let grid = Grid::fit(&mesh.bounds().ok_or(MeasureError::Empty)?, resolution)?;
        let inside = trixel::voxelize(mesh, &Job::new(grid, Mode::Solid))?;
        self.compare(name.to_owned(), mesh, resolution, &inside)?;
        let kept = mesh.triangles.iter().enumerate().filter(|(i, _)| i % HOLES != 0).map(|(_, triangle)| *triangle);
        let holed = Mesh::new(mesh.positions.clone(), kept.collect());
        self.compare(format!("{name} with holes"), &holed, resolution, &inside)
    }

    fn compare(&mut self, name: String, mesh: &Mesh, resolution: u32, inside: &Volume) -> Result<(), MeasureError> {
        let boundary = trixel::voxelize(mesh, &Job::new(*inside.grid(), Mode::Sliced))?;
        let parity = trixel::voxelize(mesh, &Job::new(*inside.grid(), Mode::Solid))?;
        let filled = |way| fill(&boundary, way).map_err(trixel::Error::from);
        let (uncorrected, report) = filled(Fill::Parity)?;
        let row = Row {
            mesh: name,
            open_edges: Topology::of(mesh).open_edges,
            resolution,
            fill: "",
            inside: inside.count(),
            boundary: boundary.count(),
            questionable: report.questionable,
            wrong_on_boundary: 0,
            wrong_elsewhere: 0,
        };
        let ways = [
            (Fill::Parity.name(), parity),
            ("uncorrected", uncorrected),
            (Fill::Xor.name(), filled(Fill::Xor)?.0),
            (Fill::March.name(), filled(Fill::March)?.0),
        ];
        self.rows.extend(ways.map(|(fill, found)| {
            let [wrong_on_boundary, wrong_elsewhere] = wrong(inside, &found, &boundary);
            Row { fill, wrong_on_boundary, wrong_elsewhere, ..row.clone() }
        }));
        Ok(())
    }

    /// The rows, four for each mesh and resolution.
    #[must_use]
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// As text.
    #[must_use]
    pub fn text(&self) -> String {
        let head = [
            "mesh",
            "open edges",
            "at",
            "fill",
            "inside",
            "boundary",
            "odd columns",
            "wrong on",
            "wrong off",
            "of inside",
        ];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        for row in &self.rows {
            #[expect(clippy::cast_precision_loss, reason = "a ratio for people")]
            let share = 100.0 * row.wrong_elsewhere as f64 / row.inside.max(1) as f64;
            lines.push(vec![
                row.mesh.clone(),
                row.open_edges.to_string(),
                row.resolution.to_string(),
                row.fill.to_owned(),
                row.inside.to_string(),
                row.boundary.to_string(),
                row.questionable.to_string(),
                row.wrong_on_boundary.to_string(),
                row.wrong_elsewhere.to_string(),
                format!("{share:.3} %"),
            ]);
        }
        format!(
            "Voxels that differ from exact parity of the whole mesh, on and off the boundary voxels (--mode sliced) that the \
             fills start from.\n`uncorrected` switches at these alone; in `with holes`, one in {HOLES} triangles is left \
             out.\n\n{}",
            aligned(&lines)
        )
    }
}

/// Wrong voxels on the boundary and off it.
fn wrong(solid: &Volume, filled: &Volume, boundary: &Volume) -> [u64; 2] {
    let words = solid.words().iter().zip(filled.words()).zip(boundary.words());
    words.fold([0; 2], |[on, off], ((solid, filled), boundary)| {
        let wrong = solid ^ filled;
        [on + u64::from((wrong & boundary).count_ones()), off + u64::from((wrong & !boundary).count_ones())]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_mostly_corrected() {
        let mut table = Fills::default();
        table.count("torus", &trixel::scene::build("torus").unwrap(), 45).unwrap();
        let [whole, .., parity, uncorrected, xor, march] = table.rows() else { panic!("eight rows") };
        assert_eq!((whole.fill, whole.wrong_on_boundary, whole.wrong_elsewhere), ("parity", 0, 0));
        assert!(parity.open_edges > 0 && parity.questionable > 0 && parity.wrong_elsewhere > 0);
        assert_eq!(uncorrected.wrong_elsewhere, parity.wrong_elsewhere);
        assert!(10 * xor.wrong_elsewhere < parity.wrong_elsewhere, "{xor:?} {parity:?}");
        assert!(2 * march.wrong_elsewhere < parity.wrong_elsewhere, "{march:?} {parity:?}");
        assert!(xor.wrong_on_boundary <= xor.boundary && table.text().lines().count() == 12, "{}", table.text());
    }
}
