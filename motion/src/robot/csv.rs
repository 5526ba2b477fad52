//! Motion of a robot as Unitree publishes it: CSV without a header, a frame a row. The root's `x y
//! z` (metres) and `qx qy qz qw` come first, in ROS axes, then the angles of the hinges in their
//! order, radians. The file knows no rate.

use std::fmt::Write as _;
use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{Fitted, Robot};
use crate::clip::{Clip, ClipError, MAX_FRAMES, MAX_ROTATIONS};
use crate::conventions::Convention;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

/// Columns before the angles.
pub const ROOT_COLUMNS: usize = 7;
/// How far a rotation may be from unit length: six digits are written.
const UNIT_TOLERANCE: f32 = 1e-3;

/// Why a robot's CSV was not read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The skeleton has no hinges.
    #[error("the skeleton is no robot's: it has no hinges that columns could be angles of")]
    NoRobot,
    /// A row with another number of columns.
    #[error("line {line}: {found} columns; robot {robot} has {expected}: 7 of the root and {} angles", expected - ROOT_COLUMNS)]
    Columns {
        /// Counted from 1.
        line: usize,
        /// Its columns.
        found: usize,
        /// The robot's.
        expected: usize,
        /// The robot's name.
        robot: String,
    },
    /// A value that is no finite number.
    #[error("line {line}, column {column}: {found:?} is no finite number")]
    Number {
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
        /// What is there, or its beginning.
        found: String,
    },
    /// A rotation of the root that is not of unit length.
    #[error("line {line}: the root's rotation, columns 4 to 7, has length {length}; allowed: 0.999 to 1.001")]
    Rotation {
        /// Counted from 1.
        line: usize,
        /// Its length.
        length: f32,
    },
    /// More than [`MAX_FRAMES`] rows, or [`MAX_ROTATIONS`] rotations.
    #[error("line {line}: too many frames")]
    TooLong {
        /// Counted from 1.
        line: usize,
    },
    /// No rows, or a rate that is none.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

/// Reads a CSV as a clip of `fps` frames a second (Unitree's have 30). Empty lines are passed over.
/// Angles are taken as they are, also outside of the hinges' limits.
///
/// # Errors
/// [`CsvError`], with the line that is wrong.
pub fn read_csv(text: &str, skeleton: &Arc<Skeleton>, fps: f32) -> Result<Clip, CsvError> {
    let robot = skeleton.robot.as_ref().ok_or(CsvError::NoRobot)?;
    let joints = skeleton.joint_count();
    let mut row = vec![0.0; ROOT_COLUMNS + robot.hinges().len()];
    let (mut roots, mut rotations) = (Vec::new(), Vec::new());
    for (line, text) in (1..).zip(text.lines()) {
        if text.trim().is_empty() {
            continue;
        }
        if roots.len() >= MAX_FRAMES.min(MAX_ROTATIONS / joints) {
            return Err(CsvError::TooLong { line });
        }
        read_row(line, text, robot, &mut row)?;
        let rotation = Quat::from_xyzw(row[3], row[4], row[5], row[6]);
        let length = rotation.length();
        // NaN is none either.
        if (length - 1.0).abs() > UNIT_TOLERANCE || length.is_nan() {
            return Err(CsvError::Rotation { line, length });
        }
        roots.push(Convention::Ros.position_to_native(Vec3::new(row[0], row[1], row[2])));
        let from = rotations.len();
        rotations.resize(from + joints, Quat::IDENTITY);
        let rotation = Convention::Ros.rotation_to_native(rotation / length);
        robot.pose(rotation, &row[ROOT_COLUMNS..], &mut rotations[from..]);
    }
    Ok(Clip::new(Arc::clone(skeleton), fps, roots, rotations)?)
}

fn read_row(line: usize, text: &str, robot: &Robot, row: &mut [f32]) -> Result<(), CsvError> {
    let found = text.split(',').count();
    if found != row.len() {
        return Err(CsvError::Columns {
            line,
            found,
            expected: row.len(),
            robot: robot.name().to_owned(),
        });
    }
    for (column, (text, value)) in (1..).zip(text.split(',').zip(row)) {
        *value = match text.trim().parse::<f32>() {
            Ok(number) if number.is_finite() => number,
            _ => {
                let found = text.trim().chars().take(32).collect();
                return Err(CsvError::Number { line, column, found });
            }
        };
    }
    Ok(())
}

/// Writes a clip as CSV, on the hinges and within their limits ([`Robot::fit`]), with six digits
/// behind the point.
///
/// # Errors
/// [`CsvError::NoRobot`].
pub fn write_csv(clip: &Clip) -> Result<String, CsvError> {
    let robot = clip.skeleton.robot.as_ref().ok_or(CsvError::NoRobot)?;
    let mut fitted = Fitted::default();
    let mut pose = vec![Quat::IDENTITY; clip.skeleton.joint_count()];
    let mut text = String::new();
    let mut before = Quat::IDENTITY;
    for (frame, &root) in clip.root_positions.iter().enumerate() {
        pose.copy_from_slice(clip.rotations_at(frame));
        robot.fit(&mut pose, &mut fitted);
        let place = Convention::Ros.position_from_native(root).to_array();
        // One who reads the columns as curves sees no jump to the other sign.
        let rotation = align_sign(Convention::Ros.rotation_from_native(pose[0]), before);
        before = rotation;
        let numbers = place.into_iter().chain(rotation.to_array());
        for (nth, number) in numbers.chain(fitted.angles.iter().copied()).enumerate() {
            let comma = if nth == 0 { "" } else { "," };
            // Writing to a string does not fail.
            let _ = write!(text, "{comma}{number:.6}");
        }
        text.push('\n');
    }
    Ok(text)
}
