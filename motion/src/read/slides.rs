//! Joints that slide in their parents.

use super::error::ReadErrorKind;
use super::options::Options;
use super::report::{Report, Topic};
use super::survey::Survey;

/// A joint that slides less in its parent slides little, metres.
const MIN_SLIDE_M: f64 = 0.005;
/// As [`MIN_SLIDE_M`], by the body's height.
const SLIDE_BY_HEIGHT: f64 = 0.02;
/// Distance by the body's height beyond which a joint does not slide, but travels. Figures of games
/// stretch their arms by a tenth.
const TRAVEL_BY_HEIGHT: f64 = 0.2;
/// Most joints that a note lists.
const LISTED: usize = 8;
/// As many joints below another are a limb: a finger has fewer.
const LIMB_JOINTS: usize = 4;
/// A joint that slides less does not slide, by the body's height.
const STILL_BY_HEIGHT: f64 = 1e-4;

/// Distance up to which a joint slides little, metres.
pub(super) fn little_slide_m(size_m: f64) -> f64 {
    (SLIDE_BY_HEIGHT * size_m).max(MIN_SLIDE_M)
}

/// Holds joints that slide in their mean place, and says so; those that slide far are named. A
/// joint that travels is left out if nothing of the body hangs on it. If one that steers the rig
/// travels, all that steer it and slide are left out. Returns which joints are left out.
pub(super) fn hold_slides(
    survey: &Survey,
    names: &[String],
    root: usize,
    size_m: f64,
    options: &Options,
    report: &mut Report,
) -> Result<Vec<bool>, ReadErrorKind> {
    let unit_m = report.unit_m.value;
    let tree = &survey.tree;
    let little_m = little_slide_m(size_m);
    let allowed_m = options.max_slide_m.map_or(TRAVEL_BY_HEIGHT * size_m, f64::from);
    let still_m = STILL_BY_HEIGHT * size_m;
    let below: Vec<bool> = (0..names.len())
        .map(|joint| joint != root && tree.line(joint).any(|above| above == root))
        .collect();
    let slide_m = |joint: usize| survey.slides[joint].0 * unit_m;
    let is_steered = (0..names.len())
        .any(|joint| below[joint] && slide_m(joint) > allowed_m && only_steers(survey, joint));
    let mut left_out = vec![false; names.len()];
    let mut held = Vec::new();
    let mut bystanders = Vec::new();
    for joint in (0..names.len()).filter(|&joint| below[joint]) {
        let slide_m = slide_m(joint);
        let is_out = tree.line(joint).any(|above| left_out[above]);
        if is_out || slide_m <= still_m {
            continue;
        }
        let is_helper = tree.names[joint].is_helper() && slide_m > little_m;
        let steers = is_steered && only_steers(survey, joint);
        match carried(survey, names, joint).filter(|_| !steers) {
            carries if slide_m <= allowed_m && !(is_helper && carries.is_none()) => {
                held.push((slide_m, joint))
            }
            Some(carries) => {
                return Err(ReadErrorKind::Slides {
                    joint: names[joint].clone(),
                    slide_m: slide_m as f32,
                    frame: survey.slides[joint].1,
                    carries,
                    allowed_m: allowed_m as f32,
                });
            }
            None => {
                left_out[joint] = true;
                bystanders.push(format!("{} ({slide_m:.2} m)", names[joint]));
            }
        }
    }
    held.sort_by(|a, b| b.0.total_cmp(&a.0));
    let far = held.partition_point(|&(slide_m, _)| slide_m > little_m);
    if far > 0 {
        let listed = held[..far].iter().take(LISTED);
        let listed: Vec<String> = listed
            .map(|&(slide_m, joint)| format!("{} by {slide_m:.2} m", names[joint]))
            .collect();
        let more = match far > LISTED {
            true => format!(" and {} more", far - LISTED),
            false => String::new(),
        };
        let text = format!(
            "joints slide far in their parents: {}{more}; each is held in its mean place",
            listed.join(", ")
        );
        report.odd(Topic::Sliding, text);
    }
    if let Some(&(most_m, joint)) = held.get(far) {
        let text = format!(
            "joints that slide in their parents by up to {:.1} mm are held in their mean places: {}, the farthest is {}",
            1e3 * most_m,
            held.len() - far,
            names[joint]
        );
        report.repaired(Topic::Sliding, text);
    }
    if !bystanders.is_empty() {
        let text = format!(
            "left out, since they travel in their parents and carry nothing: {}",
            bystanders.join(", ")
        );
        report.repaired(Topic::Bystanders, text);
    }
    Ok(left_out)
}

/// Whether a joint and all that hang on it steer the rig, and are not of the body.
fn only_steers(survey: &Survey, joint: usize) -> bool {
    let tree = &survey.tree;
    (0..tree.names.len())
        .filter(|&other| tree.line(other).any(|above| above == joint))
        .all(|other| tree.names[other].is_steering())
}

/// What of the body hangs on a joint, as the end of a sentence; none if it may be left out.
fn carried(survey: &Survey, names: &[String], joint: usize) -> Option<String> {
    let tree = &survey.tree;
    let hangs = |other: usize| tree.line(other).any(|above| above == joint);
    let parts: Vec<usize> = match &survey.body {
        Some(body) => {
            let arms = body.arms.iter().flatten().map(|arm| arm[2]);
            let legs = body.feet.into_iter().chain(body.hips);
            legs.chain([body.head]).chain(arms).collect()
        }
        // Without names, every joint with others below it may carry a limb.
        None => (0..names.len()).filter(|&other| other != joint).collect(),
    };
    let below = (0..names.len())
        .filter(|&other| other != joint && hangs(other))
        .count();
    let carried: Vec<&str> = parts
        .into_iter()
        .filter(|&part| hangs(part))
        .map(|part| &*names[part])
        .collect();
    match carried[..] {
        [] if below < LIMB_JOINTS => None,
        [] => Some(format!("{below} joints hang")),
        [only] => Some(format!("{only} hangs")),
        [first, ..] => Some(format!("{first} and {} more hang", carried.len() - 1)),
    }
}
