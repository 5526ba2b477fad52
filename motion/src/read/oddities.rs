//! What looks odd in a clip, and which of its joints touch the ground.

use super::report::{Basis, Finding, Report, Topic};
use crate::anatomy::Name;
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::inspect::{Issue, Limits, inspect};
use crate::skeleton::Skeleton;

/// Words of joints that touch the ground.
const CONTACTS: [&str; 5] = ["foot", "toe", "toes", "ankle", "toebase"];
/// A lowest joint that never comes lower hovers, metres.
const MAX_HOVER_M: f32 = 0.3;

/// The joints that touch the ground: those of the skeleton, or else by name.
pub(super) fn contacts(clip: &Clip) -> Finding<Vec<String>> {
    let name = |joint: &usize| clip.skeleton.joints[*joint].name.clone();
    match &clip.skeleton.contacts {
        Some(contacts) => {
            let names = contacts.joints.iter().map(name).collect();
            Finding::new(names, Basis::Stated, "as the skeleton says")
        }
        None => {
            let names: Vec<String> = named(&clip.skeleton).iter().map(name).collect();
            let evidence = match names.is_empty() {
                true => "no joint's name has foot, toe or ankle",
                false => "by name: foot, toe or ankle",
            };
            Finding::new(names, Basis::Found, evidence)
        }
    }
}

fn named(skeleton: &Skeleton) -> Vec<usize> {
    let is_contact = |joint: &usize| {
        let name = Name::of(&skeleton.joints[*joint].name);
        name.has_any(&CONTACTS) && !name.is_helper()
    };
    (0..skeleton.joint_count()).filter(is_contact).collect()
}

/// Whether all frames are the first.
fn is_still(clip: &Clip) -> bool {
    let roots = &clip.root_positions;
    (1..clip.frames())
        .all(|frame| roots[frame] == roots[0] && clip.rotations_at(frame) == clip.rotations_at(0))
}

/// Notes jumps, depths and heights that motion seldom has.
pub(super) fn note(clip: &Clip, report: &mut Report) {
    let limits = Limits {
        min_frames: 1,
        ..Limits::default()
    };
    for issue in inspect(clip, &limits) {
        let topic = match issue {
            Issue::BelowGround { .. } => Topic::Ground,
            _ => Topic::Speed,
        };
        report.odd(topic, issue.to_string());
    }
    if clip.frames() > 1 && is_still(clip) {
        let text = format!("nothing moves: all {} frames are equal", clip.frames());
        report.odd(Topic::Speed, text);
    }
    let world = WorldMotion::from_clip(clip);
    let lowest = world.positions.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
    let height_m = lowest - clip.skeleton.ground_y_m;
    if height_m > MAX_HOVER_M {
        let text = format!("no joint comes lower than {height_m:.2} m over the ground");
        report.odd(Topic::Ground, text);
    }
}
