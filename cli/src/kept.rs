//! What a character keeps of a motion: the table of figures, and what is beyond the bar.

use std::ops::Range;

use comfy_table::Table;
use troupe_motion::Quat;
use troupe_motion::clip::{Clip, ClipError};
use troupe_motion::retarget::{Certificate, Figures, Retargeter};

use crate::output;
use crate::term::plain;

/// Faults of the certificate that a message has at most.
const MOST_FAULTS: usize = 4;

/// The figures as a table.
pub(crate) fn table(figures: &Figures, certificate: &Certificate) -> Table {
    let mut table = output::table();
    table.set_header(["what is kept", "value"]);
    for (what, value) in figures.rows() {
        table.add_row([what, &value]);
    }
    let trials = &certificate.trials;
    let passed = trials
        .iter()
        .filter(|trial| trial.figures.faults().is_empty())
        .count();
    let share = format!("{passed} of {}", trials.len());
    table.add_row(["built-in motions within the bar", &share]);
    table
}

/// The first faults of a certificate, and how many more it has.
pub(crate) fn shortened(mut faults: Vec<String>) -> Vec<String> {
    let more = faults.len().saturating_sub(MOST_FAULTS);
    faults.truncate(MOST_FAULTS);
    let mut faults: Vec<String> = faults.iter().map(|fault| plain(fault)).collect();
    if more > 0 {
        faults.push(format!("{more} more faults of the built-in motions"));
    }
    faults
}

/// The faults of a clip and what was made of it. Those of single frames say which frames.
///
/// # Errors
/// [`ClipError`] if the two have other lengths.
pub(crate) fn faults(
    retargeter: &mut Retargeter,
    clips: [&Clip; 2],
    figures: &Figures,
) -> Result<Vec<String>, ClipError> {
    let mut faults: Vec<String> = figures.faults().iter().map(|fault| plain(fault)).collect();
    // What is allowed depends on the legs.
    let leg_m = figures.leg_m;
    let under = |under_m: f32| Figures {
        under_m,
        leg_m,
        ..Figures::default()
    };
    let short = |short_m: f32| Figures {
        short_m,
        leg_m,
        ..Figures::default()
    };
    let fps = clips[0].fps;
    if is_beyond(&under(figures.under_m)) {
        let depths = depths(retargeter, clips)?;
        faults.extend(frames("feet are under the ground", &depths, under, fps));
    }
    if is_beyond(&short(figures.short_m)) {
        let distances = distances(retargeter, clips[0]);
        faults.extend(frames("feet are short of their places", &distances, short, fps));
    }
    Ok(faults)
}

fn is_beyond(figures: &Figures) -> bool {
    !figures.faults().is_empty()
}

/// In how many frames a figure is beyond the bar, and when most.
fn frames(what: &str, values: &[f32], of: impl Fn(f32) -> Figures, fps: f32) -> Option<String> {
    let count = values.iter().filter(|value| is_beyond(&of(**value))).count();
    let (worst, _) = values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    (count > 0).then(|| {
        format!(
            "{what} in {count} of {} frames, most at {:.2} s (frame {worst})",
            values.len(),
            worst as f32 / fps
        )
    })
}

/// How deep feet are under the ground in each frame, metres.
fn depths(retargeter: &Retargeter, clips: [&Clip; 2]) -> Result<Vec<f32>, ClipError> {
    let depth = |frames: Range<usize>| {
        let [from, to] = clips;
        let (from, to) = (from.slice(frames.clone())?, to.slice(frames)?);
        Ok(Figures::of(retargeter.figures(), [&from, &to], (0.0, None)).under_m)
    };
    (0..clips[0].frames())
        .map(|frame| depth(frame..frame + 1))
        .collect()
}

/// How far feet remain from their places in each frame, metres.
fn distances(retargeter: &mut Retargeter, clip: &Clip) -> Vec<f32> {
    let mut pose = vec![Quat::IDENTITY; retargeter.figures()[1].skeleton().joint_count()];
    retargeter.reset();
    retargeter.set_step(1.0 / clip.fps);
    let distance = |frame: usize| {
        retargeter.pose(clip.root_positions[frame], clip.rotations_at(frame), &mut pose);
        retargeter.short_m()
    };
    (0..clip.frames()).map(distance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_beyond_the_bar_are_counted_and_the_worst_has_a_time() {
        let of = |under_m: f32| Figures {
            under_m,
            leg_m: 0.8,
            ..Figures::default()
        };
        // The bar is 2 cm.
        let text = frames("feet are under the ground", &[0.0, 0.03, 0.01, 0.05], of, 10.0);
        assert_eq!(
            text.as_deref(),
            Some("feet are under the ground in 2 of 4 frames, most at 0.30 s (frame 3)")
        );
        assert_eq!(frames("feet are under the ground", &[0.01], of, 10.0), None);
        assert_eq!(frames("feet are under the ground", &[], of, 10.0), None);
    }

    #[test]
    fn names_of_joints_in_faults_are_plain_and_many_are_cut() {
        let faults = (0..6).map(|nth| format!("foot\u{1b}[31m {nth}")).collect();
        let faults = shortened(faults);
        assert_eq!(faults[0], "foot\\u{1b}[31m 0");
        assert_eq!(faults[4], "2 more faults of the built-in motions");
    }
}
