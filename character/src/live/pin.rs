//! Makes a plan meet the keyframes of an object.
//!
//! The networks come near a keyframe. This step then meets it exactly. The root's error is spread
//! over the gap, and the pose's error fades in over 8 frames ([`troupe_motion::pin`]). The last
//! frames come to rest if the pose is held. Standing feet are kept in place, because all of this
//! would make them slide.

use std::f32::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{FootLock, Leg, Posed, lock_feet, settle, two_bone};
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::{GlobalRoot, Skeleton, Vec3};

use super::{CONTEXT_FRAMES, LivePlan};
use crate::post::{PIN_REACH_FRAMES, bits_of};
use crate::primitives::object::Key;
use crate::primitives::object::recipe::SETTLE_FRAMES;

/// A foot makes a step if it travels at least this far, metres, in at least this many frames. It is
/// then lifted by the third, metres.
const LEAST_STEP_M: f32 = 0.05;
const LEAST_STEP_FRAMES: usize = 5;
const STEP_OVER_M: f32 = 0.06;
/// Most frames taken off an end of a contact, and fewest that are left of it.
const MOST_TAKEN_OFF: usize = 4;
const LEAST_LEFT: usize = 3;

/// The keyframes that a plan is to meet.
#[derive(Debug, Clone)]
pub struct Pins {
    /// The last frames, in the plan's own space: heights count from what the character stands on.
    pub keys: Vec<Key>,
    /// Whether the motion comes to rest in the last of them.
    pub settles: bool,
    /// The legs of the pack's skeleton, in its order.
    pub legs: Arc<[Leg]>,
    /// Frames a second of plans.
    pub fps: f32,
}

impl Pins {
    /// Pins the last frames of `plan` to the keyframes. Notes in its trace how far off they were. A
    /// plan too short for context and keyframes stays as it is.
    pub fn pin_to_targets(&self, plan: &mut LivePlan, skeleton: &Skeleton) {
        let joints = skeleton.joint_count();
        let frames = plan.roots.len();
        let first = frames.saturating_sub(self.keys.len());
        if self.keys.is_empty() || first <= CONTEXT_FRAMES {
            return;
        }
        let frame = |plan: &LivePlan, frame: usize, key: &Key| {
            let posed = Posed {
                root: plan.roots[frame],
                rotations: &plan.rotations[frame * joints..(frame + 1) * joints],
            };
            key.error(skeleton, posed)
        };
        plan.trace.off = (self.keys.iter().enumerate())
            .map(|(nth, key)| frame(plan, first + nth, key))
            .collect();

        self.pin(plan, skeleton, first);
        if self.settles
            && let [key] = self.keys.as_slice()
        {
            let fading = SETTLE_FRAMES.min(frames - CONTEXT_FRAMES);
            settle(
                &mut plan.roots,
                &mut plan.rotations,
                joints,
                key.root,
                &key.rotations,
                fading,
            );
        }
        let fastest_mps = skeleton
            .contacts
            .as_ref()
            .map_or(f32::INFINITY, |c| c.max_speed_mps);
        let goes_m = fastest_mps / self.fps;
        for leg in self.legs.iter() {
            for span in runs(&plan.contacts[..first], |contacts| {
                contacts & leg.contact_bits() != 0
            }) {
                let_go(leg, span, (first, goes_m), plan, skeleton);
            }
        }
        lock_feet(
            skeleton,
            &self.legs,
            &mut plan.roots,
            &mut plan.rotations,
            &plan.contacts,
            &FootLock {
                floor_m: Some(0.0),
                ..FootLock::over(CONTEXT_FRAMES..first)
            },
        );
        if self.settles {
            plan.contacts[frames - 1] = standing_contacts(plan, skeleton);
        }
        for leg in self.legs.iter() {
            let mut swings = runs(&plan.contacts[..first], |contacts| {
                contacts & leg.contact_bits() == 0
            });
            swings.retain(|swing| swing.len() >= LEAST_STEP_FRAMES);
            for swing in swings {
                step_over(leg, swing, plan, skeleton);
            }
        }
    }

    fn pin(&self, plan: &mut LivePlan, skeleton: &Skeleton, first: usize) {
        let joints = skeleton.joint_count();
        let mut roots: Vec<GlobalRoot> = (plan.roots.iter().zip(plan.rotations.chunks_exact(joints)))
            .map(|(&root, pose)| GlobalRoot::of_pose(root, pose[0], skeleton.left_axis))
            .collect();
        let root_pins: Vec<RootPin> = (self.keys.iter().enumerate())
            .map(|(nth, key)| RootPin {
                frame: first + nth,
                root: key.global_root(skeleton.left_axis),
            })
            .collect();
        let last_context = CONTEXT_FRAMES - 1;
        pin_targets(&mut roots, &mut plan.rotations, joints, last_context, &root_pins);
        for (position, root) in plan.roots.iter_mut().zip(&roots) {
            *position = root.position;
        }
        let last_pose = plan.rotations[last_context * joints..CONTEXT_FRAMES * joints].to_vec();
        let context = PosePin {
            frame: last_context,
            rotations: &last_pose,
        };
        let keys = (self.keys.iter().enumerate()).map(|(nth, key)| PosePin {
            frame: first + nth,
            rotations: &key.rotations,
        });
        let pins: Vec<PosePin<'_>> = std::iter::once(context).chain(keys).collect();
        pin_poses(&mut plan.rotations, joints, &pins, PIN_REACH_FRAMES);
    }
}

