//! Fills rows of the stages' inputs from a task.

use troupe_motion::model::{Dims, GLOBAL_ROOT, KeyTensors, KeyframeTask, LOCAL_ROOT};

use super::{RootInput, TokenInput};

/// Fills rows of a batch.
pub(crate) trait FillRows {
    /// Fills `row` of the root stage's input, apart from the noise.
    fn fill_root_input(&self, dims: &Dims, row: usize, input: &mut RootInput);

    /// Fills `row` of the later stages' input: all tokens masked, keyframe poses at their frames,
    /// and the root r_g3: `trajectory`, moved by the root guide.
    fn fill_token_input(
        &self,
        dims: &Dims,
        row: usize,
        tokens: usize,
        trajectory: &[f32],
        input: &mut TokenInput,
    );
}

impl FillRows for KeyframeTask {
    fn fill_root_input(&self, dims: &Dims, row: usize, input: &mut RootInput) {
        input.clear_row(row);
        for (slot, key) in self.context.iter().enumerate() {
            fill_slot(dims, row, slot, key, input);
        }
        // Slots count from the end of the last token. A given frame count may leave frames after
        // the last target.
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

    fn fill_token_input(
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
        // Context and targets come last, so they replace a pose in the gap.
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

#[cfg(test)]
#[path = "fill_tests.rs"]
mod tests;
