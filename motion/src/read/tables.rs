//! Robots' CSV: Unitree's, Kimodo's, ARDY's and MuJoCo's `qpos` as text, and `qpos` as a NumPy
//! array.

use super::Understood;
use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::followers;
use super::header::{self, Named};
use super::options::{JointOrder, Options, QuaternionOrder};
use super::report::{Basis, Finding, Format, Topic};
use super::robot::{ROOT, Usual, columns_error, fps_of, robot_of, rows_of, understand};
use super::table::Table;
use super::text;
use crate::files::NumpyError;
use crate::files::npz::read_array;

/// Names of a first column of times, and of one that only counts.
const TIMES: [&str; 5] = ["time", "t", "timestamp", "time_s", "seconds"];
const TIMES_MS: [&str; 5] = ["time_ms", "t_ms", "timestamp_ms", "ms", "milliseconds"];
const COUNTERS: [&str; 4] = ["frame", "index", "frame_index", ""];
/// Steps that are milliseconds: nothing moves at so few frames a second if they were seconds.
const STEPS_MS: std::ops::RangeInclusive<f64> = 5.0..=50.0;
/// Largest difference between steps of a column of times, by their mean.
const STEP_TOLERANCE: f64 = 0.02;
/// Farthest that a time may be from where even steps have it, in steps.
const GRID_TOLERANCE: f64 = 0.1;
/// A rate that is as near to a whole number is that number, as in BVH.
const RATE_TOLERANCE: f64 = 5e-4;

