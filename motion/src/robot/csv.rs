//! Motion of a robot as Unitree publishes it: CSV without a header, a frame a row. First come the
//! root's `x y z` (metres) and `qx qy qz qw`, in ROS axes, then the hinges' angles in their order,
//! radians. The file has no frame rate.

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
/// Largest difference of a rotation from unit length: files have six digits.
const UNIT_TOLERANCE: f32 = 1e-3;

/// Why a robot's CSV was not read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The skeleton has no hinges.
    #[error("the skeleton is no robot's: it has no hinges that columns could be angles of")]
    NoRobot,
    /// A row has another number of columns.
    #[error(
        "line {line}: {found} columns; robot {robot} has {expected}: 7 of the root and {} angles",
        expected - ROOT_COLUMNS
    )]
    Columns {
        /// Number of the line, from 1.
        line: usize,
        /// Number of columns in the row.
        found: usize,
        /// Number of columns for the robot.
        expected: usize,
        /// Name of the robot.
        robot: String,
    },
    /// A value is not a finite number.
    #[error("line {line}, column {column}: {found:?} is no finite number")]
    Number {
        /// Number of the line, from 1.
        line: usize,
        /// Number of the column, from 1.
        column: usize,
        /// The value, or its beginning.
        found: String,
    },
    /// The root's rotation is not of unit length.
    #[error("line {line}: the root's rotation, columns 4 to 7, has length {length}; allowed: 0.999 to 1.001")]
    Rotation {
        /// Number of the line, from 1.
        line: usize,
        /// Length of the rotation.
        length: f32,
    },
    /// More than [`MAX_FRAMES`] rows, or [`MAX_ROTATIONS`] rotations.
    #[error("line {line}: too many frames")]
    TooLong {
        /// Number of the line, from 1.
        line: usize,
    },
    /// There are no rows, or the rate is invalid.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

/// Reads a CSV text as a clip at `fps` frames a second (Unitree's have 30). Empty lines are
/// skipped. Angles are not limited.
///
/// # Errors
/// [`CsvError`], with the line at fault.
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
        // Rejects NaN too.
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

/// Writes a clip as CSV, on the hinges and within their limits ([`Robot::fit`]), with six decimals.
///
/// # Errors
/// [`CsvError::NoRobot`] if the skeleton has no hinges.
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
        // So that readers who plot the columns see no jump of the sign.
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
