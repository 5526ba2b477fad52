//! Plots of a report, as SVG for its page.

use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;

use crate::figures::{Run, SecondRow, ServerRow};

const SIZE: (u32, u32) = (760, 280);
const BLUE: RGBColor = RGBColor(0x2b, 0x6c, 0xb0);
const RED: RGBColor = RGBColor(0xc5, 0x30, 0x30);
const GREY: RGBColor = RGBColor(0x71, 0x80, 0x96);
const AMBER: RGBColor = RGBColor(0xb7, 0x79, 0x1f);
const GREEN: RGBColor = RGBColor(0x2f, 0x85, 0x5a);

/// Why a plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw a plot: {0}")]
pub struct PlotError(String);

fn fault(error: impl std::fmt::Display) -> PlotError {
    PlotError(error.to_string())
}

/// A line of a plot: its name, colour and points.
type Line = (&'static str, RGBColor, Vec<(f64, f64)>);

/// The axes of a plot.
struct Axes<'a> {
    x: &'a str,
    y: &'a str,
    x_label: &'a dyn Fn(&f64) -> String,
    /// Maximum number of labels on the x axis.
    x_labels: usize,
}

fn plain(value: &f64) -> String {
    // Rounds away binary fractions, such as 0.30000000000000004.
    let rounded = (value * 1e4).round() / 1e4;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}

/// Draws into a new SVG picture.
fn svg(
    draw: impl FnOnce(&DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw(&area)?;
        area.present().map_err(fault)?;
    }
    Ok(text)
}

/// Draws the axes of a plot, and faint lines at their labels.
fn draw_mesh<X, Y, B>(mut mesh: MeshStyle<'_, '_, X, Y, B>) -> Result<(), PlotError>
where
    X: Ranged + ValueFormatter<X::ValueType>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    B: DrawingBackend,
{
    mesh.y_label_formatter(&plain)
        .light_line_style(WHITE)
        .bold_line_style(GREY.mix(0.25))
        .axis_style(GREY)
        .draw()
        .map_err(fault)
}

fn lines(axes: &Axes<'_>, lines: &[Line]) -> Result<String, PlotError> {
    let points = || lines.iter().flat_map(|(.., points)| points.iter());
    let low = points().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let high = points().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low < high { (low, high) } else { (0.0, 1.0) };
    // Several lines have a legend at the top, which needs room.
    let room = if lines.len() > 1 { 1.4 } else { 1.08 };
    let top = points().map(|p| p.1).fold(0.0, f64::max) * room;
    let top = if top > 0.0 { top } else { 1.0 };
    svg(|area| {
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(low..high, 0.0..top)
            .map_err(fault)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(axes.x).y_desc(axes.y);
        mesh.x_labels(axes.x_labels).x_label_formatter(axes.x_label);
        draw_mesh(mesh)?;
        for (name, colour, points) in lines {
            let colour = *colour;
            chart
                .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))
                .map_err(fault)?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        if lines.len() > 1 {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(TRANSPARENT)
                .draw()
                .map_err(fault)?;
        }
        Ok(())
    })
}

/// The number of nines in a quantile: 1 for 0.9, 2 for 0.99.
fn nines(quantile: f64) -> f64 {
    -(1.0 - quantile).max(1e-7).log10()
}

fn as_percent(nines: &f64) -> String {
    let percent = 100.0 * (1.0 - 10_f64.powf(-nines));
    let digits = (nines - 2.0).max(0.0).ceil() as usize;
    format!("{percent:.digits$} %")
}

/// Latency by percentile. The axis gives slow answers more room.
pub(super) fn percentiles(runs: &[Run]) -> Result<String, PlotError> {
    let colours = [BLUE, AMBER, GREEN, RED, GREY];
    let of_run = |(nth, run): (usize, &Run)| -> Line {
        // The curve ends at the slowest answer.
        let most = (run.latencies.count().max(2) as f64).log10();
        let points = run.latencies.curve_ms().into_iter();
        let points = points.map(|(quantile, ms)| (nines(quantile).min(most), ms));
        ("", colours[nth % colours.len()], points.collect())
    };
    let all = runs.iter().enumerate().map(of_run).collect::<Vec<_>>();
    let most = runs.iter().map(|run| run.latencies.count()).max().unwrap_or(0);
    let axes = Axes {
        x: "percentile",
        y: "ms",
        x_label: &as_percent,
        // A label for each nine.
        x_labels: (most.max(10) as f64).log10().floor() as usize + 1,
    };
    // A single line needs no legend.
    let mut picture = String::new();
    if let [one] = all.as_slice() {
        picture += &lines(&axes, std::slice::from_ref(one))?;
    } else {
        let names = ["run 1", "run 2", "run 3", "run 4", "run 5"];
        let named = all.into_iter().zip(names).map(|((_, c, p), name)| (name, c, p));
        picture += &lines(&axes, &named.collect::<Vec<_>>())?;
    }
    Ok(picture)
}