pub(super) fn read_csv(file: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadErrorKind> {
    let (skeleton, robot) = robot_of(options)?;
    let text = text::decode(bytes);
    let mut table = Table::parse(&text.text)?;
    let expected = ROOT + robot.hinges().len();
    if let Some(header) = &table.header {
        header::refuse_angles(header, robot, skeleton)?;
    }
    let all = table.columns;
    let mut stated = None;
    if table.columns == expected + 1 {
        stated = without_first(&mut table, options)?;
    }
    let dropped = all - table.columns;
    let mut far_rad = None;
    if table.columns != expected && table.header.is_none() {
        far_rad = followers::take_out(&mut table.numbers, table.columns, robot, options);
    }
    if far_rad.is_some() {
        table.columns = expected;
    }
    if table.columns != expected {
        return Err(columns_error(table.columns, robot, skeleton));
    }
    let named = match &table.header {
        Some(header) => header::read(header, dropped, robot, skeleton, options)?,
        None => Named::default(),
    };
    if let Some(columns) = named.root {
        let columns = header::in_order(columns, options.quaternion);
        for row in table.numbers.chunks_exact_mut(expected) {
            let found = columns.map(|column| row[column]);
            row[..ROOT].copy_from_slice(&found);
        }
    }
    let evidence = match (&named.hinges, &table.header) {
        (Some(_), _) => "a row has the root and the hinges, which its header names",
        (None, Some(_)) => "a row has the root and as many angles as the robot has hinges, under a header",
        (None, None) => "a row has the root and as many angles as the robot has hinges",
    };
    let usual = Usual {
        format: Finding::new(Format::RobotCsv, Basis::Found, evidence),
        producer: None,
        quaternion: QuaternionOrder::Xyzw,
        is_quaternion_fixed: named.root.is_some(),
        is_order_fixed: named.hinges.is_some(),
        order: named.hinges.map_or(JointOrder::Tree, JointOrder::Named),
        fps: fps_of(options, stated),
        first_column: ROOT + dropped + 1,
    };
    let mut understood = understand(file, rows_of(&table.numbers, table.columns), usual, options)?;
    if let Some(far_rad) = far_rad {
        followers::note(&far_rad, robot, skeleton, &mut understood.report);
    }
    if let Some(note) = text.note {
        understood.report.repaired(Topic::Encoding, note);
    }
    Ok(understood)
}

/// An array of `qpos`, w x y z as in MuJoCo.
pub(super) fn read_qpos(file: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadErrorKind> {
    let (skeleton, robot) = robot_of(options)?;
    let (shape, numbers) = read_array(bytes).map_err(|reason| NumpyError::array("qpos", reason))?;
    let expected = ROOT + robot.hinges().len();
    let [_, columns] = shape[..] else {
        let reason = format!("shape {shape:?}; it must be frames, {expected}");
        return Err(NumpyError::array("qpos", reason).into());
    };
    let columns = columns as usize;
    if let Some(at) = numbers.iter().position(|n| !n.is_finite()) {
        let reason = format!("row {} is not finite", at / columns.max(1));
        return Err(NumpyError::array("qpos", reason).into());
    }
    let mut numbers: Vec<f64> = numbers.into_iter().map(f64::from).collect();
    let far_rad = followers::take_out(&mut numbers, columns, robot, options);
    if columns != expected && far_rad.is_none() {
        return Err(columns_error(columns, robot, skeleton));
    }
    let evidence = format!("an array of frames, {expected}");
    let usual = Usual {
        format: Finding::new(Format::Qpos, Basis::Found, evidence),
        producer: None,
        quaternion: QuaternionOrder::Wxyz,
        is_quaternion_fixed: false,
        is_order_fixed: false,
        order: JointOrder::Tree,
        fps: fps_of(options, None),
        first_column: ROOT + 1,
    };
    let mut understood = understand(file, rows_of(&numbers, expected), usual, options)?;
    if let Some(far_rad) = far_rad {
        followers::note(&far_rad, robot, skeleton, &mut understood.report);
    }
    Ok(understood)
}

/// Removes a first column of times or counts. Returns the rate that it shows.
///
/// # Errors
/// [`ReadErrorKind::Range`] if the header names times that show no rate, and no option gives one.
fn without_first(table: &mut Table, options: &Options) -> Result<Option<Finding<f32>>, ReadErrorKind> {
    let column: Vec<f64> = table.numbers.iter().copied().step_by(table.columns).collect();
    let name = table.header.as_ref().map(|header| header[0].to_ascii_lowercase());
    let is_named = |names: &[&str]| name.as_deref().is_some_and(|name| names.contains(&name));
    let is_time = is_named(&TIMES) || is_named(&TIMES_MS);
    let stated = rate_of(&column, is_named(&TIMES_MS), is_time);
    let is_dropped = match name {
        None => stated.is_some(),
        Some(_) => is_time || is_named(&COUNTERS),
    };
    if !is_dropped {
        return Ok(None);
    }
    if is_time && stated.is_none() && column.len() > 1 && options.fps.is_none() {
        let steps = || column.windows(2).map(|pair| pair[1] - pair[0]);
        let (least, most) = (
            steps().fold(f64::INFINITY, f64::min),
            steps().fold(-f64::INFINITY, f64::max),
        );
        return Err(ReadErrorKind::Range {
            field: format!("the step of column {:?}", name.unwrap_or_default()),
            found: format!("{least:.4} to {most:.4}"),
            allowed: "even steps of 0.001 s to 1 s, or of 5 ms to 50 ms".to_owned(),
            option: Some(Advice::decides(Choice::any(OptionName::Fps))),
        });
    }
    let columns = table.columns;
    table.numbers = table
        .numbers
        .chunks_exact(columns)
        .flat_map(|row| row[1..].to_vec())
        .collect();
    table.columns -= 1;
    table.header = table.header.take().map(|header| header[1..].to_vec());
    Ok(stated.filter(|_| !is_named(&COUNTERS)))
}

/// The rate of a column of times, if they rise evenly. Only a column that is named as times may be
/// in milliseconds.
fn rate_of(times: &[f64], is_ms: bool, is_time: bool) -> Option<Finding<f32>> {
    let [first, .., last] = times else {
        return None;
    };
    let step = (last - first) / (times.len() - 1) as f64;
    // Rounded times do not rise by equal steps, but stay near those that do.
    let grid = times.iter().enumerate();
    let far = grid
        .map(|(row, time)| (time - (first + row as f64 * step)).abs())
        .fold(0.0, f64::max);
    let mut steps = times.windows(2).map(|pair| pair[1] - pair[0]);
    let is_even = far <= GRID_TOLERANCE * step || steps.all(|of| (of - step).abs() <= STEP_TOLERANCE * step);
    let unit_s = match is_ms || (is_time && STEPS_MS.contains(&step)) {
        true => 0.001,
        false => 1.0,
    };
    let step_s = step * unit_s;
    if !is_even || !(0.001..1.0).contains(&step_s) {
        return None;
    }
    let fps = 1.0 / step_s;
    // Rounded times leave open as much of the rate as they are off.
    let off = far.min(GRID_TOLERANCE * step);
    let tolerance = RATE_TOLERANCE + 2.0 * off / (last - first);
    let fps = match (fps - fps.round()).abs() <= tolerance * fps {
        true => fps.round(),
        false => fps,
    };
    let text = match unit_s < 1.0 {
        true => format!("the first column rises by {step:.2} ms a row"),
        false => format!("the first column rises by {step:.4} s a row"),
    };
    Some(Finding::new(fps as f32, Basis::Stated, text))
}
