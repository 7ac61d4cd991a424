//! Line plots as SVG.

use plotters::coord::combinators::BindKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

/// One line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What the legend says.
    pub name: String,
    /// Where it is across, and milliseconds.
    pub points: Vec<(f64, f64)>,
}

/// Colours that people with colour blindness can tell apart (Okabe and Ito 2008).
const COLORS: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
    RGBColor(0, 0, 0),
    RGBColor(160, 140, 0),
];

const SIZE: (u32, u32) = (760, 400);
/// The legend's part of the width.
const LEGEND: u32 = 190;

/// A plot of times in milliseconds on a logarithmic axis; the horizontal one is logarithmic too if asked for, with a tick at
/// every value that occurs. `None` when there is nothing to show.
#[must_use]
pub fn plot(title: &str, across: &str, log_across: bool, lines: &[Line]) -> Option<String> {
    let points = || lines.iter().flat_map(|line| &line.points);
    let (left, right) = low_high(points().map(|point| point.0))?;
    let (bottom, top) = low_high(points().map(|point| point.1.max(1e-3)))?;
    let (bottom, top) = (bottom * 0.8, top * 1.25);
    let up = (bottom..top).log_scale().with_key_points(ticks(bottom, top));
    let mut svg = String::new();
    let drawn = if log_across {
        let mut at: Vec<f64> = points().map(|point| point.0).collect();
        at.sort_by(f64::total_cmp);
        at.dedup();
        let axis = (left.max(1e-3) * 0.92..right * 1.08).log_scale().with_key_points(at);
        draw(&mut svg, title, across, axis, up, lines)
    } else {
        draw(&mut svg, title, across, left..right.max(left + 1e-3), up, lines)
    };
    drawn.ok().map(|()| svg)
}

fn low_high(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    (low.is_finite() && high.is_finite()).then_some((low, high))
}

/// 1, 2 and 5 in every decade of a range.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = (-6..9).map(|decade| 10f64.powi(decade));
    let ticks = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * decade));
    ticks.filter(|tick| (low..=high).contains(tick)).collect()
}

fn draw<X, Y>(
    svg: &mut String,
    title: &str,
    across: &str,
    x: X,
    y: Y,
    lines: &[Line],
) -> Result<(), Box<dyn std::error::Error>>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, legend) = root.split_horizontally(SIZE.0 - LEGEND);
    let mut chart = ChartBuilder::on(&left)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)?;
    let number = |value: &f64| value.to_string();
    chart
        .configure_mesh()
        .x_desc(across)
        .y_desc("ms")
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style(("sans-serif", 13))
        .light_line_style(RGBColor(236, 236, 236))
        .bold_line_style(RGBColor(214, 214, 214))
        .draw()?;
    for ((line, color), at) in lines.iter().zip(COLORS.into_iter().cycle()).zip((56..).step_by(20)) {
        let style = color.stroke_width(2);
        chart.draw_series(LineSeries::new(line.points.iter().copied(), style))?;
        chart.draw_series(line.points.iter().map(|point| Circle::new(*point, 3, color.filled())))?;
        legend.draw(&PathElement::new([(0, at), (18, at)], style))?;
        legend.draw(&Text::new(line.name.as_str(), (24, at - 6), ("sans-serif", 13)))?;
    }
    root.present()?;
    Ok(())
}
