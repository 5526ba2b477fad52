//! Motion of words that ends where it should: at a place, or in given frames.
//!
//! A model of words says the poses, and its steps lead somewhere. Once the whole motion is there,
//! its root is bent to the place, or gets the way that is known for the gap. Then feet are held.

use troupe_motion::bend::{Place, bend_through, fastest_mps};
use troupe_motion::contacts::detect;
use troupe_motion::feasibility::Figure;
use troupe_motion::fk::{WorldMotion, world_transforms};
use troupe_motion::model::{Motion, Rig};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, SegmentFrame, Skeleton, Vec2};

use super::track::Track;
use crate::keyframe::Checked;
use crate::post::{NonFinite, bits_of, check_finite, hold_between, plant};

/// Most frames of the past, and behind a gap, that feet are held beside.
const BESIDE: usize = 8;
/// Highest speed of a body without limits of its own, leg lengths a second.
const LEGS_PER_S: f32 = 5.0;

/// The highest speed over the ground that suits a body, m/s. None for a body without legs and
/// limits.
pub fn top_speed_mps(rig: &Rig) -> Option<f32> {
    if let Some(limits) = &rig.limits {
        return Some(limits.of(Figure::RootSpeed));
    }
    let legs = rig.legs.iter().map(|leg| leg.length_m(&rig.skeleton));
    let longest_m = legs.fold(0.0, f32::max);
    (longest_m > 0.0).then_some(LEGS_PER_S * longest_m)
}

/// Where a motion ends.
#[derive(Debug, Clone, PartialEq)]
enum Goal {
    /// At a place, with this heading.
    Place(GlobalRoot),
    /// In front of these frames.
    Gap {
        behind: Track,
        /// The root of each frame in the gap, if it is known. Otherwise the root stays as the model
        /// has it, which leads from the frames before the gap to those behind it.
        way: Option<Vec<GlobalRoot>>,
    },
}

/// A motion of words with an end. It takes the model's parts, and gives the finished motion once
/// all are there. Everything is in world space, except for the parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Ending {
    frame: SegmentFrame,
    before: Track,
    goal: Goal,
    made: Track,
}

impl Ending {
    /// A motion that follows `past` and ends at a place. Its segment lies at `frame`.
    pub fn at(place: GlobalRoot, frame: SegmentFrame, past: &[Checked]) -> Self {
        Self::new(Goal::Place(place), frame, past)
    }

    /// A motion between `past` and `targets`.
    pub fn between(frame: SegmentFrame, past: &[Checked], targets: &[Checked]) -> Self {
        let behind = track(&targets[..targets.len().min(BESIDE)]);
        Self::new(Goal::Gap { behind, way: None }, frame, past)
    }

    fn new(goal: Goal, frame: SegmentFrame, past: &[Checked]) -> Self {
        Self {
            frame,
            before: track(&past[past.len().saturating_sub(BESIDE)..]),
            goal,
            made: Track::default(),
        }
    }

    /// Whether it is a gap, whose way may be [known](Self::follow).
    pub fn is_gap(&self) -> bool {
        matches!(self.goal, Goal::Gap { .. })
    }

    /// Sets the roots of the frames in a gap. A way with another number of frames has no effect.
    pub fn follow(&mut self, roots: Vec<GlobalRoot>) {
        if let Goal::Gap { way, .. } = &mut self.goal {
            *way = Some(roots);
        }
    }

    /// Appends a part of the model's motion.
    ///
    /// # Errors
    /// [`NonFinite`] if it has numbers that are not finite.
    pub fn receive(&mut self, motion: &Motion, rig: &Rig) -> Result<(), NonFinite> {
        check_finite(motion)?;
        let part = Track::of_motion(motion, &self.frame, rig);
        self.made.extend(&part, 0, part.len());
        Ok(())
    }

