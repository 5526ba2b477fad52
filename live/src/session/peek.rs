//! The buffered future frames of a session, and the plan that they come from.

use std::time::Instant;

use troupe_motion::conventions::Convention;
use troupe_motion::rotation::to_wxyz;
use troupe_motion::{GlobalRoot, Quat, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::command::Intent as Asked;

use super::LivePack;
use super::cell::SessionCell;
use super::describe;
use super::encode::{BlockWriter, Form};
use crate::skeleton::Dress;
use crate::wire::{Measure, units};
use troupe_character::live::{
    CONTEXT_FRAMES, FrameOut, Intent, Peek, PerformCommand, PlanCause, PlanRecord, WaitingCommand,
};
use troupe_character::primitives::path::PathPoint;
use troupe_character::primitives::{LocomotionCommand, PathCommand, TargetKey};
use troupe_motion::model::Rig;

/// Maximum number of frames in one answer.
pub const MAX_PEEK_FRAMES: u32 = 64;

/// The state of the session, at most `frames` of its future frames, and its newest plan.
pub(super) fn peek(cell: &SessionCell, frames: usize, now: Instant) -> v1::PeekResponse {
    let (session, peek, dress) = {
        let live = cell.live();
        (
            describe::session_of(cell, &live, now),
            live.character.peek(frames),
            live.dress.as_ref().map(Dress::glimpse),
        )
    };
    let (convention, pack) = (cell.convention(), cell.pack().rig());
    v1::PeekResponse {
        session: Some(session),
        future: Some(future(&peek, cell.pack(), dress, convention)),
        plan: (peek.plan.as_deref()).map(|plan| plan_view(plan, pack, cell.measure())),
        in_flight: peek.in_flight,
        waiting: peek.waiting.map(|waiting| command(cell, &waiting)),
    }
}

fn future(
    peek: &Peek,
    live_pack: &LivePack,
    mut dress: Option<Dress>,
    convention: Convention,
) -> v1::FrameBlock {
    let pack = live_pack.rig();
    let joints = pack.skeleton.joint_count();
    let form = Form {
        encoding: v1::Encoding::F32,
        positions: false,
        six_d: false,
    };
    let mut writer = BlockWriter::of(live_pack, form, 1, peek.roots.len());
    writer.name(0);
    let mut out = FrameOut {
        frame: peek.first_frame,
        ..FrameOut::default()
    };
    let poses = peek.rotations.chunks_exact(joints);
    for (index, ((&root, pose), &contacts)) in peek.roots.iter().zip(poses).zip(&peek.contacts).enumerate() {
        out.root = root;
        out.contacts = contacts;
        out.rotations.clear();
        out.rotations.extend_from_slice(pose);
        if let Some(dress) = &mut dress {
            out.frame = peek.first_frame + index as u64;
            dress.put_on_later(&mut out);
        }
        writer.write((0, index), &out, convention, live_pack.shown());
    }
    writer.finish(|_| true)
}

fn plan_view(plan: &PlanRecord, pack: &Rig, measure: Measure) -> v1::PlanView {
    let joints = pack.skeleton.joint_count();
    let shape = &plan.shape;
    let context = (0..CONTEXT_FRAMES).map(|index| v1::Keyframe {
        root: Some(v1::Root {
            position: Some(units::position(shape.context_roots[index], measure)),
            heading: None,
        }),
        velocity: None,
        pose: Some(pose(
            &shape.context_rotations[index * joints..(index + 1) * joints],
            None,
            measure,
        )),
        ..v1::Keyframe::default()
    });
    let path = |roots: &[GlobalRoot]| roots.iter().flat_map(|&root| five(root, measure)).collect();
    let targets = &shape.targets;
    v1::PlanView {
        number: plan.number,
        cause: match plan.cause {
            PlanCause::Command => "command",
            PlanCause::LowBuffer => "low_buffer",
            PlanCause::Interval => "interval",
            PlanCause::Object => "object",
        }
        .to_owned(),
        asked_at_frame: plan.asked_at,
        splice_frame: plan.splice,
        context: context.collect(),
        targets: targets.targets.iter().map(|key| target(key, measure)).collect(),
        root_r_g1: Some(root(targets.r_g1, measure)),
        root_r_g2: path(&targets.r_g2),
        root_r_g3: path(&plan.trace.r_g3),
        root_r_g4: path(&plan.trace.r_g4),
        tokens: plan.trace.tokens.clone(),
        token_count_probabilities: plan.trace.count_probs.clone(),
        gaits: targets
            .gaits
            .iter()
            .map(|(gait, weight)| v1::GaitWeight {
                gait: gait.clone(),
                weight: *weight,
            })
            .collect(),
    }
}

fn root(root: GlobalRoot, measure: Measure) -> v1::Root {
    v1::Root {
        position: Some(units::position(root.position, measure)),
        heading: Some(describe::heading(root, measure.convention())),
    }
}

/// Position x, y, z, then cosine and sine of the heading.
fn five(root: GlobalRoot, measure: Measure) -> [f32; 5] {
    let Vec3 { x, y, z } = measure.position_from_native(root.position);
    let (sin, cos) = measure.heading_from_native(root.heading).sin_cos();
    [x, y, z, cos, sin]
}

fn pose(rotations: &[Quat], height_m: Option<f32>, measure: Measure) -> v1::Pose {
    let wxyz = rotations
        .iter()
        .flat_map(|&rotation| to_wxyz(measure.convention().rotation_from_native(rotation)));
    v1::Pose {
        rotations: wxyz.collect(),
        root_height: height_m.map(|height| height * measure.units_per_metre()),
    }
}

fn target(key: &TargetKey, measure: Measure) -> v1::Keyframe {
    let unit = measure.units_per_metre();
    v1::Keyframe {
        root: key.root.map(|key| root(key, measure)),
        velocity: key.velocity.map(|local| {
            let ground = measure.position_from_native(Vec3::new(local.vx, 0.0, local.vz));
            // The message has the two axes of the ground: x, and the other one that is not up.
            let second = match units::up_axis(measure.convention()) {
                "z" => ground.y,
                _ => ground.z,
            };
            v1::RootVelocity {
                x: ground.x,
                z: second,
                angular: measure.heading_from_native(local.omega),
                height: Some(local.height * unit),
            }
        }),
        pose: key
            .rotations
            .as_ref()
            .map(|rotations| pose(rotations, key.height_m, measure)),
        ..v1::Keyframe::default()
    }
}

fn command(cell: &SessionCell, waiting: &WaitingCommand) -> v1::Command {
    v1::Command {
        session_id: cell.id().to_string(),
        sequence: waiting.sequence,
        at_frame: Some(waiting.frame),
        priority: None,
        intent: Some(match &waiting.intent {
            Intent::Locomote(command) => Asked::Locomote(locomote(command, cell)),
            Intent::FollowPath(path) => Asked::FollowPath(follow_path(path, cell.measure())),
            Intent::Interact {
                instance,
                variant,
                approach,
            } => Asked::Interact(v1::Interact {
                instance: instance.to_string(),
                variant: variant.clone().unwrap_or_default(),
                approach: approach.clone().unwrap_or_default(),
            }),
            Intent::Skill { name, variant } => Asked::Skill(v1::UseSkill {
                name: name.to_string(),
                variant: variant.clone().unwrap_or_default(),
            }),
            Intent::Perform(words) => Asked::Perform(perform(words, cell.pack().rig().fps)),
            Intent::EndInteraction => Asked::EndInteraction(v1::EndInteraction {}),
            Intent::Cancel => Asked::Cancel(v1::Cancel {}),
            Intent::Drop => Asked::Drop(v1::DropHeld {}),
        }),
    }
}

fn perform(words: &PerformCommand, fps: f32) -> v1::Perform {
    v1::Perform {
        text: words.text.to_string(),
        pack: words.pack.to_string(),
        seconds: words.frames.map(|frames| frames as f32 / fps),
        temperature: words.temperature,
    }
}

fn follow_path(path: &PathCommand, measure: Measure) -> v1::FollowPath {
    let point = |point: &PathPoint| v1::PathPoint {
        position: Some(units::position(point.position, measure)),
        heading: point.heading.map(|heading| measure.heading_from_native(heading)),
        time: Some(point.time_s),
    };
    v1::FollowPath {
        points: path.points.iter().map(point).collect(),
        speed: None,
        style: path.style.name.clone(),
        r#loop: path.is_loop(),
    }
}

fn locomote(command: &LocomotionCommand, cell: &SessionCell) -> v1::Locomote {
    let measure = cell.measure();
    let unit = cell.convention().units_per_metre();
    let height = |height_m: f32| match cell.pack().worn() {
        Some(worn) => worn.height_out(height_m) * unit,
        None => height_m * unit,
    };
    let LocomotionCommand {
        velocity,
        facing,
        style,
        gait,
        height_m,
    } = command;
    v1::Locomote {
        velocity: Some(units::position(*velocity, measure)),
        facing: facing.map(|facing| measure.heading_from_native(facing)),
        style: style.name.clone(),
        gait: gait.clone().unwrap_or_default(),
        height: height_m.map(height),
    }
}
