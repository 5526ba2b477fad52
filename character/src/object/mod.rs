//! Smart objects: what characters can do with a thing, as data (paper section 6.2 and appendix G).
//!
//! A [`Definition`] is read from TOML or JSON ([`Definition::from_toml`],
//! [`Definition::from_json`], [`load_file`]) and checked for one pack, whose skeleton its poses and
//! joints are of. It says what the object is like and where a character must be to use it (`shape`,
//! `trigger`, `approaches`), how it is carried and put down (`sockets`, `release`), and what
//! happens: `sets` of one to four consecutive keyframes, of which each `variant` names a first one
//! and those that follow.
//!
//! Keyframes are written for a character that comes from the object's +Z side. [`Anchor`] turns one
//! into the world: with the object's place and heading, and where its pivot flag ω is set also
//! about the pivot, to the side that the character comes from. [`Variant`]s are chosen by weight
//! and seed, and one seed always chooses the same.
//!
//! Nothing here knows of sessions, clocks or networks.

mod anchor;
mod approach;
mod check;
mod check_sets;
mod place;
mod read;
mod socket;
mod table;
mod variant;

#[cfg(test)]
mod anchor_tests;
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

use crate::scene::{Body, Shape};

pub use anchor::{Anchor, WorldKeyframe, WorldPoint};
pub use approach::Choice;
pub use place::{PlaceError, Placement};
pub use read::{load_file, load_folder};
pub use table::{DefinitionList, Definitions, DefinitionsError, Listed, Uploaded};
pub use troupe_proto::docs::{
    Align, AnchorDoc, ApproachDoc, EventDoc, KeyframeDoc, Moment, Motion, ObjectDoc, Origin, PointDoc,
    ReleaseDoc, SetDoc, SocketDoc, TriggerDoc, VariantDoc,
};

/// Version of the definition format that this server reads.
pub const FORMAT: u32 = 1;
/// Most bytes of a definition.
pub const MAX_BYTES: usize = 1 << 20;
/// Most definitions of a server.
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
/// Largest distance of a keyframe, point, pivot or socket from the origin that it is given from,
/// along an axis, metres.
pub const MAX_DISTANCE_M: f32 = 20.0;
/// Largest reach of a trigger beyond the shape, metres.
pub const MAX_REACH_M: f32 = 10.0;
/// Most frames by which a soft set may be left early.
pub const MAX_DROP_FRAMES: u32 = 64;
/// Most frames that a set may be held: five minutes.
pub const MAX_HOLD_FRAMES: u32 = 9000;
/// Most frames over which an object that is attached moves into its socket.
pub const MAX_BLEND_FRAMES: u32 = 30;
/// Largest weight of a variant.
pub const MAX_WEIGHT: f32 = 1000.0;
/// Steepest surface that an object may be released onto, degrees.
pub const MAX_SLOPE_DEG: f32 = 80.0;

/// A checked definition.
#[derive(Debug, Clone)]
pub struct Definition {
    /// Unique among definitions.
    pub name: String,
    /// Name of the pack that it was checked for: its poses and joints are of that pack's skeleton,
    /// and no character of another pack can use it.
    pub pack: String,
    /// What it is, for people.
    pub description: String,
    /// The object's shape, in its own frame.
    pub shape: Shape,
    /// Shape and trigger for a scene.
    pub body: Arc<Body>,
    /// The point that keyframes turn about, in the object's frame, metres.
    pub pivot_m: Vec3,
    /// Sides from which a character may come; none: any side, and it starts where it is.
    pub approaches: Vec<Approach>,
    /// Where the object may be attached to a character.
    pub sockets: Vec<Socket>,
    /// How it is put down.
    pub release: Release,
    /// All sets; variants refer to them by index.
    pub sets: Vec<Set>,
    /// At least one, with weights that are not all 0.
    pub variants: Vec<Variant>,
    /// Whether it is a skill of the pack: done where the character stands, with no object.
    pub is_skill: bool,
    /// As it was written.
    pub doc: Arc<ObjectDoc>,
}

/// A range of sides from which a character may come.
#[derive(Debug, Clone, PartialEq)]
pub struct Approach {
    /// Unique in the definition.
    pub name: String,
    /// First direction, radians about +Y from the object's +Z as seen from the pivot.
    pub from: f32,
    /// How far the range goes on from there, radians, 0 to 2π.
    pub span: f32,
    /// Where the character starts the first set, metres over the ground from the pivot. `None`:
    /// where it is.
    pub distance_m: Option<f32>,
}

