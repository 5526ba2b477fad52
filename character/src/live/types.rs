//! Inputs and outputs of a character.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::robot::{Fitted, HingeRate};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use super::{Intent, Pins};
use crate::primitives::PlanTargets;
use crate::primitives::object::KeyframeError;
use troupe_motion::model::{KeyTensors, KeyframeTask};

/// Sub-frames of a frame. A tick at 30, 50 or 60 Hz is a whole number of them.
pub const SUB_FRAMES: u32 = 300;

/// Context frames that a plan starts from.
pub const CONTEXT_FRAMES: usize = 4;

/// Whether a character waits for its plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// The cursor stops for a plan that the character needs.
    Waits,
    /// Time goes on. Without its plan the character moves on what it has, and slows down.
    Runs,
}

/// The load of the networks for one character. By default there is none, as for a clock that waits
/// for its plans.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Strain {
    /// Frames that a plan asked for now is expected to take; it takes over no sooner.
    pub expected_frames: u32,
    /// Frames that plans take at the moment; they are asked for that far ahead.
    pub lead_frames: u32,
    /// The character's share of the crowd's pressure, 0 to 2 (see [`super::budget`]). It makes
    /// plans fewer and longer.
    pub stretch: f32,
}

/// Options of a character, which do not change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CharacterOptions {
    /// Seed of all random choices.
    pub seed: u64,
    /// Frames between the cursor and where a new plan takes over.
    pub look_ahead_frames: u32,
    /// Frames between plans. `None`: the style's.
    pub replan_interval_frames: Option<u32>,
    /// How closely the root follows the spring's path, 0 to 1.2. `None`: the style's.
    pub root_ratio: Option<f32>,
    /// Sampling temperature of poses.
    pub temperature: f32,
}

/// How a character begins.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// Standing in the style's idle pose. Position over the ground (y is ignored) and heading.
    Standing(GlobalRoot),
    /// Four frames, oldest first; the last is frame 0.
    Context {
        /// Root positions, metres.
        roots: [Vec3; CONTEXT_FRAMES],
        /// `4 * joints`: joint 0 in the world, others relative to their parents.
        rotations: Vec<Quat>,
    },
}

/// Result of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandOutcome {
    /// It holds now, or will from its frame on.
    Accepted,
    /// A command with this sequence number came before.
    Repeated,
    /// A command with a higher sequence number came before.
    Late,
}

/// Result of a step of the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// The cursor has made the whole step.
    Moved,
    /// The cursor waits at a frame for its plan. Once the plan has arrived, or has failed and the
    /// next was asked for, `advance` by 0 goes the rest of the way.
    NeedsPlan,
}

/// What made a character ask for a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PlanCause {
    /// The command changed.
    Command,
    /// The buffer ran low.
    LowBuffer,
    /// The time between two plans is over.
    Interval,
    /// Keyframes of an object come next.
    Object,
}

/// A plan to ask the networks for.
#[derive(Debug, Clone)]
pub struct PlanRequest {
    /// Counts the character's plans from 0.
    pub number: u64,
    /// What made the character ask.
    pub cause: PlanCause,
    /// The work, in the plan's segment frame.
    pub item: PlanItem,
    /// What is needed to turn the answer into frames.
    pub shape: Arc<LiveShape>,
    /// The keyframes that the plan must meet. None for locomotion, whose targets are guidance.
    pub pins: Option<Arc<Pins>>,
    /// Frames until the plan is to take over. After that it is late.
    pub splice_in_frames: u32,
    /// Frames until the scheduler's deadline.
    pub due_in_frames: u32,
    /// Frames between where the plan before took over and where this one is to; none for the first.
    pub spacing_frames: Option<u32>,
}

/// What a plan asks of a model, in its segment frame.
#[derive(Debug, Clone, PartialEq)]
pub enum PlanItem {
    /// Keyframes to go to.
    Keyframes(KeyframeTask),
    /// A path to follow.
    Path(PathItem),
}

/// A path to follow, without what the pack and the body already say.
#[derive(Debug, Clone, PartialEq)]
pub struct PathItem {
    /// The context frames, each with root and pose.
    pub context: Vec<KeyTensors>,
    /// `[frames][x, z, heading]`, metres and radians. The context's roots lie on it.
    pub path: Box<[[f32; 3]]>,
    /// Words that say how to move, with their weights.
    pub words: Vec<(String, f32)>,
    /// Seed of all random choices.
    pub seed: u64,
}

impl PlanItem {
    /// Frames of the segment; none if the root stage chooses.
    pub fn frames(&self) -> Option<usize> {
        match self {
            Self::Keyframes(task) => task.frames,
            Self::Path(item) => Some(item.path.len()),
        }
    }

    /// The keyframes to go to; none for a path.
    pub fn keyframes(&self) -> Option<&KeyframeTask> {
        match self {
            Self::Keyframes(task) => Some(task),
            Self::Path(_) => None,
        }
    }
}

/// What is needed to turn a plan's raw motion into frames.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveShape {
    /// The segment frame in the world.
    pub frame: SegmentFrame,
    /// Root positions of the four context frames in the world, metres.
    pub context_roots: [Vec3; CONTEXT_FRAMES],
    /// The four context poses, `4 * joints`: joint 0 in the world, others relative to their
    /// parents.
    pub context_rotations: Vec<Quat>,
    /// What the plan was asked for.
    pub targets: PlanTargets,
}