    /// The finished motion, and notes for the caller.
    pub fn finish(&mut self, rig: &Rig) -> (Track, Vec<String>) {
        let mut before = std::mem::take(&mut self.before);
        touch(&mut before, rig);
        let (lead, count) = (before.len(), self.made.len());
        let mut whole = before;
        whole.extend(&self.made, 0, count);
        let mut notes = Vec::new();
        match &self.goal {
            Goal::Place(place) => {
                notes.extend(reach(&mut whole, lead, *place, rig));
                let range = lead..whole.len();
                plant(rig, whole.columns(), range, None);
            }
            Goal::Gap { behind, way } => {
                if let Some(way) = way.as_ref().filter(|way| way.len() == count) {
                    put(&mut whole, lead, way, &rig.skeleton);
                }
                let mut behind = behind.clone();
                touch(&mut behind, rig);
                whole.extend(&behind, 0, behind.len());
                let Track {
                    roots,
                    rotations,
                    contacts,
                } = &mut whole;
                hold_between(rig, roots, rotations, contacts, lead..lead + count);
            }
        }
        (whole.part(lead, count), notes)
    }
}

/// Bends the frames from `lead` on so that the last one is at a place. Says so if they are then
/// faster than the body.
fn reach(whole: &mut Track, lead: usize, place: GlobalRoot, rig: &Rig) -> Option<String> {
    // The frame before the motion stays; without one, its first frame.
    let first = lead.saturating_sub(1);
    let last = whole.len().checked_sub(1)?;
    let roots: Vec<GlobalRoot> = (first..=last)
        .map(|frame| whole.root(frame, &rig.skeleton))
        .collect();
    let places = [Place {
        frame: last - first,
        ground: Vec2::new(place.position.x, place.position.z),
        heading: Some(place.heading),
    }];
    let bent = bend_through(&roots, &places);
    put(whole, first, &bent, &rig.skeleton);
    let top_mps = top_speed_mps(rig)?;
    let [made_mps, bent_mps] = [&roots, &bent].map(|roots| fastest_mps(roots, rig.fps));
    if bent_mps <= top_mps || bent_mps <= made_mps {
        return None;
    }
    let seconds = (last - first) as f32 / rig.fps * bent_mps / top_mps;
    Some(format!(
        "the place is met at up to {bent_mps:.1} m/s, and {top_mps:.1} suit the body: feet may slide; \
         ask for about {seconds:.1} seconds, or for a nearer place"
    ))
}

/// Puts the frames from `first` on onto these roots. Poses turn with them.
pub(super) fn put(track: &mut Track, first: usize, roots: &[GlobalRoot], skeleton: &Skeleton) {
    let joints = skeleton.joint_count();
    for (frame, root) in (first..track.len()).zip(roots) {
        let turn = wrap_angle(root.heading - track.root(frame, skeleton).heading);
        track.roots[frame] = root.position;
        let pelvis = &mut track.rotations[frame * joints];
        *pelvis = (yaw(turn) * *pelvis).normalize();
    }
}

/// Keyframes as frames without contacts. Each has a root and a pose; others are left out.
fn track(keys: &[Checked]) -> Track {
    let mut track = Track::default();
    for key in keys {
        if let (Some(root), Some(pose)) = (key.root, &key.pose) {
            track.push(root.position, &pose.rotations, 0);
        }
    }
    track
}

/// Finds which feet of given frames touch the ground.
fn touch(track: &mut Track, rig: &Rig) {
    let (Some(params), joints) = (&rig.skeleton.contacts, rig.skeleton.joint_count()) else {
        return;
    };
    let mut world = WorldMotion {
        joints,
        positions: vec![Default::default(); track.len() * joints],
        rotations: vec![Default::default(); track.len() * joints],
    };
    for (frame, root) in track.roots.iter().enumerate() {
        let at = frame * joints..(frame + 1) * joints;
        world_transforms(
            &rig.skeleton,
            *root,
            track.pose(frame),
            &mut world.positions[at.clone()],
            &mut world.rotations[at],
        );
    }
    let found = detect(&world, params, rig.skeleton.ground_y_m, rig.fps);
    let rows = found.chunks_exact(params.len().max(1));
    for (bits, row) in track.contacts.iter_mut().zip(rows) {
        *bits = bits_of(row.iter().copied());
    }
}

#[cfg(test)]
#[path = "ending_tests.rs"]
mod tests;
