//! What goes into a character and what comes out of it.

use std::sync::Arc;

use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use crate::engine::WorkItem;
use crate::object::Definitions;
use crate::primitives::{LocomotionCommand, PlanTargets};
use crate::scene::{Holder, SceneCell, Transform};

/// Parts that a frame of the timeline is counted in: 30, 50 and 60 Hz all take whole numbers of them.
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

/// How it is with the networks for one character. By default nothing holds plans up, as for a clock that waits for them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Strain {
    /// Frames that a plan asked for now is expected to take: it is to take over no sooner.
    pub expected_frames: u32,
    /// Frames that plans take at the moment: they are asked for as much ahead.
    pub lead_frames: u32,
    /// How much of the crowd's pressure falls on this character, 0 to 2 (see [`super::budget`]): plans are fewer and longer.
    pub stretch: f32,
}

/// How a character was set up.
#[derive(Debug, Clone, PartialEq)]
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
    /// Standing in the style's idle pose, root position over the ground (its y is not used) and heading.
    Standing(GlobalRoot),
    /// Four frames, oldest first; the last is frame 0. Rotations: `4 * joints`, joint 0 in the world.
    Context {
        /// Root positions.
        roots: [Vec3; CONTEXT_FRAMES],
        /// Poses.
        rotations: Vec<Quat>,
    },
}

/// The scene that a character lives in.
#[derive(Debug, Clone)]
pub struct World {
    /// The scene; shared with others, and changed by them.
    pub scene: Arc<SceneCell>,
    /// What its objects can be used for.
    pub definitions: Arc<Definitions>,
    /// The character's name in the scene: what it reserves and holds is reserved and held by this.
    pub holder: Holder,
}

/// What a command asks of a character, in the native convention.
#[derive(Debug, Clone, PartialEq)]
pub enum Intent {
    /// Move over the ground.
    Locomote(LocomotionCommand),
    /// Go to an object of the scene and use it.
    Interact {
        /// The object.
        instance: Arc<str>,
        /// Name of the variant. `None`: one by weight and seed.
        variant: Option<String>,
        /// Name of the approach. `None`: the nearest.
        approach: Option<String>,
    },
    /// Leave what is held by the variant's exit; nothing where there is no interaction.
    EndInteraction,
    /// Break off whatever it does, at once, and stand.
    Cancel,
    /// Put down what is in the hand, by its definition's rule; nothing where the hand is empty.
    Drop,
}

/// Why a command is not accepted: the character could not do it now. Nothing has changed then, and its sequence number is
/// free. What is found out later is told by [`EventKind::Failed`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The session is in no scene.
    #[error("the session is in no scene")]
    NoScene,
    /// No such object in the scene.
    #[error("the scene has no object {id:?}")]
    UnknownObject {
        /// Its id.
        id: Arc<str>,
    },
    /// The object's definition is for characters of another pack.
    #[error("object {id:?} can be used by characters of pack {pack} only")]
    WrongPack {
        /// The object.
        id: Arc<str>,
        /// The pack that its definition was checked for.
        pack: String,
    },
    /// The definition has no such variant.
    #[error("object definition {definition:?} has no variant {name:?}")]
    UnknownVariant {
        /// The definition.
        definition: String,
        /// What was asked for.
        name: String,
        /// The variants that there are.
        there_are: Vec<String>,
    },
    /// The definition has no such approach.
    #[error("object definition {definition:?} has no approach {name:?}")]
    UnknownApproach {
        /// The definition.
        definition: String,
        /// What was asked for.
        name: String,
        /// The approaches that there are.
        there_are: Vec<String>,
    },
    /// Another character has reserved or holds the object.
    #[error("object {id:?} is taken by {by}")]
    Taken {
        /// The object.
        id: Arc<str>,
        /// Who has it.
        by: Holder,
    },
    /// Something stands between the character and where it would start.
    #[error("the way to object {id:?} is blocked by {by}")]
    Blocked {
        /// The object.
        id: Arc<str>,
        /// What is in the way, for example `object "crate"` or `collider "wall"`.
        by: String,
    },
    /// The hand holds another object.
    #[error("the character holds object {id:?}; allowed: to drop it first")]
    HandFull {
        /// What it holds.
        id: Arc<str>,
    },
}

/// What a character is about.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Activity {
    /// It moves as its command says.
    #[default]
    Locomotion,
    /// It is on its way to an object.
    Approaching {
        /// The object.
        instance: Arc<str>,
    },
    /// It goes through the sets of an interaction.
    Interacting {
        /// The object.
        instance: Arc<str>,
        /// The set that it is in.
        set: String,
    },
    /// It holds a set's last keyframe.
    Held {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
    },
    /// It is in the air, or has just landed.
    Falling,
}

/// An object in a character's hand.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldObject {
    /// The object.
    pub instance: Arc<str>,
    /// Where it is in the world at the cursor.
    pub transform: Transform,
}

/// Something that happened to a character.
#[derive(Debug, Clone, PartialEq)]
pub struct CharacterEvent {
    /// The frame of the timeline at which it did.
    pub frame: u64,
    /// What happened.
    pub kind: EventKind,
}

