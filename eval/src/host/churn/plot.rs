//! The plot of a run: memory, latencies and sessions over time.

use std::path::Path;

use anyhow::anyhow;
use plotters::prelude::*;

use super::Row;

const SIZE: (u32, u32) = (760, 640);
const BLUE: RGBColor = RGBColor(0x2b, 0x6c, 0xb0);
const AMBER: RGBColor = RGBColor(0xb7, 0x79, 0x1f);
const GREY: RGBColor = RGBColor(0x71, 0x80, 0x96);

/// A line: name, colour, and the value of a row.
type Line = (&'static str, RGBColor, fn(&Row) -> f64);

/// Writes the plot as SVG.
///
/// # Errors
/// The message of the plotting library, if the file cannot be written.
pub fn write(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let panels = area.split_evenly((3, 1));
    let charts: [(&str, &[Line]); 3] = [
        ("resident memory (MiB)", &[("", BLUE, |row| row.memory_mib)]),
        (
            "p99 (ms)",
            &[
                ("lateness of ticks", BLUE, |row| row.tick_p99_ms),
                ("InBetween", AMBER, |row| row.call_p99_ms),
            ],
        ),
        (
            "count",
            &[
                ("open sessions", BLUE, |row| row.sessions),
                ("underruns in 10 s", AMBER, |row| row.underruns),
            ],
        ),
    ];
    for (panel, (unit, lines)) in panels.iter().zip(charts) {
        draw(panel, unit, lines, rows).map_err(|error| anyhow!("the plot: {error}"))?;
    }
    area.present()?;
    Ok(())
}

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    unit: &str,
    lines: &[Line],
    rows: &[Row],
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>>
where
    B::ErrorType: 'static,
{
    let minutes = rows.last().map_or(1.0, |row| row.at_s / 60.0).max(0.1);
    let values = lines.iter().flat_map(|(_, _, of)| rows.iter().map(of));
    let top = values.fold(1.0, f64::max) * 1.4;
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..minutes, 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc("minutes")
        .y_desc(unit)
        .light_line_style(WHITE)
        .bold_line_style(GREY.mix(0.25))
        .axis_style(GREY)
        .draw()?;
    for &(name, colour, of) in lines {
        let points = rows.iter().map(|row| (row.at_s / 60.0, of(row)));
        let series = chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        if !name.is_empty() {
            let sample = move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2));
            series.label(name).legend(sample);
        }
    }
    if lines.len() > 1 {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.8))
            .border_style(TRANSPARENT)
            .draw()?;
    }
    Ok(())
}
