//! Smart objects: what characters can do with a thing, as data (paper section 6.2 and appendix G).
//!
//! A [`Definition`] is read from TOML or JSON ([`Definition::from_toml`],
//! [`Definition::from_json`], [`load_file`]). It is checked for one pack, whose skeleton gives its
//! poses and joints. It says what the object is like and where a character must be to use it
//! (`shape`, `trigger`, `approaches`), how it is carried and put down (`sockets`, `release`), and
//! what happens: `sets` of one to four consecutive keyframes. Each `variant` names its first set
//! and those after it.
//!
//! Keyframes are written for a character that comes from the object's +Z side. [`Anchor`] turns a
//! keyframe into the world by the object's place and heading. A keyframe with the pivot flag ω also
//! turns about the pivot, to the side that the character comes from. A [`Variant`] is chosen by
//! weight and seed; one seed always chooses the same.
//!
//! Nothing here knows sessions, clocks or networks.

mod anchor;
mod approach;
mod check;
mod check_sets;
mod place;
mod read;
mod scaled;
mod socket;
mod table;
mod variant;

#[cfg(test)]
mod anchor_tests;
#[cfg(test)]
mod example_tests;
#[cfg(test)]
mod fuzz_tests;
#[cfg(test)]
mod read_tests;
#[cfg(test)]
mod table_tests;
#[cfg(any(test, feature = "testing"))]
#[allow(clippy::unwrap_used, reason = "for tests")]
pub mod testing;

use std::sync::Arc;

use troupe_motion::{Quat, Vec3};

use crate::scene::{ObjectBody, Shape};

pub use anchor::{Anchor, WorldKeyframe, WorldPoint};
pub use approach::Choice;
pub use place::{PlaceError, Placement};
pub use read::{load_file, load_folder};
pub use table::{DefinitionList, Definitions, DefinitionsError, Listed, Uploaded};
pub use troupe_proto::docs::{
    Align, AnchorDoc, ApproachDoc, EventDoc, KeyframeDoc, Moment, Motion, ObjectDoc, Origin, PointDoc,
    ReleaseDoc, SetDoc, SocketDoc, TriggerDoc, VariantDoc,
};

/// The format number of definitions that this server reads.
pub const FORMAT: u32 = 1;
/// Most bytes of a definition.
pub const MAX_BYTES: usize = 1 << 20;
/// Most definitions on a server.
pub const MAX_DEFINITIONS: usize = 256;
/// Most characters of a description.
pub const MAX_DESCRIPTION_CHARS: usize = 1000;
/// Most sets of a definition.
pub const MAX_SETS: usize = 32;
/// Most keyframes of a set; a pack may take fewer.
pub const MAX_KEYFRAMES: usize = 4;
/// Most sparse points of a keyframe.
pub const MAX_POINTS: usize = 8;
/// Most events of a set.
pub const MAX_EVENTS: usize = 8;
/// Most variants of a definition.
pub const MAX_VARIANTS: usize = 16;
/// Most approaches of a definition.
pub const MAX_APPROACHES: usize = 16;
/// Most sockets of a definition.
pub const MAX_SOCKETS: usize = 8;
/// Farthest that a keyframe, point, pivot or socket may be from its origin along an axis, metres.
pub const MAX_DISTANCE_M: f32 = 20.0;
/// Largest reach of a trigger beyond the shape, metres.
pub const MAX_REACH_M: f32 = 10.0;
/// Most frames by which a soft set may be left early.
pub const MAX_DROP_FRAMES: u32 = 64;
/// Most frames that a set may be held: five minutes.
pub const MAX_HOLD_FRAMES: u32 = 9000;
/// Most frames that an object takes to move into its socket.
pub const MAX_BLEND_FRAMES: u32 = 30;
/// Largest weight of a variant.
pub const MAX_WEIGHT: f32 = 1000.0;
/// Steepest surface that an object may be released onto, degrees.
pub const MAX_SLOPE_DEG: f32 = 80.0;