/// What can happen to a character.
#[derive(Debug, Clone, PartialEq)]
pub enum EventKind {
    /// An interaction began: the object is reserved.
    Started {
        /// The object.
        instance: Arc<str>,
        /// Name of its definition.
        definition: String,
        /// The variant that was chosen.
        variant: String,
        /// The approach that was chosen; none where the definition has none.
        approach: Option<String>,
        /// What the variant was chosen by.
        seed: u64,
    },
    /// A set of keyframes began.
    Entered {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
    },
    /// A keyframe was reached.
    Reached {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
        /// Index of the keyframe in it.
        keyframe: u32,
        /// How far off the motion was before it was drawn to the keyframe.
        before: KeyframeError,
        /// How far off it is in the frames that were sent.
        after: KeyframeError,
    },
    /// The object went to a socket.
    Attached {
        /// The object.
        instance: Arc<str>,
        /// The socket.
        socket: String,
    },
    /// The object was put down.
    Released {
        /// The object.
        instance: Arc<str>,
        /// Where it is now.
        transform: Transform,
    },
    /// An interaction went through to its end.
    Done {
        /// The object.
        instance: Arc<str>,
    },
    /// An interaction could not go on.
    Failed {
        /// The object.
        instance: Arc<str>,
        /// Why.
        reason: FailReason,
        /// The same for people, with names and numbers.
        message: String,
    },
    /// A command broke an interaction off.
    Interrupted {
        /// The object.
        instance: Arc<str>,
    },
    /// The ground ended.
    Fell {
        /// How far down the next surface is, metres. `None`: there is none within reach.
        height_m: Option<f32>,
    },
    /// A fall ended on a surface.
    Landed {
        /// How far it fell, metres.
        height_m: f32,
        /// Speed downward at the touch, m/s.
        speed_mps: f32,
    },
}

/// How far a motion is from a keyframe; 0 for what the keyframe does not say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KeyframeError {
    /// Root joint, metres.
    pub root_m: f32,
    /// Heading, radians.
    pub heading: f32,
    /// The farthest of all joints that the keyframe places, metres.
    pub joint_m: f32,
}

/// Why an interaction could not go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FailReason {
    /// The place to start from was not reached in time.
    NotReached,
    /// Something came in the way.
    Blocked,
    /// Somebody else had the object when the interaction was to begin.
    Taken,
    /// The object was moved too late to follow it.
    Moved,
    /// The object was taken out of the scene.
    Removed,
    /// There is no place to put the object down.
    NoPlace,
    /// The networks gave no motion.
    NoPlan,
}

impl FailReason {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::NotReached,
        Self::Blocked,
        Self::Taken,
        Self::Moved,
        Self::Removed,
        Self::NoPlace,
        Self::NoPlan,
    ];

    /// Its word in messages and metrics.
    pub fn word(self) -> &'static str {
        match self {
            Self::NotReached => "NOT_REACHED",
            Self::Blocked => "BLOCKED",
            Self::Taken => "TAKEN",
            Self::Moved => "MOVED",
            Self::Removed => "REMOVED",
            Self::NoPlace => "NO_PLACE",
            Self::NoPlan => "NO_PLAN",
        }
    }
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandOutcome {
    /// It holds, or will at its frame.
    Accepted,
    /// Its sequence number came before.
    Repeated,
    /// A higher sequence number came before.
    Late,
}

/// What became of a step of the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// The cursor is where it should be.
    Moved,
    /// The cursor waits at a frame for its plan. Once that has come (or has failed and the next one was asked for),
    /// `advance` by 0 takes it the rest of the way.
    NeedsPlan,
}

/// What called for a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanCause {
    /// The command changed.
    Command,
    /// The buffer ran low.
    LowBuffer,
    /// The style's interval went by.
    Interval,
}

/// A plan to ask the networks for.
#[derive(Debug, Clone)]
pub struct PlanRequest {
    /// Counts the character's plans from 0.
    pub number: u64,
    /// What called for it.
    pub cause: PlanCause,
    /// The work, in its segment frame.
    pub item: WorkItem,
    /// What it takes to turn the answer into frames.
    pub shape: Arc<LiveShape>,
    /// Frames until the plan is to take over; after that it is late.
    pub splice_in_frames: u32,
    /// Frames until it is missed: the scheduler's deadline.
    pub due_in_frames: u32,
    /// Frames from where the plan before took over to where this one is to; none for the first.
    pub spacing_frames: Option<u32>,
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
}

/// A plan that could not be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanFailed;

/// What became of a plan that arrived.
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
    /// Bit i for contact joint i.
    pub contacts: u8,
    /// The character had to slow down at this frame.
    pub underrun: bool,
}

/// What a character has done so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stats {
    /// Plans that took over, for a command.
    pub plans_for_command: u64,
    /// For a low buffer.
    pub plans_for_low_buffer: u64,
    /// For the interval.
    pub plans_for_interval: u64,
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
#[derive(Debug, Clone, PartialEq)]
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
