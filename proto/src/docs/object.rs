//! Definitions of smart objects as they are written.

use serde::{Deserialize, Serialize};

use super::{ShapeDoc, is_default, is_false, is_true, yes};

/// A whole definition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectDoc {
    /// Version of the format: 1.
    pub format: u32,
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// What it is, for people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Whether rays and boxes hit the shape: false for a mere place. Default true.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub solid: bool,
    /// Whether any number of characters may use it at once. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub shared: bool,
    /// The object's shape.
    pub shape: ShapeDoc,
    /// Where a character must reach to use it.
    #[serde(default)]
    pub trigger: TriggerDoc,
    /// What keyframes turn about.
    #[serde(default, skip_serializing_if = "is_default")]
    pub anchor: AnchorDoc,
    /// How it is put down.
    #[serde(default, skip_serializing_if = "is_default")]
    pub release: ReleaseDoc,
    /// Sides from which a character may come.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub approaches: Vec<ApproachDoc>,
    /// Places on a character that hold the object.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets: Vec<SocketDoc>,
    /// Ways to use it.
    pub variants: Vec<VariantDoc>,
    /// Phases.
    pub sets: Vec<SetDoc>,
}

impl ObjectDoc {
    /// The TOML text.
    ///
    /// # Errors
    /// Where a value cannot be written, which no checked definition has.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

/// The trigger volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriggerDoc {
    /// Its shape is grown by this on every side, metres. Default 0.6.
    #[serde(default = "TriggerDoc::default_reach")]
    pub reach_m: f32,
    /// Its shape, where it is not the object's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeDoc>,
}

impl TriggerDoc {
    fn default_reach() -> f32 {
        0.6
    }
}

impl Default for TriggerDoc {
    fn default() -> Self {
        Self {
            reach_m: Self::default_reach(),
            shape: None,
        }
    }
}

/// What keyframes turn about.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnchorDoc {
    /// The pivot in the object's frame, metres. Default: the origin.
    #[serde(default, skip_serializing_if = "is_default")]
    pub pivot_m: [f32; 3],
}

/// How the object is put down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReleaseDoc {
    /// Whether it is put onto the surface under it. Default true.
    pub snap: bool,
    /// Where the ray down starts above the object's middle, metres. Default 0.3.
    pub lift_m: f32,
    /// How far below the object's middle the surface may be, metres. Default 2.
    pub max_drop_m: f32,
    /// Steepest surface, degrees. Default 30.
    pub max_slope_deg: f32,
    /// How it is turned. Default `upright`.
    pub align: Align,
}

impl Default for ReleaseDoc {
    fn default() -> Self {
        Self {
            snap: true,
            lift_m: 0.3,
            max_drop_m: 2.0,
            max_slope_deg: 30.0,
            align: Align::Upright,
        }
    }
}

/// How an object is turned when it is put down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// Upright, with the heading that it has.
    #[default]
    Upright,
    /// Its +Y along the surface's normal, with the heading that it has.
    Surface,
    /// As it is.
    Keep,
}

/// A range of sides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApproachDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// First and last direction, degrees about +Y from the object's +Z as seen from the pivot.
    pub directions_deg: [f32; 2],
    /// Where the character starts the first set, metres from the pivot. Left out: where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f32>,
}

/// A place on a character that holds the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SocketDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// The joint.
    pub joint: String,
    /// The object's origin in the joint's frame, metres. Default: the joint.
    #[serde(default, skip_serializing_if = "is_default")]
    pub position_m: [f32; 3],
    /// The object's rotation in the joint's frame: w, x, y, z. Left out: as it was when it was
    /// taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    /// Frames over which the object moves here. Default 4.
    #[serde(default = "SocketDoc::default_blend")]
    pub blend_frames: u32,
    /// Whether the arm swings as in any walk while it carries the object. Default false: the hand
    /// stays where it is.
    #[serde(default, skip_serializing_if = "is_false")]
    pub swings: bool,
    /// Whether the object stands upright however the joint turns, as a full cup does. Default
    /// false: it turns with the joint.
    #[serde(default, skip_serializing_if = "is_false")]
    pub upright: bool,
}

impl SocketDoc {
    fn default_blend() -> u32 {
        4
    }
}

/// A way to use the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// How often it is chosen, compared with the others. Default 1.
    #[serde(default = "VariantDoc::default_weight")]
    pub weight: f32,
    /// Name of the first set.
    pub entry: String,
    /// Name of the first set to leave with. Left out: it is left at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exit: Option<String>,
}

impl VariantDoc {
    fn default_weight() -> f32 {
        1.0
    }
}

/// A phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// Name of the set that follows. Left out: it is the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
    /// What keyframes are given from: `object` (default) or `character`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub origin: Origin,
    /// How its motion is made. Left out: as it suits the keyframes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Whether a character that comes for it stops before it begins. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub from_stand: bool,
    /// Frames from the last frame before the set to its last keyframe. Left out: as many as the
    /// pack thinks right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
    /// τ: 0 (default) must be reached; above, it may be left so many frames early.
    #[serde(default, skip_serializing_if = "is_default")]
    pub drop_frames: u32,
    /// Frames for which the last keyframe is held. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hold_frames: u32,
    /// Whether it is held until the interaction is ended. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub hold_until_ended: bool,
    /// What happens.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventDoc>,
    /// One to four consecutive frames.
    pub keyframes: Vec<KeyframeDoc>,
}

/// What a set's keyframes are given from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The object, about its pivot.
    #[default]
    Object,
    /// The place under the character's root, and its heading, as the set begins.
    Character,
}

/// How a set's motion is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// By the networks, drawn to the keyframes.
    Plan,
    /// Without the networks, the feet held where they stand: for poses that the networks do not
    /// know.
    Stance,
}

/// Something that happens in a set: exactly one of `attach` and `release`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventDoc {
    /// When: `start`, `reached` (default) or `end`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: Moment,
    /// The object goes to this socket.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attach: Option<String>,
    /// The object is put down.
    #[serde(default, skip_serializing_if = "is_false")]
    pub release: bool,
}

/// A moment of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// As it begins.
    Start,
    /// At its last keyframe, or where a soft set is left early.
    #[default]
    Reached,
    /// When it has been held.
    End,
}

/// A keyframe. At least one of place, heading, height, rotations and points.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeDoc {
    /// ω: whether it turns about the pivot with the side that the character comes from. Default
    /// false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub pivot: bool,
    /// Where the root is over the ground: x and z, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place_m: Option<[f32; 2]>,
    /// Which way it faces, degrees about +Y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<f32>,
    /// Height of the root joint, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f32>,
    /// Whether heights count from what the character stands on. Default false: from the origin.
    #[serde(default, skip_serializing_if = "is_false")]
    pub from_ground: bool,
    /// The pose: w, x, y, z for each joint, the first with the heading taken out, others relative
    /// to their parents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotations: Option<Vec<f32>>,
    /// Where single joints are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<PointDoc>,
}

/// Where a joint is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointDoc {
    /// The joint.
    pub joint: String,
    /// Its place, metres.
    pub position_m: [f32; 3],
}
