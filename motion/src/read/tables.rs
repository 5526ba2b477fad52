//! Robots' CSV: Unitree's, Kimodo's, ARDY's and MuJoCo's `qpos` as text, and `qpos` as a NumPy
//! array.

use super::Understood;
use super::error::ReadErrorKind;
use super::options::{JointOrder, Options, QuaternionOrder};
use super::report::{Basis, Finding, Format, Topic};
use super::robot::{ROOT, Usual, columns_error, fps_of, robot_of, rows_of, understand};
use super::robot_checks::hinge_named;
use super::table::Table;
use super::text;
use crate::files::NumpyError;
use crate::files::npz::read_array;
use crate::robot::Robot;
use crate::skeleton::Skeleton;

/// Names of a first column of times, and of one that only counts.
const TIMES: [&str; 5] = ["time", "t", "timestamp", "time_s", "seconds"];
const COUNTERS: [&str; 4] = ["frame", "index", "frame_index", ""];
/// Largest difference between steps of a column of times, by their mean.
const STEP_TOLERANCE: f64 = 0.02;

pub(super) fn read_csv(file: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadErrorKind> {
    let (skeleton, robot) = robot_of(options)?;
    let text = text::decode(bytes);
    let mut table = Table::parse(&text.text)?;
    let expected = ROOT + robot.hinges().len();
    let mut stated = None;
    if table.columns == expected + 1 {
        stated = without_first(&mut table);
    }
    if table.columns != expected {
        return Err(columns_error(table.columns, robot));
    }
    let named = table
        .header
        .as_ref()
        .and_then(|header| named(&header[ROOT..], robot, skeleton));
    let evidence = match (&named, &table.header) {
        (Some(_), _) => "a row has the root and the hinges, which its header names",
        (None, Some(_)) => "a row has the root and as many angles as the robot has hinges, under a header",
        (None, None) => "a row has the root and as many angles as the robot has hinges",
    };
    let usual = Usual {
        format: Finding::new(Format::RobotCsv, Basis::Found, evidence),
        producer: None,
        quaternion: quaternion_of(table.header.as_deref()).unwrap_or(QuaternionOrder::Xyzw),
        is_fixed: quaternion_of(table.header.as_deref()).is_some(),
        order: named.map_or(JointOrder::Tree, JointOrder::Named),
        fps: fps_of(options, stated),
        first_column: ROOT + 1,
    };
    let mut understood = understand(file, rows_of(&table.numbers, table.columns), usual, options)?;
    if let Some(note) = text.note {
        understood.report.repaired(Topic::Encoding, note);
    }
    Ok(understood)
}

/// An array of `qpos`, w x y z as in MuJoCo.
pub(super) fn read_qpos(file: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadErrorKind> {
    let (_, robot) = robot_of(options)?;
    let (shape, numbers) = read_array(bytes).map_err(|reason| NumpyError::array("qpos", reason))?;
    let expected = ROOT + robot.hinges().len();
    let [_, columns] = shape[..] else {
        let reason = format!("shape {shape:?}; it must be frames, {expected}");
        return Err(NumpyError::array("qpos", reason).into());
    };
    if columns as usize != expected {
        return Err(columns_error(columns as usize, robot));
    }
    if let Some(at) = numbers.iter().position(|n| !n.is_finite()) {
        let reason = format!("row {} is not finite", at / expected);
        return Err(NumpyError::array("qpos", reason).into());
    }
    let numbers: Vec<f64> = numbers.into_iter().map(f64::from).collect();
    let evidence = format!("an array of frames, {expected}");
    let usual = Usual {
        format: Finding::new(Format::Qpos, Basis::Found, evidence),
        producer: None,
        quaternion: QuaternionOrder::Wxyz,
        is_fixed: false,
        order: JointOrder::Tree,
        fps: fps_of(options, None),
        first_column: ROOT + 1,
    };
    understand(file, rows_of(&numbers, expected), usual, options)
}

/// The hinges' names in a header; none if they are not all there.
fn named(header: &[String], robot: &Robot, skeleton: &Skeleton) -> Option<Vec<String>> {
    let all = header
        .iter()
        .all(|name| hinge_named(name, robot, skeleton).is_some());
    all.then(|| header.to_vec())
}

/// The order of the quaternion that a header names: columns 4 to 7 end in x, y, z and w.
fn quaternion_of(header: Option<&[String]>) -> Option<QuaternionOrder> {
    let last = |name: &String| name.chars().last().map(|c| c.to_ascii_lowercase());
    let ends: Option<String> = header?.get(3..ROOT)?.iter().map(last).collect();
    match &*ends? {
        "xyzw" => Some(QuaternionOrder::Xyzw),
        "wxyz" => Some(QuaternionOrder::Wxyz),
        _ => None,
    }
}

/// Removes a first column of times or counts. Returns the rate that it shows.
fn without_first(table: &mut Table) -> Option<Finding<f32>> {
    let column: Vec<f64> = table.numbers.iter().copied().step_by(table.columns).collect();
    let name = table.header.as_ref().map(|header| header[0].to_ascii_lowercase());
    let is_named = |names: &[&str]| name.as_deref().is_some_and(|name| names.contains(&name));
    let steps: Vec<f64> = column.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let is_even = !steps.is_empty()
        && steps
            .iter()
            .all(|step| (step - mean).abs() <= STEP_TOLERANCE * mean);
    let is_time = (is_named(&TIMES) || name.is_none()) && is_even && (0.001..=1.0).contains(&mean);
    if !(is_time && mean < 1.0 || is_named(&COUNTERS) || is_named(&TIMES)) {
        return None;
    }
    let columns = table.columns;
    table.numbers = table
        .numbers
        .chunks_exact(columns)
        .flat_map(|row| row[1..].to_vec())
        .collect();
    table.columns -= 1;
    table.header = table.header.take().map(|header| header[1..].to_vec());
    let fps = (1.0 / mean) as f32;
    let fps = if (fps - fps.round()).abs() < 0.02 * fps {
        fps.round()
    } else {
        fps
    };
    is_time.then(|| {
        Finding::new(
            fps,
            Basis::Stated,
            format!("the first column rises by {mean:.4} s a row"),
        )
    })
}
