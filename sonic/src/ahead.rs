//! The frames of a session from now on, 50 a second.

use troupe_client::{Frame, Frames};
use troupe_motion::robot::{ROOT_QPOS, Robot};

use crate::row::{Row, mix};
use crate::wire::HINGES;

/// Parts of a frame of a session's timeline, which has 30 a second.
const PARTS: u64 = 5;
/// Parts from one frame at 50 Hz to the next.
const STEP: u64 = 3;

/// The rows of frames, whose poses are on the hinges.
pub(crate) fn rows_of(robot: &Robot, frames: &Frames<'_>) -> Vec<Row> {
    let mut angles = [0.0; HINGES];
    let row = |frame: Frame<'_>| {
        for (angle, hinge) in angles.iter_mut().zip(robot.hinges()) {
            *angle = hinge.limited(hinge.angle_of(frame.rotations[hinge.joint]));
        }
        let mut row = [0.0; ROOT_QPOS + HINGES];
        robot.write_qpos(frame.root, frame.rotations[0], &angles, &mut row);
        row
    };
    frames.iter().map(row).collect()
}

/// Rows at 50 Hz after one that was shown `stepped` ticks after the start of a session, from rows
/// at 30 Hz. `start` is the frame at which the session began, `first` that of the first row.
pub(crate) fn resample(start: u64, stepped: u64, shown: &Row, first: u64, coming: &[Row]) -> Vec<Row> {
    let now = start * PARTS + stepped * STEP;
    let next = (first * PARTS).max(now + 1);
    let mut rows = Vec::new();
    for place in (1..).map(|nth| now + nth * STEP) {
        let row = match place.checked_sub(next) {
            // Between the row that is shown and the next whole frame.
            None => {
                let way = (place - now) as f32 / (next - now) as f32;
                coming.first().map(|next| mix(shown, next, way))
            }
            Some(parts) => between(coming, parts),
        };
        match row {
            Some(row) => rows.push(row),
            None => break,
        }
    }
    rows
}

/// The frame at which a session began, if `first` is the next whole one `stepped` ticks later.
pub(crate) fn start(stepped: u64, first: u64) -> u64 {
    first.saturating_sub(stepped * STEP / PARTS + 1)
}

/// The row some parts after the first of rows at 30 Hz.
fn between(rows: &[Row], parts: u64) -> Option<Row> {
    let (at, rest) = ((parts / PARTS) as usize, parts % PARTS);
    let from = rows.get(at)?;
    match rest {
        0 => Some(*from),
        _ => Some(mix(from, rows.get(at + 1)?, rest as f32 / PARTS as f32)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::tests::row;

    /// Rows at 30 Hz whose x is their frame.
    fn frames(first: u64, count: u64) -> Vec<Row> {
        (first..first + count)
            .map(|frame| row(frame as f32, 0.0, 0.1))
            .collect()
    }

    #[test]
    fn ticks_lie_between_frames() {
        // A session that began at frame 7 is at 7 + 0.6 n after n ticks.
        for stepped in 0..12 {
            let now = 7.0 + 0.6 * stepped as f32;
            let first = now as u64 + 1;
            assert_eq!(start(stepped, first), 7);
            let rows = resample(7, stepped, &row(now, 0.0, 0.1), first, &frames(first, 10));
            let last = (first + 9) as f32;
            assert_eq!(rows.len(), ((last - now) / 0.6 + 1e-3) as usize);
            for (nth, row) in rows.iter().enumerate() {
                let wanted = now + 0.6 * (nth + 1) as f32;
                assert!((row[0] - wanted).abs() < 1e-4, "{} instead of {wanted}", row[0]);
            }
        }
    }

    #[test]
    fn a_session_without_a_future_has_no_rows() {
        let rows = |coming: &[Row]| resample(0, 3, &row(1.8, 0.0, 0.1), 2, coming).len();
        assert_eq!((rows(&[]), rows(&frames(2, 1))), (0, 0));
    }
}
