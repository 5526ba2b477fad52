//! What goes into a character and what comes out of it.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::robot::Fitted;
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use super::{Intent, Pins};
use crate::primitives::PlanTargets;
use crate::primitives::object::KeyframeError;
use troupe_motion::model::{KeyTensors, KeyframeTask};

/// Parts that a frame of the timeline is counted in: 30, 50 and 60 Hz all take whole numbers of
/// them.
pub const SUB_FRAMES: u32 = 300;

/// Context frames that a plan starts from.
pub const CONTEXT_FRAMES: usize = 4;

/// Who may hold a character up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// The character waits for a plan that it needs.
    Waits,
    /// Time goes on: without its plan the character moves on what it has.
    Runs,
}

/// How it is with the networks for one character. By default nothing holds plans up, as for a clock
/// that waits for them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Strain {
    /// Frames that a plan asked for now is expected to take: it is to take over no sooner.
    pub expected_frames: u32,
    /// Frames that plans take at the moment: they are asked for as much ahead.
    pub lead_frames: u32,
    /// How much of the crowd's pressure falls on this character, 0 to 2 (see [`super::budget`]):
    /// plans are fewer and longer.
    pub stretch: f32,
}

/// How a character was set up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CharacterOptions {
    /// Seed of all random choices.
    pub seed: u64,
    /// Frames between the cursor and the point where a new plan takes over.
    pub look_ahead_frames: u32,
    /// Frames between plans, where not the style's.
    pub replan_interval_frames: Option<u32>,
    /// How closely the root follows the spring's path, where not the style's.
    pub root_ratio: Option<f32>,
    /// Sampling temperature of poses.
    pub temperature: f32,
}

/// How a character begins.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// Standing in the style's idle pose, root position over the ground (its y is not used) and
    /// heading.
    Standing(GlobalRoot),
    /// Four frames, oldest first; the last is frame 0. Rotations: `4 * joints`, joint 0 in the
    /// world.
    Context {
        /// Root positions.
        roots: [Vec3; CONTEXT_FRAMES],
        /// Poses.
        rotations: Vec<Quat>,
    },
}

/// Result of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandOutcome {
    /// It holds, or will at its frame.
    Accepted,
    /// Its sequence number came before.
    Repeated,
    /// A higher sequence number came before.
    Late,
}

/// Result of a step of the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// The cursor is where it should be.
    Moved,
    /// The cursor waits at a frame for its plan. Once that has come (or has failed and the next one
    /// was asked for), `advance` by 0 takes it the rest of the way.
    NeedsPlan,
}

/// What called for a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PlanCause {
    /// The command changed.
    Command,
    /// The buffer ran low.
    LowBuffer,
    /// The style's interval went by.
    Interval,
    /// The next keyframes of an object.
    Object,
}

/// A plan to ask the networks for.
#[derive(Debug, Clone)]
pub struct PlanRequest {
    /// Counts the character's plans from 0.
    pub number: u64,
    /// What called for it.
    pub cause: PlanCause,
    /// The work, in its segment frame.
    pub item: PlanItem,
    /// What it takes to turn the answer into frames.
    pub shape: Arc<LiveShape>,
    /// The keyframes that the answer is to meet; none for locomotion, whose targets are guidance.
    pub pins: Option<Arc<Pins>>,
    /// Frames until the plan is to take over; after that it is late.
    pub splice_in_frames: u32,
    /// Frames until it is missed: the scheduler's deadline.
    pub due_in_frames: u32,
    /// Frames from where the plan before took over to where this one is to; none for the first.
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

/// A path to follow, apart from what follows from the pack and the body.
#[derive(Debug, Clone, PartialEq)]
pub struct PathItem {
    /// The context frames, each with root and pose.
    pub context: Vec<KeyTensors>,
    /// `[frames][x, z, heading]`, metres and radians; it passes the context's roots.
    pub path: Box<[[f32; 3]]>,
    /// Words that say how to move, with their weights.
    pub words: Vec<(String, f32)>,
    /// Seed of all random choices.
    pub seed: u64,
}

impl PlanItem {
    /// Frames of the segment, where they are fixed.
    pub fn frames(&self) -> Option<usize> {
        match self {
            Self::Keyframes(task) => task.frames,
            Self::Path(item) => Some(item.path.len()),
        }
    }

    /// The keyframes to go to, where it is those.
    pub fn keyframes(&self) -> Option<&KeyframeTask> {
        match self {
            Self::Keyframes(task) => Some(task),
            Self::Path(_) => None,
        }
    }
}

/// What it takes to turn a plan's raw motion into frames.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveShape {
    /// Where the segment lies in the world.
    pub frame: SegmentFrame,
    /// The four context frames in the world: root positions.
    pub context_roots: [Vec3; CONTEXT_FRAMES],
    /// The four context poses, `4 * joints`: joint 0 in the world.
    pub context_rotations: Vec<Quat>,
    /// What was asked for.
    pub targets: PlanTargets,
}

