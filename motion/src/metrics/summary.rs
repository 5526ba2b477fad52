//! All measures of one task, and their means over many tasks.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{
    MetricError, Npss, contact_accuracy, foot_skate_m_per_frame, joint_jitter_mps2, keyframe_error_m, l2p_m,
    l2q, penetration_m, reached, root_error_m, root_jitter_mps2,
};
use crate::clip::Clip;
use crate::fk::WorldMotion;

/// The parts of an in-betweening task, without holes: context frames, gap, target frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Task {
    /// Frames given at the start.
    pub context_frames: usize,
    /// Frames to fill.
    pub gap_frames: usize,
    /// Frames given at the end.
    pub target_frames: usize,
}

impl Task {
    /// Number of frames of all parts.
    pub fn frames(&self) -> usize {
        self.context_frames + self.gap_frames + self.target_frames
    }

    /// Indices of the context frames.
    pub fn context(&self) -> Range<usize> {
        0..self.context_frames
    }

    /// Indices of the frames to fill.
    pub fn gap(&self) -> Range<usize> {
        self.context_frames..self.context_frames + self.gap_frames
    }

    /// Indices of the target frames.
    pub fn targets(&self) -> Range<usize> {
        self.context_frames + self.gap_frames..self.frames()
    }
}

/// The measures that have a value for each task; the functions of this module define them. Over the
/// gap only, unless the name says context or target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// [`l2p_m`].
    pub l2p_m: f64,
    /// [`l2q`].
    pub l2q: f64,
    /// NPSS. Over many tasks it is not the mean, but weighted by power; see [`Npss`].
    pub npss: f64,
    /// [`foot_skate_m_per_frame`].
    pub foot_skate_m_per_frame: f64,
    /// [`penetration_m`].
    pub penetration_m: f64,
    /// [`contact_accuracy`], 0 to 1.
    pub contact_accuracy: f64,
    /// [`joint_jitter_mps2`].
    pub joint_jitter_mps2: f64,
    /// [`root_jitter_mps2`].
    pub root_jitter_mps2: f64,
    /// [`keyframe_error_m`] over the context frames.
    pub context_keyframe_error_m: f64,
    /// [`keyframe_error_m`] over the target frames.
    pub target_keyframe_error_m: f64,
    /// [`root_error_m`] over the context frames.
    pub context_root_error_m: f64,
    /// [`root_error_m`] over the target frames.
    pub target_root_error_m: f64,
    /// 1 if the last target's root was [`reached`], otherwise 0; over many tasks the share.
    pub reaching_success: f64,
}

/// One task's measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// The measures of the task.
    pub figures: Figures,
    /// NPSS with its weight, for [`Summary`].
    pub npss: Npss,
}

/// Measures `clip` against `truth`. Both have exactly the task's frames, the same joints and the
/// same rate.
///
/// # Errors
/// [`MetricError`] if the clips do not fit each other or the task, a part of the task is empty, or
/// the skeleton has no contact joints.
pub fn evaluate(clip: &Clip, truth: &Clip, task: Task) -> Result<Evaluation, MetricError> {
    if clip.frames() != task.frames() || truth.frames() != task.frames() {
        return Err(MetricError::Shape("frames"));
    }
    if (clip.fps - truth.fps).abs() > 1e-3 * truth.fps {
        return Err(MetricError::Shape("rate"));
    }
    let skeleton = &*truth.skeleton;
    let fps = truth.fps;
    let (motion, wanted) = (WorldMotion::from_clip(clip), WorldMotion::from_clip(truth));
    let (context, gap, targets) = (task.context(), task.gap(), task.targets());
    let mut npss = Npss::default();
    npss.add(&motion, &wanted, gap.clone())?;
    let figures = Figures {
        l2p_m: l2p_m(&motion, &wanted, gap.clone())?,
        l2q: l2q(&motion, &wanted, gap.clone())?,
        npss: npss.value().unwrap_or(0.0),
        foot_skate_m_per_frame: foot_skate_m_per_frame(skeleton, &motion, gap.clone())?,
        penetration_m: penetration_m(skeleton, &motion, gap.clone())?,
        contact_accuracy: contact_accuracy(skeleton, &motion, &wanted, gap.clone(), fps)?,
        joint_jitter_mps2: joint_jitter_mps2(&motion, gap.clone(), fps)?,
        root_jitter_mps2: root_jitter_mps2(&motion, gap, fps)?,
        context_keyframe_error_m: keyframe_error_m(&motion, &wanted, context.clone())?,
        target_keyframe_error_m: keyframe_error_m(&motion, &wanted, targets.clone())?,
        context_root_error_m: root_error_m(&motion, &wanted, context)?,
        target_root_error_m: root_error_m(&motion, &wanted, targets)?,
        reaching_success: f64::from(u8::from(reached(clip, truth, task.frames() - 1))),
    };
    Ok(Evaluation { figures, npss })
}

