//! Turns what a primitive asks for into a work item in its segment frame.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::root::heading_of;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use super::buffer::MotionBuffer;
use super::{CONTEXT_FRAMES, CharacterOptions, LiveShape, PathItem, PlanItem};
use crate::keyframe::{Checked, KeyWriter};
use crate::primitives::{self, Guide, PathGoal, PlanTargets, TargetKey};
use crate::style::Style;
use troupe_motion::model::{Dims, Rig};
use troupe_motion::model::{GapPose, KeyframeTask, RootGuide};

/// The four frames that a plan starts from, in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Context {
    /// Root positions, oldest first, metres.
    pub roots: [Vec3; CONTEXT_FRAMES],
    /// `4 * joints`, oldest first: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
}

impl Context {
    /// The frames that a plan with this splice frame starts from.
    pub(super) fn at(buffer: &MotionBuffer, splice: i64) -> Self {
        let first = splice + 1 - CONTEXT_FRAMES as i64;
        let frames: [i64; CONTEXT_FRAMES] = std::array::from_fn(|index| first + index as i64);
        let poses = frames.iter().flat_map(|&frame| buffer.pose(frame));
        Self {
            roots: frames.map(|frame| buffer.root(frame)),
            rotations: poses.copied().collect(),
        }
    }

    /// Four frames of a style's idle pose at `root`, whose height does not count.
    pub(super) fn standing(style: &Style, root: GlobalRoot) -> Self {
        let key = style.idle();
        let mut pose = key.rotations.clone();
        if let Some(pelvis) = pose.first_mut() {
            *pelvis = yaw(root.heading) * *pelvis;
        }
        Self {
            roots: [root.position.with_y(key.height_m); CONTEXT_FRAMES],
            rotations: pose.repeat(CONTEXT_FRAMES),
        }
    }

    /// Roots with the headings of the poses, oldest first.
    pub fn global_roots(&self, left_axis: Vec3) -> [GlobalRoot; CONTEXT_FRAMES] {
        let joints = self.rotations.len() / CONTEXT_FRAMES;
        std::array::from_fn(|frame| {
            let pelvis = self.rotations[frame * joints];
            GlobalRoot::new(self.roots[frame], heading_of(pelvis, left_axis))
        })
    }
}

/// Makes the work item of plan `number`, and what is needed to finish its answer.
pub fn build(
    rig: &Rig,
    options: &CharacterOptions,
    number: u64,
    context: Context,
    mut targets: PlanTargets,
) -> (PlanItem, LiveShape) {
    if let (Some(guide), Some(ratio)) = (&mut targets.guide, options.root_ratio) {
        guide.position_ratio = ratio;
    }
    let dims = &rig.dims;
    targets.frames = targets
        .frames
        .map(|frames| frames.clamp(dims.min_frames(), dims.max_frames()));
    let roots = context.global_roots(rig.skeleton.left_axis);
    let frame = SegmentFrame::from_root(roots[CONTEXT_FRAMES - 1]);

    let mut writer = KeyWriter::new(&rig.skeleton, rig.fps);
    let keys = writer.write(&frame, &context_keys(&roots, &context.rotations));
    let seed = plan_seed(options.seed, number);
    let item = match (&targets.path, targets.frames) {
        (Some(goal), Some(frames)) => PlanItem::Path(PathItem {
            context: keys,
            path: path(&frame, goal, frames),
            words: goal.words.clone(),
            seed,
        }),
        _ => PlanItem::Keyframes(KeyframeTask {
            context: keys,
            targets: writer.write(&frame, &target_keys(&targets.targets)),
            frames: targets.frames,
            allowed_counts: allowed_counts(dims, &targets),
            seed,
            temperature: options.temperature,
            pose_steps: 1,
            root_guide: targets.guide.as_ref().map(|guide| root_guide(&frame, guide)),
            root_override: None,
            gap_poses: gap_poses(&mut writer, &frame, &targets.gap_poses),
        }),
    };
    let shape = LiveShape {
        frame,
        context_roots: context.roots,
        context_rotations: context.rotations,
        targets,
    };
    (item, shape)
}

/// A path of `frames` frames. A shorter path stays at its end.
fn path(frame: &SegmentFrame, goal: &PathGoal, frames: usize) -> Box<[[f32; 3]]> {
    let last = goal.roots.last().copied();
    let roots = goal
        .roots
        .iter()
        .copied()
        .chain(std::iter::repeat_with(|| last).map_while(|last| last));
    let point = |root: GlobalRoot| {
        let root = frame.to_segment_root(root);
        [root.position.x, root.position.z, root.heading]
    };
    roots.take(frames).map(point).collect()
}

fn context_keys(roots: &[GlobalRoot; CONTEXT_FRAMES], rotations: &[Quat]) -> Vec<Checked> {
    let poses = rotations.chunks_exact(rotations.len() / CONTEXT_FRAMES);
    roots
        .iter()
        .zip(poses)
        .map(|(&root, pose)| Checked::of(Some(root), None, None, Some(pose.to_vec())))
        .collect()
}

fn target_keys(targets: &[TargetKey]) -> Vec<Checked> {
    targets
        .iter()
        .map(|key| Checked::of(key.root, key.height_m, key.velocity, key.rotations.clone()))
        .collect()
}

fn root_guide(frame: &SegmentFrame, guide: &Guide) -> RootGuide {
    let point = |&root: &GlobalRoot| {
        let root = frame.to_segment_root(root);
        let [x, y, z] = root.position.to_array();
        [x, y, z, root.heading]
    };
    RootGuide {
        path: guide.path.iter().map(point).collect(),
        position_ratio: guide.position_ratio,
        height_ratio: guide.height_ratio,
        heading_ratio: guide.heading_ratio,
    }
}

fn gap_poses(
    writer: &mut KeyWriter<'_>,
    frame: &SegmentFrame,
    poses: &[primitives::GapPose],
) -> Vec<GapPose> {
    let keys: Vec<Checked> = poses
        .iter()
        .map(|key| Checked::of(None, Some(key.height_m), None, Some(key.rotations.clone())))
        .collect();
    let frames = poses.iter().map(|key| key.frame);
    frames
        .zip(writer.write(frame, &keys))
        .filter_map(|(frame, key)| {
            Some(GapPose {
                frame,
                pose: key.pose?,
            })
        })
        .collect()
}

/// Which token counts the root stage may choose: the count that `frames` takes, those that the
/// primitive lists, or all that have room for the keyframes.
fn allowed_counts(dims: &Dims, targets: &PlanTargets) -> Vec<bool> {
    let fewest = dims.tokens_for(dims.context_frames + targets.targets.len());
    let listed = |tokens: usize| match targets.frames {
        Some(frames) => tokens == dims.tokens_for(frames),
        None => tokens >= fewest && targets.allowed_token_counts.contains(&(tokens as u32)),
    };
    let counts = dims.min_tokens..=dims.max_tokens;
    let allowed: Vec<bool> = counts.clone().map(listed).collect();
    if allowed.contains(&true) {
        allowed
    } else {
        counts.map(|tokens| tokens >= fewest).collect()
    }
}

/// The seed of plan `number` of a character. Every plan has its own, and a skipped plan does not
/// shift the others.
fn plan_seed(seed: u64, number: u64) -> u64 {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(number);
    generator.next_u64()
}

#[cfg(test)]
#[path = "request_tests.rs"]
mod tests;
