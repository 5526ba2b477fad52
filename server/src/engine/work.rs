//! One character's way through the stages: what goes in and what comes out, in the segment frame.

use super::{RootInput, RootOutput, TokenInput};
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

    /// Fills `row` of the later stages' input: all tokens masked, keyframe poses at their frames.
    pub(super) fn fill_token_input(
        &self,
        dims: &Dims,
        row: usize,
        tokens: usize,
        root: &RootOutput,
        input: &mut TokenInput,
    ) {
        input.clear_row(row, tokens);
        input.tokens.row_mut(row)[..tokens * dims.heads].fill(dims.codes as i64);
        input
            .global_root
            .row_mut(row)
            .copy_from_slice(root.global_root.row(row));
        let context = self.context.iter().enumerate();
        let targets = self.target_frames(self.frames(dims, tokens)).zip(&self.targets);
        for (frame, key) in context.chain(targets) {
            if let Some(pose) = &key.pose {
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
    /// r_g3: `[4 * num_tokens, 5]`.
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
