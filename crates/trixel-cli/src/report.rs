//! The JSON report: one object, with the fields that the documentation names.

use serde::Serialize;
use trixel::attributes::VoxelAttributes;
use trixel::fill::{Fill, FillReport};
use trixel::{Bytes, Grid, Job, Mesh, Mode, Topology};
use trixel_gpu::{AdapterInfo, Counters, Cutoff, GpuVoxelList, ListMethod};

/// What `--report` writes.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) command: Vec<String>,
    pub(crate) version: &'static str,
    pub(crate) mesh: MeshReport,
    pub(crate) grid: GridReport,
    pub(crate) mode: &'static str,
    pub(crate) overlap: f64,
    /// How a solid was filled; null in other modes.
    pub(crate) fill: Option<FillRecord>,
    pub(crate) backend: &'static str,
    pub(crate) strategy: &'static str,
    pub(crate) threads: usize,
    /// The GPU adapter; null on the CPU.
    pub(crate) adapter: Option<AdapterReport>,
    /// How many voxels are set.
    pub(crate) voxels: u64,
    /// What was found out about the voxels; null when nothing was asked.
    pub(crate) attributes: Option<AttributesReport>,
    pub(crate) stages_ms: Stages,
    pub(crate) samples_ms: Samples,
    /// What the shaders counted, if asked to.
    pub(crate) counters: Option<Counters>,
    /// The hybrids' cutoff.
    pub(crate) cutoff: Option<CutoffReport>,
    /// The list that `--list-method` asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) list: Option<ListReport>,
    /// Milliseconds of each pass of the last run on the device, where it has timestamps.
    pub(crate) passes_ms: Vec<(&'static str, f64)>,
    pub(crate) peak_memory_bytes: Option<u64>,
    pub(crate) outputs: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// How a solid's inside was found.
#[derive(Debug, Serialize)]
pub(crate) struct FillRecord {
    pub(crate) name: &'static str,
    /// Columns with an odd number of boundary voxels, and those of them that could not be corrected; null by parity, which
    /// looks at none.
    pub(crate) questionable_columns: Option<u64>,
    pub(crate) uncorrected_columns: Option<u64>,
}

impl FillRecord {
    pub(crate) fn new(job: &Job, fill: Fill, report: Option<FillReport>) -> Option<Self> {
        (job.mode() == Mode::Solid).then(|| Self {
            name: fill.name(),
            questionable_columns: report.map(|report| report.questionable),
            uncorrected_columns: report.map(|report| report.uncorrected),
        })
    }
}

/// The mesh in a report and in `info --json`.
#[derive(Debug, Serialize)]
pub(crate) struct MeshReport {
    pub(crate) triangles: usize,
    pub(crate) vertices: usize,
    pub(crate) merged_vertices: usize,
    pub(crate) edges: usize,
    pub(crate) open_edges: usize,
    pub(crate) non_manifold_edges: usize,
    pub(crate) degenerate_triangles: usize,
    pub(crate) components: usize,
    pub(crate) closed: bool,
    pub(crate) bounds: Option<[[f64; 3]; 2]>,
}

impl MeshReport {
    pub(crate) fn new(mesh: &Mesh, topology: &Topology) -> Self {
        Self {
            triangles: mesh.triangles.len(),
            vertices: mesh.positions.len(),
            merged_vertices: topology.vertices,
            edges: topology.edges,
            open_edges: topology.open_edges,
            non_manifold_edges: topology.non_manifold_edges,
            degenerate_triangles: topology.degenerate_triangles,
            components: topology.components,
            closed: topology.is_closed(),
            bounds: mesh.bounds().map(|bounds| [bounds.min, bounds.max]),
        }
    }
}

/// A GPU adapter, in a report and in `info --adapters --json`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct AdapterReport {
    pub(crate) name: String,
    pub(crate) driver: String,
    pub(crate) backend: String,
    pub(crate) software: bool,
    pub(crate) tier: &'static str,
}

impl From<&AdapterInfo> for AdapterReport {
    fn from(info: &AdapterInfo) -> Self {
        Self {
            name: info.name.clone(),
            driver: info.driver.clone(),
            backend: info.backend.clone(),
            software: info.software,
            tier: info.tier.name(),
        }
    }
}