/// A plan's frames in the world, from the first context frame on.
#[derive(Debug, Clone, PartialEq)]
pub struct LivePlan {
    /// Root positions, one a frame, metres.
    pub roots: Vec<Vec3>,
    /// Rotations, `frames * joints`: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Contacts, one a frame: bit i for contact joint i.
    pub contacts: Vec<u8>,
    /// The character has feet stand once the plan took over: see [`super::hold_plan`].
    pub feet_glide: bool,
    /// What the stages made on the way.
    pub trace: PlanTrace,
}

/// What the stages made on the way to a plan, in the world.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanTrace {
    /// Root after the root stage, one a frame.
    pub r_g3: Vec<GlobalRoot>,
    /// Root after the decoder, one a frame.
    pub r_g4: Vec<GlobalRoot>,
    /// Pose tokens, `tokens * heads`.
    pub tokens: Vec<u32>,
    /// Probability of each token count.
    pub count_probs: Vec<f32>,
    /// How far the answer was from each keyframe that it must meet, before it was pinned.
    pub off: Vec<KeyframeError>,
}

/// The networks could not make a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanFailed;

/// What happens with a plan that arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Arrival {
    /// It takes over at its splice frame, this many frames from now.
    InTime {
        /// Frames of the timeline, with a fraction.
        lead_frames: f32,
    },
    /// It came after its splice frame, and takes over at the next frame.
    Late,
    /// It came so late that too little of it was left. The character asks for another.
    Dropped,
    /// It failed. The character asks for another.
    Failed,
    /// The character does not wait for it: it came before, or was never asked for.
    Stray,
}

/// One frame to send. Its memory is reused.
#[derive(Debug, Clone, Default)]
pub struct FrameOut {
    /// Frame of the timeline, rounded down.
    pub frame: u64,
    /// Root position in the world, native convention, metres.
    pub root: Vec3,
    /// One rotation a joint: the first in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Angles of a robot's hinges, which the rotations follow, and how far the pose was from them.
    /// Empty for other bodies.
    pub fitted: Fitted,
    /// How fast the hinges turned since the frame before. A character does not measure it; sessions
    /// do.
    pub hinge_rate: HingeRate,
    /// Bit i for contact joint i.
    pub contacts: u8,
    /// The character had to slow down at this frame.
    pub underrun: bool,
}

/// Counters since the character began.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stats {
    /// Plans for a command that took over.
    pub plans_for_command: u64,
    /// Plans for a low buffer that took over.
    pub plans_for_low_buffer: u64,
    /// Plans for the interval that took over.
    pub plans_for_interval: u64,
    /// Plans for the keyframes of objects that took over.
    pub plans_for_object: u64,
    /// Plans that came after their splice frame.
    pub late_plans: u64,
    /// Times that the character began to slow down without a plan.
    pub underruns: u64,
    /// Plans that the networks could not make.
    pub failed_plans: u64,
}

impl Stats {
    /// How many plans for this cause have taken over.
    pub(super) fn plans_for(&mut self, cause: PlanCause) -> &mut u64 {
        match cause {
            PlanCause::Command => &mut self.plans_for_command,
            PlanCause::LowBuffer => &mut self.plans_for_low_buffer,
            PlanCause::Interval => &mut self.plans_for_interval,
            PlanCause::Object => &mut self.plans_for_object,
        }
    }
}

/// State of a character at its cursor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The cursor's frame, rounded down.
    pub frame: u64,
    /// Position and heading of the root.
    pub root: GlobalRoot,
    /// Speed over the ground, m/s.
    pub speed_mps: f32,
    /// Whole frames in the buffer beyond the cursor.
    pub buffered_frames: u32,
    /// Highest sequence number of a command; 0 before the first.
    pub last_sequence: u64,
    /// Counters since the character began.
    pub stats: Stats,
}

/// A plan that took over: what it was asked for, and what each stage made.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRecord {
    /// Counts the character's plans from 0.
    pub number: u64,
    /// What made the character ask.
    pub cause: PlanCause,
    /// The cursor's frame when it was asked for.
    pub asked_at: u64,
    /// Frame of the plan's last context frame.
    pub splice: u64,
    /// What the plan was asked for.
    pub shape: Arc<LiveShape>,
    /// What the stages made of it.
    pub trace: PlanTrace,
}

/// A command that waits for its frame, or for the plan in flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WaitingCommand {
    /// Sequence number of the command.
    pub sequence: u64,
    /// Frame from which it holds.
    pub frame: u64,
    /// What it asks for.
    pub intent: Intent,
}

/// A character's frames to come, and the plan that they come from.
#[derive(Debug, Clone)]
pub struct Peek {
    /// Number of the first of the frames below.
    pub first_frame: u64,
    /// Root positions beyond the cursor, one a frame, metres.
    pub roots: Vec<Vec3>,
    /// Rotations beyond the cursor, `frames * joints`.
    pub rotations: Vec<Quat>,
    /// Contacts beyond the cursor, one a frame: bit i for contact joint i.
    pub contacts: Vec<u8>,
    /// The newest plan in the buffer; none before the first.
    pub plan: Option<Arc<PlanRecord>>,
    /// Whether a plan was asked for that has not arrived.
    pub in_flight: bool,
    /// The next command that waits.
    pub waiting: Option<WaitingCommand>,
}