/// A line over time: its name, colour, and the point of each row.
type Column<'a, R> = (&'static str, RGBColor, &'a dyn Fn(&R) -> (f64, f64));

fn over_time<R>(rows: &[R], unit: &str, of: &[Column<'_, R>]) -> Result<String, PlotError> {
    let all = of
        .iter()
        .map(|(name, colour, point)| (*name, *colour, rows.iter().map(point).collect()));
    let axes = Axes {
        x: "seconds since the end of the warm-up",
        y: unit,
        x_label: &plain,
        x_labels: 12,
    };
    lines(&axes, &all.collect::<Vec<Line>>())
}

/// Right answers, refusals and failures, second by second.
pub(super) fn throughput(rows: &[SecondRow]) -> Result<String, PlotError> {
    over_time(
        rows,
        "a second",
        &[
            ("right", BLUE, &|row| (row.t, row.right as f64)),
            ("refused", AMBER, &|row| (row.t, row.refused as f64)),
            ("failed or dropped", RED, &|row| {
                (row.t, (row.failed + row.dropped) as f64)
            }),
            ("most in flight", GREY, &|row| (row.t, row.in_flight as f64)),
        ],
    )
}

/// Latencies, second by second.
pub(super) fn latency(rows: &[SecondRow]) -> Result<String, PlotError> {
    // A second without an answer has no latency.
    let rows = rows.iter().filter(|row| row.right > 0).copied();
    over_time(
        &rows.collect::<Vec<_>>(),
        "ms",
        &[
            ("longest", GREY, &|row| (row.t, row.max_ms)),
            ("p99", RED, &|row| (row.t, row.p99_ms)),
            ("p50", BLUE, &|row| (row.t, row.p50_ms)),
        ],
    )
}

const MIB: f64 = 1_048_576.0;

/// Memory of server and client.
pub(super) fn memory(rows: &[ServerRow]) -> Result<String, PlotError> {
    over_time(
        rows,
        "MiB",
        &[
            ("server", BLUE, &|row| (row.t, row.rss_bytes as f64 / MIB)),
            ("load tester", GREY, &|row| {
                (row.t, row.client_rss_bytes as f64 / MIB)
            }),
        ],
    )
}

/// Processors of server and client.
pub(super) fn cpus(rows: &[ServerRow]) -> Result<String, PlotError> {
    // The first reading has no earlier one, so it has no rate.
    over_time(
        rows.get(1..).unwrap_or_default(),
        "processors busy",
        &[
            ("server", BLUE, &|row| (row.t, row.cpus)),
            ("load tester", GREY, &|row| (row.t, row.client_cpus)),
        ],
    )
}

/// Batches by their size.
pub(super) fn batches(sizes: &[(u32, u64)]) -> Result<String, PlotError> {
    let top = sizes.iter().map(|s| s.1).max().unwrap_or(1) as f64 * 1.08;
    let name = |place: &SegmentValue<usize>| {
        let size = match place {
            SegmentValue::CenterOf(nth) => sizes.get(*nth).map(|s| s.0),
            SegmentValue::Exact(_) | SegmentValue::Last => None,
        };
        match size {
            Some(u32::MAX) => "more".to_owned(),
            Some(size) => format!("≤ {size}"),
            None => String::new(),
        }
    };
    svg(|area| {
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(
                (0..sizes.len().saturating_sub(1)).into_segmented(),
                0.0..top.max(1.0),
            )
            .map_err(fault)?;
        let mut mesh = chart.configure_mesh();
        mesh.disable_x_mesh()
            .x_desc("characters in a batch")
            .y_desc("batches");
        mesh.x_labels(sizes.len() + 1).x_label_formatter(&name);
        draw_mesh(mesh)?;
        let bars = Histogram::vertical(&chart)
            .style(BLUE.filled())
            .margin(8)
            .data(sizes.iter().enumerate().map(|(nth, size)| (nth, size.1 as f64)));
        chart.draw_series(bars).map_err(fault)?;
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percents_have_the_digits_they_need() {
        let of = |quantile: f64| as_percent(&nines(quantile));
        assert_eq!(
            [of(0.0), of(0.9), of(0.99), of(0.999)],
            ["0 %", "90 %", "99 %", "99.9 %"]
        );
    }

    #[test]
    fn empty_plots_are_plots() {
        let batches = [batches(&[]), batches(&[(4, 9)])];
        for picture in [throughput(&[]), memory(&[]), cpus(&[]), percentiles(&[])]
            .into_iter()
            .chain(batches)
        {
            assert!(picture.unwrap().contains("<svg"));
        }
    }
}
