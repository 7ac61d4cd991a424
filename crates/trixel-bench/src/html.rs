//! Results as one self-contained page: tables, and the paper's figures as plots.

use std::fmt::Write;

use crate::lists;
use crate::plot::{Line, plot};
use crate::published::{CL, CL_HARDWARE, CL_RESOLUTIONS, HCV, HCV_HARDWARE};
use crate::results::{Cell, Results, SLICE_PER_PASS, SLICED};
use crate::text::{lane_use, ms};

const STYLE: &str = "
:root { color-scheme: light dark; --line: #8884; --soft: #8881; --best: #00814a; --bad: #c22; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 78rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: 0; } h2 { font-size: 1.15rem; margin-top: 2.5rem; }
p.note { color: #888; margin-top: .3rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; } thead th { background: var(--soft); }
td.best { color: var(--best); font-weight: 600; } td.bad { color: var(--bad); font-weight: 600; }
.scroll { overflow-x: auto; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(30rem, 1fr)); gap: 1rem; }
.plots svg { width: 100%; height: auto; border: 1px solid var(--line); border-radius: 6px; background: #fff; }
.software { border-left: 4px solid #e69f00; padding-left: .7rem; }
";

/// The page.
#[must_use]
pub fn page(results: &Results) -> String {
    let mut out = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    out.push_str("<meta name=\"viewport\" content=\"width=device-width\">\n<title>trixel bench</title>\n");
    out.push_str("<link rel=\"icon\" href=\"data:,\">\n");
    // Writing to a string cannot fail, here and below.
    let _ = write!(out, "<style>{STYLE}</style>\n</head>\n<body>\n<h1>trixel {} bench</h1>\n", escape(&results.trixel));
    let software = results.adapter.as_ref().is_some_and(|adapter| adapter.software);
    let _ = writeln!(
        out,
        "<p class=\"note{}\">{}<br>{}, {} threads, {}; mode {}; wrong voxels in all cells: {}</p>",
        if software { " software" } else { "" },
        escape(&results.adapter_line()),
        escape(&results.machine.cpu),
        results.machine.threads,
        escape(&results.machine.system),
        escape(&results.mode),
        results.wrong_voxels()
    );
    if !results.cells.is_empty() {
        out.push_str(
            "<h2>Times</h2>\n<p class=\"note\">Median of the runs in milliseconds, without upload and download; in \
                      small type the shortest and the longest. The best of a row is green.</p>\n",
        );
        table(results, &mut out);
    }
    list_methods(results, &mut out);
    figures(results, &mut out);
    counters(results, &mut out);
    if results.columns().iter().any(|column| [SLICED, SLICE_PER_PASS].contains(column)) {
        published_slices(&mut out);
    } else {
        published(&mut out);
    }
    out.push_str("</body>\n</html>\n");
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn head(names: &[&str], out: &mut String) {
    out.push_str("<div class=\"scroll\"><table>\n<thead><tr>");
    for name in names {
        let _ = write!(out, "<th>{}</th>", escape(name));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
}

const END: &str = "</tbody>\n</table></div>\n";

fn table(results: &Results, out: &mut String) {
    let columns = results.columns();
    let mut names = vec!["mesh", "triangles", "at"];
    names.extend(columns.iter().map(|(_, strategy)| *strategy));
    let compared = columns.contains(&SLICED) && columns.contains(&SLICE_PER_PASS);
    names.extend(compared.then_some("ratio"));
    names.extend(["cutoff", "voxels", "wrong"]);
    head(&names, out);
    for mesh in results.meshes() {
        for resolution in results.resolutions(mesh) {
            let cells: Vec<Option<&Cell>> =
                columns.iter().map(|column| results.cell(mesh, resolution, *column)).collect();
            let some = || cells.iter().flatten();
            let best = some().map(|cell| cell.median_ms).fold(f64::INFINITY, f64::min);
            let (triangles, voxels) = some().next().map_or((0, 0), |cell| (cell.triangles, cell.voxels));
            let _ = write!(out, "<tr><td>{}</td><td>{triangles}</td><td>{resolution}</td>", escape(mesh));
            for cell in &cells {
                let _ = match cell {
                    None => write!(out, "<td></td>"),
                    Some(cell) => write!(
                        out,
                        "<td{}>{}<br><small>{}&ndash;{}</small></td>",
                        if cell.median_ms <= best { " class=\"best\"" } else { "" },
                        ms(cell.median_ms),
                        ms(cell.min_ms),
                        ms(cell.max_ms)
                    ),
                };
            }
            if let Some(ratio) = results.slicing_ratio(mesh, resolution) {
                let _ = write!(out, "<td>{ratio:.1}</td>");
            } else if compared {
                out.push_str("<td></td>");
            }
            let wrong: u64 = some().map(|cell| cell.wrong_voxels).sum();
            let cutoff = some().find_map(|cell| cell.cutoff).map_or(String::new(), |cutoff| format!("{cutoff:.1}"));
            let bad = if wrong > 0 { " class=\"bad\"" } else { "" };
            let _ = writeln!(out, "<td>{cutoff}</td><td>{voxels}</td><td{bad}>{wrong}</td></tr>");
        }
    }
    out.push_str(END);
}

fn list_methods(results: &Results, out: &mut String) {
    let rows = lists::rows(results);
    if rows.is_empty() {
        return;
    }
    out.push_str(
        "<h2>Voxel lists</h2>\n<p class=\"note\">Voxelizing and listing in x-y-z order, medians of the runs; memory is the \
                  most in use beside the mesh.</p>\n",
    );
    head(&lists::HEAD, out);
    for row in rows {
        out.push_str("<tr>");
        for cell in row {
            let _ = write!(out, "<td>{}</td>", escape(&cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str(END);
}

/// A strategy's line for each mesh.
fn over_resolution(results: &Results, strategy: &str) -> Vec<Line> {
    let lines = results.meshes().into_iter().map(|mesh| {
        let cells = results.cells.iter().filter(|cell| cell.mesh == mesh && cell.strategy == strategy);
        Line { name: mesh.to_owned(), points: cells.map(|cell| (f64::from(cell.resolution), cell.median_ms)).collect() }
    });
    lines.filter(|line| !line.points.is_empty()).collect()
}

fn figures(results: &Results, out: &mut String) {
    let mut plots = vec![];
    for (strategy, figure) in
        [("triangle-parallel", "3.3"), ("fragment-parallel", "3.4"), ("hybrid", "3.10, completed"), ("column-runs", "")]
    {
        let title = match figure {
            "" => strategy.to_owned(),
            figure => format!("{strategy} (figure {figure})"),
        };
        plots.extend(plot(&title, "voxels along the longest side", true, &over_resolution(results, strategy)));
    }
    // Figure 3.10: the strategies beside each other, a plot a mesh.
    for mesh in results.meshes() {
        let lines: Vec<_> = results
            .columns()
            .into_iter()
            .map(|(_, strategy)| {
                let mut lines = over_resolution(results, strategy);
                lines.retain(|line| line.name == mesh);
                let points = lines.pop().map_or(vec![], |line| line.points);
                Line { name: strategy.to_owned(), points }
            })
            .collect();
        plots.extend(plot(&format!("{mesh} (figure 3.10)"), "voxels along the longest side", true, &lines));
    }
    let sweeps = |most: f32| -> Vec<Line> {
        let lines = results.sweeps.iter().map(|sweep| {
            let samples = sweep.samples.iter().filter(|(cutoff, _)| *cutoff <= most);
            let points = samples.map(|(cutoff, time)| (f64::from(*cutoff), *time)).collect();
            Line { name: sweep.mesh.clone(), points }
        });
        lines.collect()
    };
    // All sweeps are at the last resolution.
    let at = results.sweeps.first().map_or(0, |sweep| sweep.resolution);
    for (over, figure, most) in [("its cutoff", "3.13", f32::INFINITY), ("low cutoffs", "3.14", 16.0)] {
        let title = format!("hybrid over {over} at {at} (figure {figure})");
        plots.extend(plot(&title, "cutoff, square voxels", false, &sweeps(most)));
    }
    if !plots.is_empty() {
        let _ = write!(
            out,
            "<h2>Figures</h2>\n<p class=\"note\">Numbered as in Rauwendaal 2012, whose plots they redo.</p>\n"
        );
        let _ = write!(out, "<div class=\"plots\">\n{}\n</div>\n", plots.join("\n"));
    }
}

fn counters(results: &Results, out: &mut String) {
    let counted: Vec<_> = results.cells.iter().filter_map(|cell| Some((cell, cell.counters?))).collect();
    if counted.is_empty() {
        return;
    }
    out.push_str(
        "<h2>Work</h2>\n<p class=\"note\">What the shaders counted themselves; it is the same on every adapter but \
                  for fragments, which the rasterizer proposes, and atomics, which whoever comes late is spared. Lane use is the share of \
                  32 neighbouring invocations with a column to work on while any of them has one.</p>\n",
    );
    let names = [
        "mesh",
        "at",
        "strategy",
        "invocations",
        "fragments",
        "discarded",
        "columns",
        "tests",
        "written",
        "atomics",
        "lane use",
    ];
    head(&names, out);
    for (cell, c) in counted {
        let _ =
            write!(out, "<tr><td>{}</td><td>{}</td><td>{}</td>", escape(&cell.mesh), cell.resolution, cell.strategy);
        for value in
            [c.invocations, c.fragments, c.fragments_discarded, c.columns, c.voxel_tests, c.voxels_written, c.atomics]
        {
            let _ = write!(out, "<td>{value}</td>");
        }
        let _ = writeln!(out, "<td>{}</td></tr>", lane_use(&c));
    }
    out.push_str(END);
}

fn published_slices(out: &mut String) {
    let _ = write!(out, "<h2>As published</h2>\n<p class=\"note\">Not measured here: {}.</p>\n", escape(CL_HARDWARE));
    head(&["model", "triangles", "at", "sliced", "slice-per-pass", "ratio"], out);
    for row in &CL {
        for ((resolution, sliced), per_pass) in CL_RESOLUTIONS.iter().zip(row.sliced).zip(row.slice_per_pass) {
            let (model, triangles, ratio) = (row.model, row.triangles, per_pass / sliced);
            let _ = write!(out, "<tr><td>{model}</td><td>{triangles}</td><td>{resolution}</td><td>{}</td>", ms(sliced));
            let _ = writeln!(out, "<td>{}</td><td>{ratio:.1}</td></tr>", ms(per_pass));
        }
    }
    out.push_str(END);
}

fn published(out: &mut String) {
    let _ = write!(out, "<h2>As published</h2>\n<p class=\"note\">Not measured here: {}.</p>\n", escape(HCV_HARDWARE));
    head(
        &[
            "model",
            "triangles",
            "at",
            "triangle-parallel",
            "fragment-parallel",
            "hybrid",
            "cutoff",
            "Schwarz & Seidel",
            "VoxelPipe",
        ],
        out,
    );
    for row in &HCV {
        let _ = write!(out, "<tr><td>{}</td><td>{}</td><td>{}</td>", row.model, row.triangles, row.resolution);
        for value in [row.triangle_parallel, row.fragment_parallel, row.hybrid] {
            let _ = write!(out, "<td>{}</td>", ms(value));
        }
        let _ = write!(out, "<td>{:.1}</td>", row.cutoff);
        for value in [row.schwarz_seidel, row.voxel_pipe] {
            let _ = write!(out, "<td>{}</td>", value.map_or(String::new(), ms));
        }
        out.push_str("</tr>\n");
    }
    out.push_str(END);
}
