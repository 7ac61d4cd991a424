//! The methods of listing voxels beside each other: \[HCV\] 3.4.

use std::time::Instant;

use trixel::lattice::LatticeMesh;
use trixel::{Bytes, Job, Mode, Volume, VoxelOrder, voxel_list};
use trixel_gpu::{Gpu, GpuMesh, ListMethod, Options, Voxelizer};

use crate::measure::MeasureError;
use crate::results::{ListCell, Results};
use crate::text::{aligned, ms};
use crate::timing::median;

/// The methods that list voxels of a mode.
pub(crate) fn methods(mode: Mode) -> impl Iterator<Item = ListMethod> {
    // No triangle meets the inside of a solid.
    ListMethod::ALL.into_iter().filter(move |method| mode != Mode::Solid || *method != ListMethod::FragmentList)
}

/// Voxelizes and lists in x-y-z order by every method, `runs` times by turns.
pub(crate) fn measure(
    (name, resolution): (&str, u32),
    lattice: &LatticeMesh<'_>,
    job: &Job,
    gpu: &Gpu,
    runs: usize,
) -> Result<Vec<ListCell>, MeasureError> {
    let mut right = Volume::new(*job.grid()).map_err(trixel::Error::from)?;
    trixel::Backend::voxelize(&trixel::CpuBackend::default(), lattice, job, &mut right)?;
    let right = voxel_list(&right, VoxelOrder::Xyz);
    let mesh = GpuMesh::upload(gpu, lattice)?;
    let mut voxelizer = Voxelizer::new(gpu, job, &Options::default())?;
    let mut cells = vec![];
    for method in methods(job.mode()) {
        // Builds the pipelines as well.
        let list = voxelizer.list(&mesh, method, VoxelOrder::Xyz)?;
        let found = list.download(gpu)?;
        let differ = found.iter().zip(&right).filter(|(found, right)| found != right).count();
        let bits = if method == ListMethod::FragmentList { 0 } else { Volume::required_bytes(job.grid()) };
        cells.push(ListCell {
            mesh: name.to_owned(),
            triangles: lattice.triangles.len() as u64,
            resolution,
            method: method.name().to_owned(),
            runs,
            median_ms: 0.0,
            min_ms: 0.0,
            max_ms: 0.0,
            voxels: right.len() as u64,
            memory_bytes: bits + list.bytes() + list.scratch_bytes(),
            wrong_entries: (differ + found.len().abs_diff(right.len())) as u64,
        });
    }
    let mut times = vec![vec![]; cells.len()];
    for _ in 0..runs {
        for (method, times) in methods(job.mode()).zip(&mut times) {
            let start = Instant::now();
            voxelizer.list(&mesh, method, VoxelOrder::Xyz)?;
            gpu.wait()?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    for (cell, times) in cells.iter_mut().zip(&mut times) {
        cell.median_ms = median(times);
        cell.min_ms = times.first().copied().unwrap_or(0.0);
        cell.max_ms = times.last().copied().unwrap_or(0.0);
    }
    Ok(cells)
}

/// Names over columns: what is in the rows that [`rows`] gives.
pub(crate) const HEAD: [&str; 8] = ["mesh", "triangles", "at", "voxels", "method", "ms", "memory", "wrong"];

pub(crate) fn rows(results: &Results) -> Vec<Vec<String>> {
    let row = |cell: &ListCell| {
        vec![
            cell.mesh.clone(),
            cell.triangles.to_string(),
            cell.resolution.to_string(),
            cell.voxels.to_string(),
            cell.method.clone(),
            ms(cell.median_ms),
            Bytes(cell.memory_bytes).to_string(),
            cell.wrong_entries.to_string(),
        ]
    };
    results.lists.iter().map(row).collect()
}

/// The comparison as text, if there is one.
#[must_use]
pub fn text(results: &Results) -> Option<String> {
    let mut all = vec![HEAD.map(str::to_owned).to_vec()];
    all.extend(rows(results));
    (all.len() > 1).then(|| {
        format!("Voxelizing and listing in x-y-z order; memory is the most in use beside the mesh\n\n{}", aligned(&all))
    })
}