/// A place on a character that holds the object.
#[derive(Debug, Clone, PartialEq)]
pub struct Socket {
    /// Unique in the definition.
    pub name: String,
    /// Joint that it moves with.
    pub joint: usize,
    /// The object's origin in the joint's frame, metres.
    pub position_m: Vec3,
    /// The object's rotation in the joint's frame. `None`: as it was when it was taken.
    pub rotation: Option<Quat>,
    /// Frames over which an object that is attached moves here from where it was.
    pub blend_frames: u32,
    /// Whether the arm swings as in any walk while it carries the object; else the hand stays where
    /// it is.
    pub swings: bool,
    /// Whether the object stands upright however the joint turns; it turns about its middle.
    pub upright: bool,
}

/// How the object is put down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Release {
    /// Whether it is put onto the surface under it; else it stays where it is let go.
    pub snap: bool,
    /// The ray down starts this far above the object's middle, metres.
    pub lift_m: f32,
    /// How far below the object's middle the surface may be, metres.
    pub max_drop_m: f32,
    /// Steepest surface, radians from level.
    pub max_slope: f32,
    /// How it is turned.
    pub align: Align,
}

/// One phase: keyframes that end one stretch of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Set {
    /// Unique in the definition.
    pub name: String,
    /// Hips lower than this over the ground are low, metres: the pack's.
    pub low_hips_m: f32,
    /// What the keyframes are given from.
    pub origin: Origin,
    /// One to four consecutive frames, oldest first.
    pub keyframes: Vec<Keyframe>,
    /// How its motion is made. `None`: as it suits the keyframes.
    pub motion: Option<Motion>,
    /// Whether a character that comes for it stops before it begins.
    pub from_stand: bool,
    /// Frames from the last frame before the set to its last keyframe. `None`: as many as the pack
    /// thinks right.
    pub frames: Option<u32>,
    /// τ: how many frames before its last keyframe the next phase may begin. 0: the keyframe must
    /// be reached.
    pub drop_frames: u32,
    /// How long the last keyframe is held.
    pub hold: Hold,
    /// What happens in it.
    pub events: Vec<Event>,
}

impl Set {
    /// Whether its keyframes must be reached.
    pub fn is_hard(&self) -> bool {
        self.drop_frames == 0
    }

    /// Whether the character comes to rest in its last keyframe: it must be reached, or is held.
    pub fn comes_to_rest(&self) -> bool {
        self.is_hard() || self.hold != Hold::Frames(0)
    }
}

/// How long a set's last keyframe is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// So many frames; 0 for none.
    Frames(u32),
    /// Until the interaction is ended by a command, which goes on with the variant's exit.
    UntilEnded,
}

/// Something that happens in a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// When.
    pub at: Moment,
    /// What.
    pub action: Action,
}

/// What an event does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The object goes to the socket of this index.
    Attach(usize),
    /// The object is put down.
    Release,
}

/// A keyframe, in the frame of its set's [`Origin`]. At least one of its parts is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Keyframe {
    /// ω: whether it turns about the pivot with the side that the character comes from.
    pub pivot: bool,
    /// Where the root is over the ground: x and z, metres.
    pub place_m: Option<[f32; 2]>,
    /// Which way it faces, radians about +Y.
    pub heading: Option<f32>,
    /// Height of the root joint, metres.
    pub height_m: Option<f32>,
    /// Whether heights, of root and points, count from what the character stands on rather than
    /// from the origin.
    pub from_ground: bool,
    /// The whole pose: one rotation for each joint, the first with the heading taken out, others
    /// relative to their parents. Heading and height are given with it.
    pub rotations: Option<Vec<Quat>>,
    /// Where single joints are.
    pub points: Vec<Point>,
}

/// Where one joint of a keyframe is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The joint.
    pub joint: usize,
    /// Its place in the origin's frame, metres.
    pub position_m: Vec3,
}

/// One of several ways to use an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Unique in the definition.
    pub name: String,
    /// How often it is chosen, compared with the others. 0: only when it is asked for by name.
    pub weight: f32,
    /// The sets to go through, in order; at least one, none twice.
    pub entry: Vec<usize>,
    /// The sets to leave with when the interaction is ended while a set is held, in order; may be
    /// none.
    pub exit: Vec<usize>,
}

impl Definition {
    /// About how much memory it takes, bytes.
    pub fn bytes(&self) -> usize {
        /// Of a definition with its names, of a set with its events, of a keyframe, and of a joint
        /// or a point of one.
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
