//! Joints that slide in their parents.

use super::error::ReadErrorKind;
use super::options::Options;
use super::report::{Report, Topic, listed};
use super::survey::Survey;
use crate::anatomy::Tree;

/// A joint that slides less in its parent slides little, metres.
const MIN_SLIDE_M: f64 = 0.005;
/// As [`MIN_SLIDE_M`], by the body's height.
const SLIDE_BY_HEIGHT: f64 = 0.02;
/// Distance by the body's height beyond which a joint does not slide, but travels. Figures of games
/// stretch their arms by a tenth.
const TRAVEL_BY_HEIGHT: f64 = 0.2;
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
    let tree = &survey.tree;
    let slides = Slides::new(survey, names, size_m, report.unit_m.value, options);
    let mut below = tree.below(root);
    below[root] = false;
    let is_steered = (0..names.len()).any(|joint| {
        below[joint] && slides.slide_m(joint) > slides.allowed_m && slides.loads.only_steers[joint]
    });
    let mut left_out = vec![false; names.len()];
    let mut held = Vec::new();
    let mut bystanders = Vec::new();
    for joint in (0..names.len()).filter(|&joint| below[joint]) {
        let slide_m = slides.slide_m(joint);
        left_out[joint] = tree.parents[joint].is_some_and(|parent| left_out[parent]);
        if left_out[joint] || slide_m <= slides.still_m {
            continue;
        }
        let is_helper = tree.names[joint].is_helper() && slide_m > slides.little_m;
        let steers = is_steered && slides.loads.only_steers[joint];
        match slides.loads.carried(joint).filter(|_| !steers) {
            carries if slide_m <= slides.allowed_m && !(is_helper && carries.is_none()) => {
                held.push((slide_m, joint))
            }
            Some(carries) => return Err(slides.too_far(joint, carries)),
            None => {
                left_out[joint] = true;
                bystanders.push(format!("{} ({slide_m:.2} m)", names[joint]));
            }
        }
    }
    slides.note(held, "mean place", report);
    if !bystanders.is_empty() {
        let text = format!(
            "left out, since they travel in their parents and carry nothing: {}",
            listed(&bystanders)
        );
        report.repaired(Topic::Bystanders, text);
    }
    Ok(left_out)
}

/// As [`hold_slides`] on a given skeleton, whose joints are `taken` of the file and hang on
/// `parents`. All are held in the skeleton's places, and none is left out.
pub(super) fn hold_slides_on(
    survey: &Survey,
    names: &[String],
    (taken, parents): (&[usize], &[Option<usize>]),
    size_m: f64,
    options: &Options,
    report: &mut Report,
) -> Result<(), ReadErrorKind> {
    let slides = Slides::new(survey, names, size_m, report.unit_m.value, options);
    // The skeleton's joints below its root, and those that are folded into them.
    let mut is_on = vec![false; names.len()];
    for (&joint, parent) in taken.iter().zip(parents) {
        let parent = parent.map(|parent| taken[parent]);
        let chain = parent.and_then(|parent| survey.tree.chain(parent, joint));
        let below_parent = chain.iter().flat_map(|chain| &chain[1..]);
        below_parent.for_each(|&joint| is_on[joint] = true);
    }
    let mut held = Vec::new();
    for joint in (0..names.len()).filter(|&joint| is_on[joint]) {
        let slide_m = slides.slide_m(joint);
        if slide_m <= slides.still_m {
            continue;
        }
        let carried = slides.loads.carried(joint);
        match carried.filter(|_| slide_m > slides.allowed_m && !slides.loads.only_steers[joint]) {
            Some(carries) => return Err(slides.too_far(joint, carries)),
            None => held.push((slide_m, joint)),
        }
    }
    slides.note(held, "place on the skeleton", report);
    Ok(())
}

/// How far a file's joints slide, and how far they may.
struct Slides<'a> {
    survey: &'a Survey,
    names: &'a [String],
    loads: Loads<'a>,
    /// Metres a unit of the file.
    unit_m: f64,
    /// Distance up to which a joint is still, metres.
    still_m: f64,
    /// Distance up to which a joint slides little, metres.
    little_m: f64,
    /// Distance up to which a joint that carries something is held, metres.
    allowed_m: f64,
}

