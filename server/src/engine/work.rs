//! One character's way through the stages: what goes in and what comes out, in the segment frame.

use troupe_motion::root::wrap_angle;

use super::{RootInput, TokenInput};
use crate::pack::{Dims, GLOBAL_ROOT, LOCAL_ROOT};

/// One keyframe as the stages read it, in the segment frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeyTensors {
    /// Velocity x and z (m/s), angular velocity (rad/s), height (m).
    pub local_root: Option<[f32; LOCAL_ROOT]>,
    /// Position (m), cosine and sine of the heading.
    pub global_root: Option<[f32; GLOBAL_ROOT]>,
    /// Pose feature, `joints * 9`.
    pub pose: Option<Box<[f32]>>,
}

/// A path that the root is drawn to (root interpolation, paper section 6.1 and figure 14).
///
/// It acts between the root stage and the pose stage, behind the context frames. A frame is moved by the ratios of what
/// lies between r_g3 and the path. Frames beyond the path's end are moved as its last frame is.
#[derive(Debug, Clone, PartialEq)]
pub struct RootGuide {
    /// `[frames][x, y, z, heading]` from the segment's first frame on: metres and radians, in the segment frame.
    pub path: Box<[[f32; 4]]>,
    /// 0 keeps r_g3's place on the ground, 1 takes the path's; up to 1.2.
    pub position_ratio: f32,
    /// 0 keeps r_g3's height, 1 takes the path's.
    pub height_ratio: f32,
    /// 0 keeps r_g3's heading, 1 takes the path's; up to 1.2.
    pub heading_ratio: f32,
}

impl RootGuide {
    /// Moves `roots`, frames of [`GLOBAL_ROOT`] numbers, from frame `first` on.
    fn apply(&self, roots: &mut [f32], first: usize) {
        // Of the last frame on the path: offset in x, y and z, cosine and sine of the turn.
        let mut shift = [0.0, 0.0, 0.0, 1.0, 0.0];
        for (frame, root) in roots.chunks_exact_mut(GLOBAL_ROOT).enumerate().skip(first) {
            let &mut [x, y, z, cos, sin] = root else { continue };
            if let Some(&[to_x, to_y, to_z, to_heading]) = self.path.get(frame) {
                let turn = self.heading_ratio * wrap_angle(to_heading - sin.atan2(cos));
                shift = [
                    self.position_ratio * (to_x - x),
                    self.height_ratio * (to_y - y),
                    self.position_ratio * (to_z - z),
                    turn.cos(),
                    turn.sin(),
                ];
            }
            let [shift_x, shift_y, shift_z, turn_cos, turn_sin] = shift;
            root[0] = x + shift_x;
            root[1] = y + shift_y;
            root[2] = z + shift_z;
            root[3] = cos * turn_cos - sin * turn_sin;
            root[4] = sin * turn_cos + cos * turn_sin;
        }
    }
}

/// A pose between context and targets, for the pose stage and the decoder alone.
#[derive(Debug, Clone, PartialEq)]
pub struct GapPose {
    /// Frame of the segment; one that the segment does not have is left out.
    pub frame: usize,
    /// Pose feature, `joints * 9`, in the segment frame.
    pub pose: Box<[f32]>,
}

/// One character's task, checked and in the segment frame.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkItem {
    /// The pack's number of context keyframes, the first frames of the segment.
    pub context: Vec<KeyTensors>,
    /// One or more target keyframes, the last frames of the segment.
    pub targets: Vec<KeyTensors>,
    /// Frames of the segment, where the request fixes them.
    pub frames: Option<usize>,
    /// Which token counts the root stage may choose, from the pack's minimum on; at least one.
    pub allowed_counts: Vec<bool>,
    /// Seed of all random choices.
    pub seed: u64,
    /// 0 for the most likely choice, above 0 to sample.
    pub temperature: f32,
    /// Passes of the pose stage.
    pub pose_steps: u32,
    /// Where to draw the root, if anywhere.
    pub root_guide: Option<RootGuide>,
    /// Poses between context and targets.
    pub gap_poses: Vec<GapPose>,
}

impl WorkItem {
    /// Frames of the segment, once its token count is known.
    pub fn frames(&self, dims: &Dims, tokens: usize) -> usize {
        self.frames.unwrap_or(tokens * dims.frames_per_token)
    }

    /// The frame of each target keyframe in a segment of `frames` frames.
    pub fn target_frames(&self, frames: usize) -> impl Iterator<Item = usize> {
        frames - self.targets.len()..frames
    }

