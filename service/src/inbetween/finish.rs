//! From raw motion to frames.

use troupe_character::keyframe::Given;
use troupe_character::post::{
    HingeColumns, NonFinite, PIN_REACH_FRAMES, check_finite, contact_bits, hold_between, onto_hinges,
    parent_relative, roots, to_world_rotations,
};
use troupe_motion::feasibility::{Feasibility, Judge, Key};
use troupe_motion::fk::world_transforms;
use troupe_motion::model::{Dims, GLOBAL_ROOT, Motion, Rig, SIX_D};
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::robot::HingeRates;
use troupe_motion::root::heading_of;
use troupe_motion::rotation::{six_d, to_wxyz};
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Skeleton, Vec3};
use troupe_proto::v1;

use super::feasible::{keys, message};
use super::{ExtraOutputs, Plan};

/// Turns the raw motion of one character into its answer, in world coordinates.
///
/// # Errors
/// [`NonFinite`] if the frames, or the output of an earlier stage, hold numbers that are not
/// finite.
pub fn finish(raw: &Motion, plan: &Plan, rig: &Rig) -> Result<v1::CharacterResult, NonFinite> {
    finish_judged(raw, plan, rig, None).map(|(result, _)| result)
}

/// [`finish`], which also judges the feasibility of the frames and the keyframes.
///
/// # Errors
/// As [`finish`].
pub fn finish_judged(
    raw: &Motion,
    plan: &Plan,
    rig: &Rig,
    judge: Option<&mut Judge>,
) -> Result<(v1::CharacterResult, Option<Feasibility>), NonFinite> {
    let dims = &rig.dims;
    let frames = plan.frames.unwrap_or(raw.frames());
    check_finite(raw)?;

    let mut roots: Vec<GlobalRoot> = roots(&raw.root[..frames * GLOBAL_ROOT]).collect();
    let mut rotations = parent_relative(raw, frames, dims, &rig.skeleton);
    pin(&mut roots, &mut rotations, plan, &rig.skeleton);

    let mut root_positions: Vec<Vec3> = roots
        .iter()
        .map(|root| plan.frame.to_world_position(root.position))
        .collect();
    to_world_rotations(&plan.frame, dims.joints, &mut rotations);
    // A robot's feet can be held only as far as its hinges allow, so its poses go onto the hinges
    // first. The answer reports the error of that, and the speeds of hinges after it.
    let mut hinges = on_hinges(
        rig,
        &root_positions,
        &mut rotations,
        plan.extras.qpos && !plan.hold_feet,
    );
    if plan.hold_feet {
        let contacts = contact_bits(&raw.contacts, dims.contacts, frames);
        let gap = plan.context.len()..frames - plan.targets.len();
        hold_between(rig, &mut root_positions, &mut rotations, &contacts, gap);
        let held = on_hinges(rig, &root_positions, &mut rotations, plan.extras.qpos);
        (hinges.qpos, hinges.rates) = (held.qpos, held.rates);
    }
    // From here on, all values describe the same robot poses.
    let found = judge.map(|judge| judged(judge, plan, &root_positions, &rotations));
    let (positions, six_d) = world_columns(&rig.skeleton, &root_positions, &rotations, plan.extras);
    let result = v1::CharacterResult {
        id: plan.id.clone(),
        frames: Some(v1::Frames {
            frame_count: frames as u32,
            root_positions: flat(&root_positions, Vec3::to_array),
            rotations: flat(&rotations, |&rotation| to_wxyz(rotation)),
            contacts: raw.contacts[..frames * dims.contacts]
                .iter()
                .map(|c| c.clamp(0.0, 1.0))
                .collect(),
            positions,
            six_d,
            qpos: hinges.qpos,
            hinge_residuals: hinges.residuals,
            clamped_hinges: hinges.clamped,
            hinge_speed_ratios: hinges.rates.speed_ratios,
            fastest_hinges: hinges.rates.fastest,
            hinge_accelerations: hinges.rates.accelerations,
        }),
        intermediates: plan
            .extras
            .intermediates
            .then(|| intermediates(raw, &plan.frame, dims)),
        feasibility: found.as_ref().map(message),
    };
    Ok((result, found))
}

/// Judges frames in the world, together with the keyframes that they were made for.
fn judged(judge: &mut Judge, plan: &Plan, roots: &[Vec3], rotations: &[Quat]) -> Feasibility {
    let [context, targets] = keys(plan);
    let moved = judge.motion(roots, rotations);
    let given = judge.keys(&context, &targets, roots.len());
    let last: Vec<Key<'_>> = targets
        .iter()
        .map(|key| Key {
            velocity: key
                .velocity
                .map(|velocity| plan.frame.to_world_local_root(velocity)),
            ..*key
        })
        .collect();
    moved.worse_of(&given).worse_of(&judge.arrivals(&last, roots))
}