/// Means over many tasks; NPSS is weighted by power across all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    count: u64,
    sums: Figures,
    npss: Npss,
}

impl Summary {
    /// Adds one task.
    pub fn add(&mut self, evaluation: &Evaluation) {
        self.count += 1;
        self.npss.merge(&evaluation.npss);
        self.sums = self.sums.zip(&evaluation.figures, |a, b| a + b);
    }

    /// Adds what another has gathered, `times` times.
    pub fn merge(&mut self, other: &Self, times: u32) {
        self.count += other.count * u64::from(times);
        self.npss.merge_times(&other.npss, times);
        self.sums = self.sums.zip(&other.sums, |a, b| a + b * f64::from(times));
    }

    /// Number of tasks.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The means; `None` before the first task.
    pub fn figures(&self) -> Option<Figures> {
        if self.count == 0 {
            return None;
        }
        let n = self.count as f64;
        let mut figures = self.sums.zip(&self.sums, |a, _| a / n);
        figures.npss = self.npss.value().unwrap_or(0.0);
        Some(figures)
    }
}

impl Figures {
    /// Names of the figures in reports, in the order of [`Self::values`].
    pub const NAMES: [&'static str; 13] = [
        "l2p_m",
        "l2q",
        "npss",
        "foot_skate_m_per_frame",
        "penetration_m",
        "contact_accuracy",
        "joint_jitter_mps2",
        "root_jitter_mps2",
        "context_keyframe_error_m",
        "target_keyframe_error_m",
        "context_root_error_m",
        "target_root_error_m",
        "reached",
    ];

    /// The figures in the order of [`Self::NAMES`].
    pub fn values(&self) -> [f64; 13] {
        [
            self.l2p_m,
            self.l2q,
            self.npss,
            self.foot_skate_m_per_frame,
            self.penetration_m,
            self.contact_accuracy,
            self.joint_jitter_mps2,
            self.root_jitter_mps2,
            self.context_keyframe_error_m,
            self.target_keyframe_error_m,
            self.context_root_error_m,
            self.target_root_error_m,
            self.reaching_success,
        ]
    }

    /// The figures from their values in the order of [`Self::NAMES`].
    fn from_values(values: [f64; 13]) -> Self {
        let [
            l2p_m,
            l2q,
            npss,
            foot_skate_m_per_frame,
            penetration_m,
            contact_accuracy,
            joint_jitter_mps2,
            root_jitter_mps2,
            context_keyframe_error_m,
            target_keyframe_error_m,
            context_root_error_m,
            target_root_error_m,
            reaching_success,
        ] = values;
        Self {
            l2p_m,
            l2q,
            npss,
            foot_skate_m_per_frame,
            penetration_m,
            contact_accuracy,
            joint_jitter_mps2,
            root_jitter_mps2,
            context_keyframe_error_m,
            target_keyframe_error_m,
            context_root_error_m,
            target_root_error_m,
            reaching_success,
        }
    }

    /// Combines two sets of figures one by one.
    fn zip(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let (mut values, others) = (self.values(), other.values());
        for (value, other) in values.iter_mut().zip(others) {
            *value = f(*value, other);
        }
        Self::from_values(values)
    }
}