impl<'a> Slides<'a> {
    fn new(survey: &'a Survey, names: &'a [String], size_m: f64, unit_m: f64, options: &Options) -> Self {
        Self {
            survey,
            names,
            loads: Loads::new(survey, names),
            unit_m,
            still_m: STILL_BY_HEIGHT * size_m,
            little_m: little_slide_m(size_m),
            allowed_m: options.max_slide_m.map_or(TRAVEL_BY_HEIGHT * size_m, f64::from),
        }
    }

    /// Distance of a joint from its first place in its parent, metres.
    fn slide_m(&self, joint: usize) -> f64 {
        self.survey.slides[joint].0 * self.unit_m
    }

    fn too_far(&self, joint: usize, carries: String) -> ReadErrorKind {
        ReadErrorKind::Slides {
            joint: self.names[joint].clone(),
            slide_m: self.slide_m(joint) as f32,
            frame: self.survey.slides[joint].1,
            carries,
            allowed_m: self.allowed_m as f32,
        }
    }

    /// Notes joints that are held, each with its distance in metres.
    fn note(&self, mut held: Vec<(f64, usize)>, place: &str, report: &mut Report) {
        held.sort_by(|a, b| b.0.total_cmp(&a.0));
        let far = held.partition_point(|&(slide_m, _)| slide_m > self.little_m);
        if far > 0 {
            let named = held[..far].iter();
            let named: Vec<String> = named
                .map(|&(slide_m, joint)| format!("{} by {slide_m:.2} m", self.names[joint]))
                .collect();
            let text = format!(
                "joints slide far in their parents: {}; each is held in its {place}",
                listed(&named)
            );
            report.odd(Topic::Sliding, text);
        }
        if let Some(&(most_m, joint)) = held.get(far) {
            let text = format!(
                "joints that slide in their parents by up to {:.1} mm are held in their {}: {}, the farthest is {}",
                1e3 * most_m,
                place.replacen("place", "places", 1),
                held.len() - far,
                self.names[joint]
            );
            report.repaired(Topic::Sliding, text);
        }
    }
}

/// What hangs on a file's joints.
struct Loads<'a> {
    names: &'a [String],
    /// Whether a joint and all that hang on it steer the rig, and are not of the body.
    only_steers: Vec<bool>,
    /// How many joints hang on each, and the first of them.
    below: Vec<(usize, Option<usize>)>,
    /// Ends of the body's limbs, each with the joints that it is or hangs on. None if the body is
    /// not found by names.
    parts: Option<Vec<(usize, Vec<bool>)>>,
}

impl<'a> Loads<'a> {
    fn new(survey: &Survey, names: &'a [String]) -> Self {
        let tree = &survey.tree;
        let mut only_steers: Vec<bool> = tree.names.iter().map(|name| name.is_steering()).collect();
        let mut below = vec![(0, None); names.len()];
        // Children come after their parents.
        for joint in (0..names.len()).rev() {
            if let Some(parent) = tree.parents[joint] {
                only_steers[parent] &= only_steers[joint];
                below[parent] = (below[parent].0 + 1 + below[joint].0, Some(joint));
            }
        }
        let parts = survey.body.as_ref().map(|body| {
            let arms = body.arms.iter().flatten().map(|arm| arm[2]);
            let legs = body.feet.into_iter().chain(body.hips);
            let parts = legs.chain([body.head]).chain(arms);
            parts.map(|part| (part, line_of(tree, part))).collect()
        });
        Self {
            names,
            only_steers,
            below,
            parts,
        }
    }

    /// What of the body hangs on a joint, as the end of a sentence; none if it may be left out.
    fn carried(&self, joint: usize) -> Option<String> {
        let (below, first_below) = self.below[joint];
        let (count, first) = match &self.parts {
            Some(parts) => {
                let mut hanging = parts.iter().filter(|(_, line)| line[joint]);
                let first = hanging.next().map(|&(part, _)| part);
                (usize::from(first.is_some()) + hanging.count(), first)
            }
            // Without names, every joint with others below it may carry a limb.
            None => (below, first_below),
        };
        match (first, count) {
            (None, _) if below < LIMB_JOINTS => None,
            (None, _) => Some(format!("{below} joints hang")),
            (Some(only), 1) => Some(format!("{} hangs", self.names[only])),
            (Some(first), count) => Some(format!("{} and {} more hang", self.names[first], count - 1)),
        }
    }
}

/// For each joint, whether it is this one or above it.
fn line_of(tree: &Tree, joint: usize) -> Vec<bool> {
    let mut is_on = vec![false; tree.parents.len()];
    tree.line(joint).for_each(|above| is_on[above] = true);
    is_on
}