/// Brings a robot's poses onto its hinges. Other rigs stay unchanged.
fn on_hinges(rig: &Rig, roots: &[Vec3], rotations: &mut [Quat], wants_qpos: bool) -> HingeColumns {
    match &rig.skeleton.robot {
        Some(robot) => {
            let clock = (&mut HingeRates::default(), rig.fps);
            onto_hinges(robot, (roots, rotations), clock, wants_qpos)
        }
        None => HingeColumns::default(),
    }
}

/// The numbers of all `items` in one list, with one allocation.
fn flat<T, const N: usize>(items: &[T], numbers: impl Fn(&T) -> [f32; N]) -> Vec<f32> {
    let mut all = Vec::with_capacity(items.len() * N);
    for item in items {
        all.extend_from_slice(&numbers(item));
    }
    all
}

/// Pins the frames to their keyframes: roots over the whole gap, poses over a few frames on either
/// side.
///
/// The heading of a root is that of the decoded pelvis. The r_g4 heading only approximates it.
fn pin(roots: &mut [GlobalRoot], rotations: &mut [Quat], plan: &Plan, skeleton: &Skeleton) {
    let joints = skeleton.joint_count();
    for (root, pose) in roots.iter_mut().zip(rotations.chunks_exact(joints)) {
        root.heading = heading_of(pose[0], skeleton.left_axis);
    }
    let first_target = roots.len().saturating_sub(plan.targets.len());
    let targets = plan
        .targets
        .iter()
        .enumerate()
        .map(|(index, key)| (first_target + index, key));
    let keys: Vec<(usize, &Given)> = plan.context.iter().enumerate().chain(targets).collect();

    let root_pins: Vec<RootPin> = keys
        .iter()
        .filter_map(|&(frame, key)| {
            Some(RootPin {
                frame,
                root: key.root?,
            })
        })
        .collect();
    // The first frame has no earlier frames over which to spread its residual, so it is set
    // exactly.
    if let (Some(start), Some(RootPin { frame: 0, root })) = (roots.first_mut(), root_pins.first()) {
        *start = *root;
    }
    pin_targets(roots, rotations, joints, 0, &root_pins);
    if let Some(given) = &plan.root {
        given.over.pin(roots, rotations, joints);
    }

    // Heights without a root come second, because the root pins above have moved the ground
    // positions that they keep.
    let height_pins: Vec<RootPin> = keys
        .iter()
        .filter_map(|&(frame, key)| {
            let mut root = *roots.get(frame)?;
            root.position.y = key.height?;
            Some(RootPin { frame, root })
        })
        .collect();
    pin_targets(roots, rotations, joints, 0, &height_pins);

    let pose_pins: Vec<PosePin<'_>> = keys
        .iter()
        .filter_map(|&(frame, key)| {
            Some(PosePin {
                frame,
                rotations: key.rotations.as_deref()?,
            })
        })
        .collect();
    pin_poses(rotations, joints, &pose_pins, PIN_REACH_FRAMES);
}

/// World positions of all joints and their world rotations in 6D form, each if asked for.
fn world_columns(
    skeleton: &Skeleton,
    roots: &[Vec3],
    rotations: &[Quat],
    extras: ExtraOutputs,
) -> (Vec<f32>, Vec<f32>) {
    let (mut positions, mut six_ds) = (Vec::new(), Vec::new());
    if !(extras.positions || extras.six_d) {
        return (positions, six_ds);
    }
    let joints = skeleton.joint_count();
    let mut places = vec![Vec3::ZERO; joints];
    let mut world = vec![Quat::IDENTITY; joints];
    let room = |wanted: bool, numbers: usize| if wanted { roots.len() * joints * numbers } else { 0 };
    positions.reserve_exact(room(extras.positions, 3));
    six_ds.reserve_exact(room(extras.six_d, SIX_D));
    for (root, pose) in roots.iter().zip(rotations.chunks_exact(joints)) {
        world_transforms(skeleton, *root, pose, &mut places, &mut world);
        if extras.positions {
            positions.extend(places.iter().flat_map(Vec3::to_array));
        }
        if extras.six_d {
            six_ds.extend(world.iter().copied().flat_map(six_d));
        }
    }
    (positions, six_ds)
}

fn intermediates(raw: &Motion, frame: &SegmentFrame, dims: &Dims) -> v1::Intermediates {
    let world = |values: &[f32]| {
        roots(values)
            .flat_map(|root| frame.to_world_root(root).to_array())
            .collect()
    };
    let trace = raw.trace.as_deref().cloned().unwrap_or_default();
    v1::Intermediates {
        predicted_frame_count: (trace.num_tokens * dims.frames_per_token) as u32,
        token_count_probabilities: trace.count_probs,
        root_r_g3: world(&trace.root_r_g3),
        tokens: trace.tokens,
        root_r_g4: world(&raw.root),
    }
}

#[cfg(test)]
#[path = "finish_tests.rs"]
mod tests;
