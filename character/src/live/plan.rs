//! Turns the networks' raw motion of a live plan into frames in the world.

use std::sync::Arc;

use troupe_motion::clip::Clip;
use troupe_motion::contacts::detect;
use troupe_motion::fk::WorldMotion;
use troupe_motion::pin::{PosePin, fade, pin_poses};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::{align_sign, yaw};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use super::{CONTEXT_FRAMES, LivePlan, LiveShape, PlanTrace};
use crate::post::{
    NonFinite, PIN_REACH_FRAMES, bits_of, check_finite, contact_bits, hold_live, parent_relative, roots,
    to_world_rotations,
};
use crate::primitives::Follow;
use troupe_motion::model::Motion;
use troupe_motion::model::Rig;

/// Index of the frame that a plan carries on from.
const LAST_CONTEXT: usize = CONTEXT_FRAMES - 1;

/// Turns the networks' raw motion into a plan that carries on from its context.
///
/// The difference to the last context frame moves into the frames after it. Place on the ground and
/// heading keep it; height and pose lose it over [`PIN_REACH_FRAMES`]. Targets are guidance and not
/// met: the next plan starts before the cursor comes near them.
///
/// # Errors
/// [`NonFinite`] if the networks gave numbers that are not finite.
pub fn finish_live(raw: &Motion, shape: &LiveShape, rig: &Rig) -> Result<LivePlan, NonFinite> {
    check_finite(raw)?;
    let dims = &rig.dims;
    let made = raw.frames();
    let frames = shape.targets.frames.map_or(made, |frames| frames.min(made));
    let mut rotations = parent_relative(raw, frames, dims, &rig.skeleton);
    to_world_rotations(&shape.frame, dims.joints, &mut rotations);
    let r_g4 = world_roots(&raw.root, frames, &shape.frame);
    let mut positions: Vec<Vec3> = r_g4.iter().map(|root| root.position).collect();

    let trace = raw.trace.as_deref().cloned().unwrap_or_default();
    join_roots(&mut positions, &shape.context_roots);
    join_poses(&mut rotations, &shape.context_rotations, rig.skeleton.left_axis);
    let mut contacts = contact_bits(&raw.contacts, dims.contacts, frames);
    if let Some(follow) = &shape.targets.follow {
        follow_gait(follow, shape, rig, (&mut positions, &mut rotations));
        own_contacts(follow, rig, &positions, &rotations, &mut contacts);
    }
    Ok(LivePlan {
        roots: positions,
        rotations,
        contacts,
        feet_glide: false,
        trace: PlanTrace {
            r_g3: world_roots(&trace.root_r_g3, frames, &shape.frame),
            r_g4,
            tokens: trace.tokens,
            count_probs: trace.count_probs,
            off: Vec::new(),
        },
    })
}

/// Holds the standing feet of a plan without targets to meet. The ground is at height 0.
///
/// A body that follows paths needs the frames before the plan: which foot stands there, and where.
/// So its character has its feet stand, as the plan takes over.
pub fn hold_plan(rig: &Rig, plan: &mut LivePlan) {
    plan.feet_glide = rig.by_path.is_some();
    if !plan.feet_glide {
        let (rotations, contacts) = (&mut plan.rotations, &mut plan.contacts);
        hold_live(rig, &mut plan.roots, rotations, contacts, CONTEXT_FRAMES);
    }
}

fn world_roots(values: &[f32], frames: usize, frame: &SegmentFrame) -> Vec<GlobalRoot> {
    roots(values)
        .take(frames)
        .map(|root| frame.to_world_root(root))
        .collect()
}

/// Pulls frames towards a gait that the networks do not know. The difference to the context fades
/// out.
fn follow_gait(
    follow: &Follow,
    shape: &LiveShape,
    rig: &Rig,
    (positions, rotations): (&mut [Vec3], &mut [Quat]),
) {
    let joints = rig.dims.joints;
    let Some(guide) = &shape.targets.guide else { return };
    let mut own = follow.clone();
    own.rotations.truncate(rotations.len());
    let pin = PosePin {
        frame: LAST_CONTEXT,
        rotations: &shape.context_rotations[LAST_CONTEXT * joints..],
    };
    pin_poses(&mut own.rotations, joints, &[pin], PIN_REACH_FRAMES);
    let path: Vec<Vec3> = guide.path.iter().map(|root| root.position).collect();
    own.draw(&path, positions, rotations);
    positions[..CONTEXT_FRAMES].copy_from_slice(&shape.context_roots);
    rotations[..shape.context_rotations.len()].copy_from_slice(&shape.context_rotations);
}

/// Contact bits of frames that belong more to the gait than to the networks.
fn own_contacts(follow: &Follow, rig: &Rig, positions: &[Vec3], rotations: &[Quat], contacts: &mut [u8]) {
    let Some(params) = &rig.skeleton.contacts else {
        return;
    };
    let clip = Clip::new(
        Arc::clone(&rig.skeleton),
        rig.fps,
        positions.to_vec(),
        rotations.to_vec(),
    );
    let Ok(clip) = clip else { return };
    let touches = detect(
        &WorldMotion::from_clip(&clip),
        params,
        rig.skeleton.ground_y_m,
        rig.fps,
    );
    let frames = touches.chunks_exact(params.len()).zip(&follow.weights);
    for (bits, (touches, &weight)) in contacts.iter_mut().zip(frames) {
        if weight >= 0.5 {
            *bits = bits_of(touches.iter().copied());
        }
    }
}

/// Joins the roots to the context: the path over the ground moves as a whole, the difference in
/// height fades out.
fn join_roots(positions: &mut [Vec3], context: &[Vec3; CONTEXT_FRAMES]) {
    let lacking = context[LAST_CONTEXT] - positions[LAST_CONTEXT];
    for (frame, position) in positions.iter_mut().enumerate() {
        let fading = fade(frame.saturating_sub(LAST_CONTEXT), PIN_REACH_FRAMES);
        *position += Vec3::new(lacking.x, lacking.y * fading, lacking.z);
    }
    positions[..CONTEXT_FRAMES].copy_from_slice(context);
}

/// Joins the poses to the context: all turn by the difference in heading, the rest fades out.
fn join_poses(rotations: &mut [Quat], context: &[Quat], left_axis: Vec3) {
    let joints = context.len() / CONTEXT_FRAMES;
    let given = &context[LAST_CONTEXT * joints..];
    let heading = |pelvis| heading_of(pelvis, left_axis);
    let lacking = wrap_angle(heading(given[0]) - heading(rotations[LAST_CONTEXT * joints]));
    let turn = yaw(lacking);
    for pose in rotations.chunks_exact_mut(joints) {
        pose[0] = (turn * pose[0]).normalize();
    }
    let pin = PosePin {
        frame: LAST_CONTEXT,
        rotations: given,
    };
    pin_poses(rotations, joints, &[pin], PIN_REACH_FRAMES);
    rotations[..context.len()].copy_from_slice(context);
    for index in context.len()..rotations.len() {
        rotations[index] = align_sign(rotations[index], rotations[index - joints]);
    }
}

#[cfg(test)]
#[path = "plan_tests.rs"]
mod tests;