/// A plan's frames in the world, from the first context frame on.
#[derive(Debug, Clone, PartialEq)]
pub struct LivePlan {
    /// Root positions, one a frame.
    pub roots: Vec<Vec3>,
    /// Rotations, `frames * joints`: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Contacts, one a frame: bit i for contact joint i.
    pub contacts: Vec<u8>,
    /// What the stages made on the way.
    pub trace: PlanTrace,
}

/// What the stages made on the way to a plan, in the world.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanTrace {
    /// r_g3, one a frame.
    pub r_g3: Vec<GlobalRoot>,
    /// r_g4, one a frame.
    pub r_g4: Vec<GlobalRoot>,
    /// Pose tokens, `tokens * heads`.
    pub tokens: Vec<u32>,
    /// Probability of each token count.
    pub count_probs: Vec<f32>,
    /// How far the answer was from each keyframe that it was to meet, before it was drawn to them.
    pub off: Vec<KeyframeError>,
}

/// A plan that could not be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanFailed;

/// Result of a plan that arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Arrival {
    /// It takes over at its splice frame, this many frames from now.
    InTime {
        /// Frames of the timeline, with a fraction.
        lead_frames: f32,
    },
    /// It came after its splice frame and takes over at the next frame.
    Late,
    /// It came so late that too little of it was left; another one is asked for.
    Dropped,
    /// It failed; another one is asked for.
    Failed,
    /// Nobody waits for it: it came before, or was never asked for.
    Stray,
}

/// A frame to send; buffers are reused.
#[derive(Debug, Clone, Default)]
pub struct FrameOut {
    /// Frame of the timeline, rounded down.
    pub frame: u64,
    /// Root position in the world, native convention.
    pub root: Vec3,
    /// One for each joint: the first in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Angles of a robot's hinges, which the rotations are of, and what it took; empty where it is
    /// none.
    pub fitted: Fitted,
    /// Bit i for contact joint i.
    pub contacts: u8,
    /// The character had to slow down at this frame.
    pub underrun: bool,
}

/// What a character has done so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stats {
    /// Plans that took over, for a command.
    pub plans_for_command: u64,
    /// For a low buffer.
    pub plans_for_low_buffer: u64,
    /// For the interval.
    pub plans_for_interval: u64,
    /// For the keyframes of objects.
    pub plans_for_object: u64,
    /// Plans that came after their splice frame.
    pub late_plans: u64,
    /// Times that the character had to slow down.
    pub underruns: u64,
    /// Plans that failed.
    pub failed_plans: u64,
}

/// A character as it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The cursor's frame.
    pub frame: u64,
    /// Where the root is and faces.
    pub root: GlobalRoot,
    /// Speed over the ground, m/s.
    pub speed_mps: f32,
    /// Frames beyond the cursor.
    pub buffered_frames: u32,
    /// Highest sequence number of a command.
    pub last_sequence: u64,
    /// What it has done so far.
    pub stats: Stats,
}

/// A plan that took over: what was asked of the networks and what each stage made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRecord {
    /// Counts the character's plans from 0.
    pub number: u64,
    /// What called for it.
    pub cause: PlanCause,
    /// The cursor's frame when it was asked for.
    pub asked_at: u64,
    /// The frame of its last context frame.
    pub splice: u64,
    /// What was asked.
    pub shape: Arc<LiveShape>,
    /// What came.
    pub trace: PlanTrace,
}

/// A command that waits for its frame, or for the plan in flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WaitingCommand {
    /// Its sequence number.
    pub sequence: u64,
    /// Frame from which it holds.
    pub frame: u64,
    /// What it asks for.
    pub intent: Intent,
}

/// A character's future and the plan behind it.
#[derive(Debug, Clone)]
pub struct Peek {
    /// Frame of the first frame below.
    pub first_frame: u64,
    /// Root positions beyond the cursor.
    pub roots: Vec<Vec3>,
    /// Poses beyond the cursor.
    pub rotations: Vec<Quat>,
    /// Contacts beyond the cursor.
    pub contacts: Vec<u8>,
    /// The newest plan in the buffer; none before the first.
    pub plan: Option<Arc<PlanRecord>>,
    /// Whether a plan is on its way.
    pub in_flight: bool,
    /// A command that waits.
    pub waiting: Option<WaitingCommand>,
}