    /// Fills `row` of the root stage's input, apart from the noise.
    pub(super) fn fill_root_input(&self, dims: &Dims, row: usize, input: &mut RootInput) {
        input.clear_row(row);
        for (slot, key) in self.context.iter().enumerate() {
            fill_slot(dims, row, slot, key, input);
        }
        // Slots count from the end of the last token; a given frame count may leave frames behind the last target.
        let spare = self.frames.map_or(0, |frames| {
            dims.tokens_for(frames) * dims.frames_per_token - frames
        });
        for (index, key) in self.targets.iter().enumerate() {
            let from_end = spare + self.targets.len() - index;
            if from_end <= dims.max_targets {
                fill_slot(dims, row, dims.slots() - from_end, key, input);
            }
        }
        for (allowed, may) in input
            .allowed_counts
            .row_mut(row)
            .iter_mut()
            .zip(&self.allowed_counts)
        {
            *allowed = f32::from(*may);
        }
    }

    /// Fills `row` of the later stages' input: all tokens masked, keyframe poses at their frames, and r_g3, which is
    /// `trajectory`, under the root guide.
    pub(super) fn fill_token_input(
        &self,
        dims: &Dims,
        row: usize,
        tokens: usize,
        trajectory: &[f32],
        input: &mut TokenInput,
    ) {
        input.clear_row(row, tokens);
        input.tokens.row_mut(row)[..tokens * dims.heads].fill(dims.codes as i64);
        let length = tokens * dims.frames_per_token * GLOBAL_ROOT;
        let roots = &mut input.global_root.row_mut(row)[..length];
        roots.copy_from_slice(&trajectory[..length]);
        if let Some(guide) = &self.root_guide {
            guide.apply(roots, dims.context_frames);
        }
        let frames = self.frames(dims, tokens);
        let gap = self.gap_poses.iter().map(|key| (key.frame, Some(&key.pose)));
        let context = self.context.iter().enumerate();
        let targets = self.target_frames(frames).zip(&self.targets);
        let keys = context
            .chain(targets)
            .map(|(frame, key)| (frame, key.pose.as_ref()));
        // Context and targets come last: they win over a pose in the gap.
        for (frame, pose) in gap.filter(|&(frame, _)| frame < frames).chain(keys) {
            if let Some(pose) = pose {
                let at = frame * dims.pose();
                input.frame_pose.row_mut(row)[at..at + dims.pose()].copy_from_slice(pose);
                input.frame_mask.row_mut(row)[frame] = 1.0;
            }
        }
    }
}

fn fill_slot(dims: &Dims, row: usize, slot: usize, key: &KeyTensors, input: &mut RootInput) {
    if let Some(local) = &key.local_root {
        let at = slot * LOCAL_ROOT;
        input.key_local_root.row_mut(row)[at..at + LOCAL_ROOT].copy_from_slice(local);
        input.has_local_root.row_mut(row)[slot] = 1.0;
    }
    if let Some(global) = &key.global_root {
        let at = slot * GLOBAL_ROOT;
        input.key_global_root.row_mut(row)[at..at + GLOBAL_ROOT].copy_from_slice(global);
        input.has_global_root.row_mut(row)[slot] = 1.0;
    }
    if let Some(pose) = &key.pose {
        let at = slot * dims.pose();
        input.key_pose.row_mut(row)[at..at + dims.pose()].copy_from_slice(pose);
        input.has_pose.row_mut(row)[slot] = 1.0;
    }
}

/// What the stages made of one character, in the segment frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RawMotion {
    /// Tokens of the segment.
    pub num_tokens: usize,
    /// Probability of each token count, from the pack's minimum on.
    pub count_probs: Vec<f32>,
    /// r_g3, as the root stage gave it, before any guide: `[4 * num_tokens, 5]`.
    pub root_r_g3: Vec<f32>,
    /// Pose tokens: `[num_tokens, heads]`.
    pub tokens: Vec<u32>,
    /// r_g4: `[4 * num_tokens, 5]`.
    pub root_r_g4: Vec<f32>,
    /// 6D rotations: `[4 * num_tokens, joints, 6]`.
    pub rotations: Vec<f32>,
    /// Contact probabilities: `[4 * num_tokens, contacts]`.
    pub contacts: Vec<f32>,
}

#[cfg(test)]
#[path = "work_tests.rs"]
mod tests;