/// A checked definition.
#[derive(Debug, Clone)]
pub struct Definition {
    /// Unique among the definitions of a pack.
    pub name: String,
    /// The pack that it was checked for. Its poses and joints belong to that pack's skeleton, so
    /// characters of other packs cannot use it.
    pub pack: String,
    /// A description for people.
    pub description: String,
    /// The object's shape in its own frame of reference.
    pub shape: Shape,
    /// Shape and trigger as a scene needs them.
    pub body: Arc<ObjectBody>,
    /// The middle of the object in its own frame of reference, metres.
    pub middle_m: Vec3,
    /// The point that keyframes turn about, in the object's frame of reference, metres.
    pub pivot_m: Vec3,
    /// Sides that a character may come from. Empty: any side, starting where the character is.
    pub approaches: Vec<Approach>,
    /// Places on a character that can hold the object.
    pub sockets: Vec<Socket>,
    /// How the object is put down.
    pub release: Release,
    /// All sets. Variants refer to them by index.
    pub sets: Vec<Set>,
    /// At least one, with weights that are not all 0.
    pub variants: Vec<Variant>,
    /// Whether it is a skill of the pack, which is done on the spot, without an object.
    pub is_skill: bool,
    /// The first set that the pack cannot make. Such a definition is known, but cannot be used.
    pub too_short: Option<TooShort>,
    /// The definition as it was written.
    pub doc: Arc<ObjectDoc>,
}

/// A set that has fewer frames than a pack's networks make at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TooShort {
    /// Name of the set.
    pub set: String,
    /// Frames of the set, as written.
    pub frames: u32,
    /// Fewest frames of a set that the pack makes.
    pub least: u32,
    /// Name of the pack.
    pub pack: String,
}

/// A range of sides that a character may come from.
#[derive(Debug, Clone, PartialEq)]
pub struct Approach {
    /// Unique in the definition.
    pub name: String,
    /// First direction, radians about +Y from the object's +Z as seen from the pivot.
    pub from: f32,
    /// Size of the range from there on, radians, 0 to 2π.
    pub span: f32,
    /// Where the character starts the first set, metres over the ground from the pivot. `None`:
    /// on the spot.
    pub distance_m: Option<f32>,
}

/// A place on a character that holds the object.
#[derive(Debug, Clone, PartialEq)]
pub struct Socket {
    /// Unique in the definition.
    pub name: String,
    /// Index of the joint that carries the object.
    pub joint: usize,
    /// The object's origin in the joint's frame of reference, metres.
    pub position_m: Vec3,
    /// The object's rotation in the joint's frame of reference. `None`: as it was when it was
    /// taken.
    pub rotation: Option<Quat>,
    /// Frames in which an object moves here from its old place.
    pub blend_frames: u32,
    /// Whether the arm swings as in any walk while it carries the object. Otherwise the hand keeps
    /// its place.
    pub swings: bool,
    /// Whether the object stays upright however the joint turns. It turns about its middle.
    pub upright: bool,
}

/// How the object is put down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Release {
    /// Whether it is put onto the surface below. Otherwise it stays where the hand lets go.
    pub snap: bool,
    /// Height above the object's middle at which the ray down starts, metres.
    pub lift_m: f32,
    /// Farthest that the surface may be below the object's middle, metres.
    pub max_drop_m: f32,
    /// Steepest surface that it is put onto, radians from level.
    pub max_slope: f32,
    /// The object's orientation on the surface.
    pub align: Align,
}

/// One phase of an interaction: the keyframes that a stretch of motion leads to.
#[derive(Debug, Clone, PartialEq)]
pub struct Set {
    /// Unique in the definition.
    pub name: String,
    /// Hips lower than this over the ground count as low, metres. The pack's value.
    pub low_hips_m: f32,
    /// What places and headings of the keyframes are relative to.
    pub origin: Origin,
    /// One to four consecutive frames, oldest first.
    pub keyframes: Vec<Keyframe>,
    /// Whether the networks make its motion. `None`: as it suits the keyframes.
    pub motion: Option<Motion>,
    /// Whether a character that approaches for it stops first.
    pub from_stand: bool,
    /// Frames from the last frame before the set to its last keyframe. `None`: the pack chooses.
    pub frames: Option<u32>,
    /// τ: how many frames before the last keyframe the next phase may begin. 0: the keyframe must
    /// be reached.
    pub drop_frames: u32,
    /// How long the last keyframe is held.
    pub hold: Hold,
    /// What happens to the object in the set, and when.
    pub events: Vec<Event>,
}

