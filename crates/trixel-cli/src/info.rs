//! `trixel info`: what is in a file.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result};
use serde::Serialize;
use trixel::{Mesh, Topology};
use trixel_gpu::GpuError;
use trixel_io::VolumeFormat;
use trixel_io::volume_read::read_volume;

use crate::args::InfoArgs;
use crate::progress::Reporter;
use crate::report::{AdapterReport, GridReport, MeshReport};
use crate::voxelize::volume_bytes;
use crate::{memory, mesh, volume};

pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(false);
    let (text, json) = match &args.file {
        Some(file) => {
            let path = Path::new(file);
            let readable = VolumeFormat::from_path(path).is_some_and(VolumeFormat::is_readable);
            if readable && !file.starts_with("scene:") {
                let info = volume_info(path, &reporter)?;
                (info.text(), serde_json::to_string_pretty(&info)?)
            } else {
                let info = mesh_info(file, &reporter)?;
                (info.text(), serde_json::to_string_pretty(&info)?)
            }
        }
        None => {
            let (adapters, _) = reporter.stage("looking for adapters", trixel_gpu::adapters);
            let text = adapters.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
            let text = if adapters.is_empty() { GpuError::NoAdapter.to_string() } else { text };
            let adapters: Vec<_> = adapters.iter().map(AdapterReport::from).collect();
            (text, serde_json::to_string_pretty(&adapters)?)
        }
    };
    reporter.finish();
    let mut out = std::io::stdout().lock();
    let text = if args.json { json } else { text };
    match writeln!(out, "{text}") {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write to standard output")?,
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Serialize)]
struct VolumeInfo {
    file: String,
    grid: GridReport,
    voxels: u64,
    /// First and last index of a set voxel along each axis.
    occupied: Option<[[u32; 3]; 2]>,
    memory_bytes: u64,
    warnings: Vec<String>,
}

fn volume_info(path: &Path, reporter: &Reporter) -> Result<VolumeInfo> {
    let (loaded, _) = reporter.stage("reading", || read_volume(path, memory::available()));
    let loaded = loaded?;
    loaded.warnings.iter().for_each(|warning| reporter.warn(format!("{}: {warning}", path.display())));
    let volume = loaded.volume;
    Ok(VolumeInfo {
        file: path.display().to_string(),
        grid: GridReport::from(volume.grid()),
        voxels: volume.count(),
        occupied: volume::occupied(&volume),
        memory_bytes: volume_bytes(volume.grid()).0,
        warnings: reporter.warnings(),
    })
}

impl VolumeInfo {
    fn text(&self) -> String {
        let [nx, ny, nz] = self.grid.dims;
        let all = u64::from(nx) * u64::from(ny) * u64::from(nz);
        #[expect(clippy::cast_precision_loss, reason = "a percentage for people")]
        let percent = 100.0 * self.voxels as f64 / all as f64;
        let occupied = self.occupied.map_or_else(|| "none".to_owned(), |[from, to]| format!("{from:?} to {to:?}"));
        [
            format!("{}: volume", self.file),
            format!("  grid         {nx} x {ny} x {nz} voxels ({})", trixel::Bytes(self.memory_bytes)),
            format!("  origin       {:?}", self.grid.origin),
            format!("  voxel size   {:?}", self.grid.voxel_size),
            format!("  set voxels   {} ({percent:.3} %)", self.voxels),
            format!("  set indices  {occupied}"),
        ]
        .join("\n")
    }
}

#[derive(Serialize)]
struct MeshInfo {
    file: String,
    #[serde(flatten)]
    mesh: MeshReport,
    attributes: Vec<String>,
    materials: Vec<String>,
    textures: usize,
    warnings: Vec<String>,
}

fn mesh_info(input: &str, reporter: &Reporter) -> Result<MeshInfo> {
    let (loaded, _) = reporter.stage("reading", || mesh::load(input, true, reporter));
    let loaded = loaded?;
    let (topology, _) = reporter.stage("counting edges", || Topology::of(&loaded));
    Ok(MeshInfo {
        file: input.to_owned(),
        mesh: MeshReport::new(&loaded, &topology),
        attributes: attributes(&loaded),
        materials: loaded.materials.iter().map(|material| material.name.clone()).collect(),
        textures: loaded.textures.len(),
        warnings: reporter.warnings(),
    })
}

fn attributes(mesh: &Mesh) -> Vec<String> {
    let mut names = Vec::new();
    if mesh.normals.is_some() {
        names.push("normals".to_owned());
    }
    if mesh.colors.is_some() {
        names.push("colors".to_owned());
    }
    if !mesh.uvs.is_empty() {
        names.push(format!(
            "texture coordinates ({} set{})",
            mesh.uvs.len(),
            if mesh.uvs.len() == 1 { "" } else { "s" }
        ));
    }
    names
}

impl MeshInfo {
    fn text(&self) -> String {
        let mesh = &self.mesh;
        let closed = if mesh.closed { "closed" } else { "not closed" };
        let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let mut lines = vec![
            format!("{}: mesh, {closed}", self.file),
            format!("  triangles            {}", mesh.triangles),
            format!(
                "  vertices             {} ({} after merging equal positions)",
                mesh.vertices, mesh.merged_vertices
            ),
            format!("  components           {}", mesh.components),
            format!("  open edges           {}", mesh.open_edges),
            format!("  non-manifold edges   {}", mesh.non_manifold_edges),
            format!("  degenerate triangles {}", mesh.degenerate_triangles),
        ];
        if let Some([min, max]) = mesh.bounds {
            lines.push(format!("  box                  {min:?} to {max:?}"));
        }
        lines.push(format!("  attributes           {}", list(&self.attributes)));
        let names: Vec<_> =
            self.materials.iter().map(|name| if name.is_empty() { "(unnamed)" } else { name }).collect();
        if !names.is_empty() {
            lines.push(format!("  materials            {}: {}", names.len(), shorten(&names)));
        }
        if self.textures > 0 {
            lines.push(format!("  textures             {}", self.textures));
        }
        lines.join("\n")
    }
}

/// The first few names.
fn shorten(names: &[&str]) -> String {
    const MOST: usize = 6;
    let first = names.iter().take(MOST).copied().collect::<Vec<_>>().join(", ");
    if names.len() > MOST { format!("{first}, ...") } else { first }
}