/// Contact bits of the last frame, in which nothing moves.
fn standing_contacts(plan: &LivePlan, skeleton: &Skeleton) -> u8 {
    let (Some(contacts), Some(&root)) = (&skeleton.contacts, plan.roots.last()) else {
        return 0;
    };
    let pose = &plan.rotations[plan.rotations.len() - skeleton.joint_count()..];
    let touches = |(&joint, &most): (&usize, &f32)| joint_transform(skeleton, root, pose, joint).0.y < most;
    bits_of(contacts.joints.iter().zip(&contacts.max_height_m).map(touches))
}

/// The frames after the context whose contacts satisfy `is_such`, as runs.
fn runs(contacts: &[u8], is_such: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = None;
    for frame in CONTEXT_FRAMES..=contacts.len() {
        let such = contacts.get(frame).is_some_and(|&contacts| is_such(contacts));
        match start {
            None if such => start = Some(frame),
            Some(from) if !such => {
                runs.push(from..frame);
                start = None;
            }
            _ => {}
        }
    }
    runs
}

/// Takes frames off the ends of a contact in which the foot is already on its way: faster over the
/// ground than `goes_m` a frame, which no standing foot is. Holding it there would leave too few
/// frames for its way, and the knee would jump. Frames from `first` on may not change.
fn let_go(
    leg: &Leg,
    span: Range<usize>,
    (first, goes_m): (usize, f32),
    plan: &mut LivePlan,
    skeleton: &Skeleton,
) {
    let joints = skeleton.joint_count();
    let goes = |plan: &LivePlan, frame: usize| {
        let on_toe = leg.contacts[1].is_some_and(|bit| plan.contacts[frame] & (1 << bit) != 0);
        let joint = leg.toe.filter(|_| on_toe).unwrap_or(leg.foot);
        let [before, now] = [frame - 1, frame].map(|frame| {
            let pose = &plan.rotations[frame * joints..(frame + 1) * joints];
            joint_transform(skeleton, plan.roots[frame], pose, joint).0
        });
        (now - before).with_y(0.0).length() > goes_m
    };
    let most = span.len().saturating_sub(LEAST_LEFT).min(2 * MOST_TAKEN_OFF);
    // A contact that continues into the context, or into a keyframe, is not shortened at that end.
    let (begins, ends) = (span.start > CONTEXT_FRAMES, span.end < first);
    let late = (0..MOST_TAKEN_OFF.min(most))
        .take_while(|taken| ends && goes(plan, span.end - 1 - taken))
        .count();
    let early = (0..MOST_TAKEN_OFF.min(most - late))
        .take_while(|taken| begins && goes(plan, span.start + 1 + taken))
        .count();
    for frame in (span.start..span.start + early).chain(span.end - late..span.end) {
        plan.contacts[frame] &= !leg.contact_bits();
    }
}

/// Lifts a foot that moves low over the ground from one place to another: pinning the plan would
/// make it slide.
fn step_over(leg: &Leg, swing: Range<usize>, plan: &mut LivePlan, skeleton: &Skeleton) {
    let joints = skeleton.joint_count();
    let foot = |plan: &LivePlan, frame: usize| {
        let pose = &plan.rotations[frame * joints..(frame + 1) * joints];
        joint_transform(skeleton, plan.roots[frame], pose, leg.foot).0
    };
    let (start, end) = (foot(plan, swing.start), foot(plan, swing.end - 1));
    if (end - start).with_y(0.0).length() < LEAST_STEP_M {
        return;
    }
    let share = |frame: usize| (frame + 1 - swing.start) as f32 / (swing.len() + 1) as f32;
    let arc = |frame: usize| (PI * share(frame)).sin();
    let lacking = |frame: usize| STEP_OVER_M * arc(frame) - (foot(plan, frame).y - leg.clearance_m[0]);
    let most = swing.clone().map(lacking).fold(0.0, f32::max);
    if most == 0.0 {
        return;
    }
    for frame in swing.clone() {
        let goal = foot(plan, frame) + Vec3::Y * most * arc(frame) * arc(frame);
        let root = plan.roots[frame];
        let pose = &mut plan.rotations[frame * joints..(frame + 1) * joints];
        let pole = GlobalRoot::of_pose(root, pose[0], skeleton.left_axis).forward();
        two_bone(skeleton, root, pose, leg.chain(), goal, pole, true);
    }
}

#[cfg(test)]
#[path = "pin_tests.rs"]
mod tests;