impl Set {
    /// Whether its keyframes must be reached.
    pub fn is_hard(&self) -> bool {
        self.drop_frames == 0
    }

    /// Whether the character comes to rest in the last keyframe: it must be reached, or is held.
    pub fn comes_to_rest(&self) -> bool {
        self.is_hard() || self.hold != Hold::Frames(0)
    }
}

/// How long a set's last keyframe is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// This many frames; 0 if it is not held.
    Frames(u32),
    /// Until a command ends the interaction, which then goes on with the variant's exit.
    UntilEnded,
}

/// Something that happens to the object during a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// At the set's start, keyframe or end.
    pub at: Moment,
    /// To the object in the hand, or to be taken.
    pub action: Action,
}

/// What an event does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The object moves into the socket of this index.
    Attach(usize),
    /// The object is put down.
    Release,
}

/// A keyframe relative to its set's [`Origin`]. At least one of its parts is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Keyframe {
    /// ω: whether the keyframe turns about the pivot, to the side that the character comes from.
    pub pivot: bool,
    /// The root's place over the ground: x and z, metres.
    pub place_m: Option<[f32; 2]>,
    /// The heading, radians about +Y.
    pub heading: Option<f32>,
    /// Height of the root joint, metres.
    pub height_m: Option<f32>,
    /// The scale of a height that was divided by it for a body of another size
    /// ([`Definition::scaled`]): the pose was written for the height times this. `None`: the height
    /// is the one that the pose was written for.
    pub pose_scale: Option<f32>,
    /// Whether the heights of root and points count from what the character stands on, not from the
    /// origin.
    pub from_ground: bool,
    /// The whole pose: one rotation a joint, the first without the heading, others relative to
    /// their parents. Heading and height come with it.
    pub rotations: Option<Vec<Quat>>,
    /// Places of single joints.
    pub points: Vec<Point>,
}

/// The place of one joint in a keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Index of the joint in the skeleton.
    pub joint: usize,
    /// Place relative to the origin, metres.
    pub position_m: Vec3,
}

/// One of several ways to use an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Unique in the definition.
    pub name: String,
    /// How often it is chosen, relative to the others. 0: only by name.
    pub weight: f32,
    /// The sets to go through, in order: at least one, and none twice.
    pub entry: Vec<usize>,
    /// The sets to leave with, in order, if the interaction is ended while a set is held. May be
    /// empty.
    pub exit: Vec<usize>,
}

impl Definition {
    /// A rough measure of its memory, bytes.
    pub fn bytes(&self) -> usize {
        /// Bytes of a definition with its names, a set with its events, a keyframe, and a joint or
        /// point of one.
        const ITSELF: usize = 8 << 10;
        const SET: usize = 2 << 10;
        const KEYFRAME: usize = 512;
        const PART: usize = 128;
        let keyframes = self.sets.iter().flat_map(|set| &set.keyframes);
        let keyframes: usize = keyframes
            .map(|key| KEYFRAME + PART * (key.rotations.as_ref().map_or(0, Vec::len) + key.points.len()))
            .sum();
        ITSELF + self.description.len() + SET * self.sets.len() + keyframes
    }

    /// The set of this name.
    pub fn set(&self, name: &str) -> Option<&Set> {
        self.sets.iter().find(|set| set.name == name)
    }

    /// The socket of this name.
    pub fn socket(&self, name: &str) -> Option<&Socket> {
        self.sockets.iter().find(|socket| socket.name == name)
    }
}
