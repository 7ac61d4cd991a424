//! Results as plain text, for a terminal.

use std::fmt::Write;

use trixel_gpu::Counters;

use crate::published::{CL, CL_HARDWARE, CL_RESOLUTIONS, HCV, HCV_HARDWARE};
use crate::results::{self, Results};

/// Rows of cells under a head, each column as wide as it must be; the first is left-aligned.
#[must_use]
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            // Writing to a string cannot fail.
            let _ = if column == 0 { write!(line, "{cell:<width$}") } else { write!(line, "  {cell:>width$}") };
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}

/// Milliseconds, three digits.
pub(crate) fn ms(value: f64) -> String {
    match value {
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v if v >= 0.0995 => format!("{v:.2}"),
        v => format!("{v:.4}"),
    }
}

/// A table in the manner of \[HCV\] table 4.1, with the paper's rows under it.
#[must_use]
pub fn table(results: &Results) -> String {
    let columns = results.columns();
    let mut head = vec!["mesh".to_owned(), "triangles".to_owned(), "at".to_owned()];
    head.extend(columns.iter().map(|(_, strategy)| (*strategy).to_owned()));
    let compared = columns.contains(&results::SLICED) && columns.contains(&results::SLICE_PER_PASS);
    head.extend(compared.then(|| "ratio".to_owned()));
    head.extend(["@voxels^2".to_owned(), "wrong".to_owned()]);
    let mut rows = vec![head];
    for mesh in results.meshes() {
        for resolution in results.resolutions(mesh) {
            let cells: Vec<_> = columns.iter().map(|column| results.cell(mesh, resolution, *column)).collect();
            let some = || cells.iter().flatten();
            let triangles = some().next().map_or(0, |cell| cell.triangles);
            let mut row = vec![mesh.to_owned(), triangles.to_string(), resolution.to_string()];
            row.extend(cells.iter().map(|cell| cell.map_or(String::new(), |cell| ms(cell.median_ms))));
            if compared {
                row.push(results.slicing_ratio(mesh, resolution).map_or(String::new(), |ratio| format!("{ratio:.1}")));
            }
            row.push(some().find_map(|cell| cell.cutoff).map_or(String::new(), |cutoff| format!("{cutoff:.1}")));
            row.push(some().map(|cell| cell.wrong_voxels).sum::<u64>().to_string());
            rows.push(row);
        }
    }
    let lists = results.lists.iter().map(|cell| cell.runs);
    let runs = results.cells.iter().map(|cell| cell.runs).chain(lists).max().unwrap_or(0);
    let table = if results.cells.is_empty() { String::new() } else { format!("\n{}", aligned(&rows)) };
    format!(
        "{}\n{}, {} threads; mode {}; medians of {runs} runs in ms, without upload and download\n{table}",
        results.adapter_line(),
        results.machine.cpu,
        results.machine.threads,
        results.mode,
    )
}

/// The paper's own table.
#[must_use]
pub fn published() -> String {
    let head = [
        "mesh",
        "triangles",
        "at",
        "triangle-parallel",
        "fragment-parallel",
        "hybrid",
        "@voxels^2",
        "Schwarz & Seidel",
        "VoxelPipe",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for row in &HCV {
        let maybe = |value: Option<f64>| value.map_or(String::new(), ms);
        rows.push(vec![
            row.model.to_owned(),
            row.triangles.to_string(),
            row.resolution.to_string(),
            ms(row.triangle_parallel),
            ms(row.fragment_parallel),
            ms(row.hybrid),
            format!("{:.1}", row.cutoff),
            maybe(row.schwarz_seidel),
            maybe(row.voxel_pipe),
        ]);
    }
    format!("As published, not measured here: {HCV_HARDWARE}\n\n{}", aligned(&rows))
}

/// \[CL\] table 1 as the paper has it, with the ratio of its columns.
#[must_use]
pub fn published_cl() -> String {
    let head = ["mesh", "triangles", "at", "sliced", "slice-per-pass", "ratio"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for row in &CL {
        for ((resolution, sliced), per_pass) in CL_RESOLUTIONS.iter().zip(row.sliced).zip(row.slice_per_pass) {
            rows.push(vec![
                row.model.to_owned(),
                row.triangles.to_string(),
                resolution.to_string(),
                ms(sliced),
                ms(per_pass),
                format!("{:.1}", per_pass / sliced),
            ]);
        }
    }
    format!("As published, not measured here: {CL_HARDWARE}\n\n{}", aligned(&rows))
}

/// The share of lanes at work, as a percentage; nothing where all work was the rasterizer's.
pub(crate) fn lane_use(counters: &Counters) -> String {
    counters.lane_use().map_or(String::new(), |share| format!("{:.0} %", 100.0 * share))
}

/// What the shaders counted.
#[must_use]
pub fn counters(results: &Results) -> Option<String> {
    let head = [
        "mesh",
        "at",
        "strategy",
        "invocations",
        "columns",
        "columns/invocation",
        "fragments",
        "discarded",
        "tests",
        "written",
        "atomics",
        "lane use",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for cell in &results.cells {
        let Some(counted) = cell.counters else { continue };
        #[expect(clippy::cast_precision_loss, reason = "a ratio for people")]
        let columns_each = counted.columns as f64 / (counted.invocations + counted.fragments).max(1) as f64;
        rows.push(vec![
            cell.mesh.clone(),
            cell.resolution.to_string(),
            cell.strategy.clone(),
            counted.invocations.to_string(),
            counted.columns.to_string(),
            format!("{columns_each:.2}"),
            counted.fragments.to_string(),
            counted.fragments_discarded.to_string(),
            counted.voxel_tests.to_string(),
            counted.voxels_written.to_string(),
            counted.atomics.to_string(),
            lane_use(&counted),
        ]);
    }
    (rows.len() > 1).then(|| aligned(&rows))
}

/// Times over the cutoff.
#[must_use]
pub fn sweeps(results: &Results) -> Option<String> {
    let mut out = String::new();
    for sweep in &results.sweeps {
        let mut rows = vec![vec![format!("{} at {}: cutoff", sweep.mesh, sweep.resolution), "hybrid, ms".to_owned()]];
        rows.extend(sweep.samples.iter().map(|(cutoff, time)| vec![format!("{cutoff:.2}"), ms(*time)]));
        out.push_str(&aligned(&rows));
        out.push('\n');
    }
    (!out.is_empty()).then_some(out)
}