/// Attributes in a report.
#[derive(Debug, Serialize)]
pub(crate) struct AttributesReport {
    pub(crate) names: Vec<&'static str>,
    pub(crate) combine: &'static str,
    /// What the numbers of materials mean, if these were asked for.
    pub(crate) material_names: Vec<String>,
    /// Voxels that have a triangle; in a surface mode the others were cut out by an alpha test.
    pub(crate) covered: u64,
    /// Bytes that the attributes take in memory, and per set voxel.
    pub(crate) bytes: u64,
    pub(crate) bytes_per_voxel: f64,
}

impl From<&VoxelAttributes> for AttributesReport {
    fn from(attributes: &VoxelAttributes) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a ratio for people")]
        let bytes_per_voxel = attributes.bytes() as f64 / attributes.voxels().max(1) as f64;
        Self {
            names: attributes.columns().iter().map(|(kind, _)| kind.name()).collect(),
            combine: attributes.combine().name(),
            material_names: attributes.material_names().to_vec(),
            covered: attributes.covered(),
            bytes: attributes.bytes(),
            bytes_per_voxel,
        }
    }
}

/// [`Cutoff`] in a report.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct CutoffReport {
    heuristic: &'static str,
    value: f32,
}

impl From<Cutoff> for CutoffReport {
    fn from(cutoff: Cutoff) -> Self {
        Self { heuristic: cutoff.heuristic.name(), value: cutoff.value }
    }
}

/// How the voxels were listed on a GPU.
#[derive(Debug, Serialize)]
pub(crate) struct ListReport {
    method: &'static str,
    entries: u32,
    /// Milliseconds of voxelizing and listing together: the median, and every sample.
    ms: f64,
    samples_ms: Vec<f64>,
    /// Bytes of the list, and the most that making it took beside it and the voxels' bits.
    bytes: u64,
    scratch_bytes: u64,
}

impl ListReport {
    pub(crate) fn new(method: ListMethod) -> Self {
        Self { method: method.name(), entries: 0, ms: 0.0, samples_ms: vec![], bytes: 0, scratch_bytes: 0 }
    }

    /// Adds a sample.
    pub(crate) fn add(&mut self, list: &GpuVoxelList, ms: f64) {
        self.samples_ms.push(ms);
        self.ms = median(&self.samples_ms);
        (self.entries, self.bytes, self.scratch_bytes) = (list.len(), list.bytes(), list.scratch_bytes());
    }
}

impl std::fmt::Display for ListReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { method, entries, ms, .. } = self;
        let [list, scratch] = [self.bytes, self.scratch_bytes].map(Bytes);
        write!(f, "{method}: {entries} voxels voxelized and listed in {ms:.1} ms, {list} and {scratch} to make it")
    }
}

/// A grid, as every report and sidecar names it.
#[derive(Debug, Serialize)]
pub(crate) struct GridReport {
    pub(crate) origin: [f64; 3],
    pub(crate) voxel_size: [f64; 3],
    pub(crate) dims: [u32; 3],
}

impl From<&Grid> for GridReport {
    fn from(grid: &Grid) -> Self {
        Self { origin: grid.origin(), voxel_size: grid.voxel_size(), dims: grid.dims() }
    }
}

/// Milliseconds per stage; medians where a stage ran several times.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Stages {
    pub(crate) read: f64,
    /// Counting open and non-manifold edges: in mode solid and for reports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) topology: Option<f64>,
    pub(crate) snap: f64,
    pub(crate) allocate: f64,
    /// Opening the GPU, checking it and building its pipelines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) open: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) upload: Option<f64>,
    pub(crate) voxelize: f64,
    /// Decoding the images of the mesh's textures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) textures: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rank: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) attributes: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) download: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) write: Option<f64>,
    pub(crate) total: f64,
}

/// Milliseconds of each run of the stages that `--repeat` repeats.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Samples {
    pub(crate) voxelize: Vec<f64>,
}

/// The median; the mean of the middle two for an even number. 0 for none.
pub(crate) fn median(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn medians() {
        assert_eq!(median(&[]), 0.0);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
    }
}
