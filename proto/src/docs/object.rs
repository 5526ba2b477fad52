//! Documents of smart objects.

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
    /// A description for people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Whether rays and boxes hit the shape. False for a mere place. Default true.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub solid: bool,
    /// Whether any number of characters may use it at the same time. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub shared: bool,
    /// Shape in the object's frame, metres.
    pub shape: ShapeDoc,
    /// The volume that a character must reach to use the object.
    #[serde(default)]
    pub trigger: TriggerDoc,
    /// The point that keyframes turn about.
    #[serde(default, skip_serializing_if = "is_default")]
    pub anchor: AnchorDoc,
    /// The rule for putting the object down.
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
    /// The phases of all variants.
    pub sets: Vec<SetDoc>,
}

impl ObjectDoc {
    /// The TOML text.
    ///
    /// # Errors
    /// If a value cannot be written, which no checked definition has.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

/// The trigger volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriggerDoc {
    /// The shape is grown by this on every side, metres. Default 0.6.
    #[serde(default = "TriggerDoc::default_reach")]
    pub reach_m: f32,
    /// Shape of the trigger. Left out: the object's.
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

/// The point that keyframes turn about.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnchorDoc {
    /// The pivot in the object's frame, metres. Default: the origin.
    #[serde(default, skip_serializing_if = "is_default")]
    pub pivot_m: [f32; 3],
}

/// The rule for putting an object down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReleaseDoc {
    /// Whether it is put onto the surface under it. Default true.
    pub snap: bool,
    /// Height above the object's middle at which the search for a surface begins, metres. Default
    /// 0.3.
    pub lift_m: f32,
    /// Largest distance of the surface below the object's middle, metres. Default 2.
    pub max_drop_m: f32,
    /// Steepest surface, degrees. Default 30.
    pub max_slope_deg: f32,
    /// Rotation of the object. Default `upright`.
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

/// Rotation of an object when it is put down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// Upright. The heading does not change.
    #[default]
    Upright,
    /// Its +Y along the surface's normal. The heading does not change.
    Surface,
    /// No change.
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
    /// Distance from the pivot at which the character starts the first set, metres. Left out: the
    /// character starts in its current place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f32>,
}

/// A place on a character that holds the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SocketDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// Name of the joint that holds the object.
    pub joint: String,
    /// The object's origin in the joint's frame, metres. Default: the joint.
    #[serde(default, skip_serializing_if = "is_default")]
    pub position_m: [f32; 3],
    /// The object's rotation in the joint's frame: w, x, y, z. Left out: no change when it is
    /// taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    /// Frames over which the object moves here. Default 4.
    #[serde(default = "SocketDoc::default_blend")]
    pub blend_frames: u32,
    /// Whether the arm swings as in any walk while it carries the object. Default false: the hand
    /// keeps its place.
    #[serde(default, skip_serializing_if = "is_false")]
    pub swings: bool,
    /// Whether the object stays upright when the joint turns, as a full cup must. Default false: it
    /// turns with the joint.
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
    /// Weight of a random choice, relative to the other variants. Default 1.
    #[serde(default = "VariantDoc::default_weight")]
    pub weight: f32,
    /// Name of the first set.
    pub entry: String,
    /// Name of the first set of the way out. Left out: the character leaves at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exit: Option<String>,
}

impl VariantDoc {
    fn default_weight() -> f32 {
        1.0
    }
}

/// A phase of an interaction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetDoc {
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// Name of the next set. Left out: this is the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
    /// Origin of the keyframes: `object` (default) or `character`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub origin: Origin,
    /// How the motion is made. Left out: the server chooses by the keyframes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Whether the character stops before the set begins. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub from_stand: bool,
    /// Frames from the last frame before the set to its last keyframe. Left out: the networks
    /// decide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
    /// τ: the number of frames by which the character may leave the set early. Default 0: it must
    /// reach the last keyframe.
    #[serde(default, skip_serializing_if = "is_default")]
    pub drop_frames: u32,
    /// Frames during which the character holds the last keyframe. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hold_frames: u32,
    /// Whether the character holds it until a command ends the interaction. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub hold_until_ended: bool,
    /// Events of the set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventDoc>,
    /// One to four consecutive frames.
    pub keyframes: Vec<KeyframeDoc>,
}

/// Origin of a set's keyframes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The object, about its pivot.
    #[default]
    Object,
    /// The place under the character's root, and its heading, at the start of the set.
    Character,
}

/// How a set's motion is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// The networks make it, and it is drawn to the keyframes.
    Plan,
    /// Without the networks, and the feet keep their place. For poses that the networks do not
    /// know.
    Stance,
}

/// An event of a set: exactly one of `attach` and `release`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventDoc {
    /// Moment of the event: `start`, `reached` (default) or `end`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: Moment,
    /// Name of the socket that the object goes to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attach: Option<String>,
    /// Whether the character puts the object down.
    #[serde(default, skip_serializing_if = "is_false")]
    pub release: bool,
}

/// A moment of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// The set begins.
    Start,
    /// The last keyframe, or the frame at which the character leaves a soft set early.
    #[default]
    Reached,
    /// The end of the hold.
    End,
}

/// A keyframe. At least one of place, heading, height, rotations and points.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeDoc {
    /// ω: whether the keyframe turns about the pivot, to the side that the character comes from.
    /// Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub pivot: bool,
    /// Place of the root over the ground: x and z, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place_m: Option<[f32; 2]>,
    /// Heading, degrees about +Y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<f32>,
    /// Height of the root joint, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f32>,
    /// Whether heights count from the surface under the character. Default false: from the origin.
    #[serde(default, skip_serializing_if = "is_false")]
    pub from_ground: bool,
    /// The pose: w, x, y, z for each joint, the first without the heading, the others relative to
    /// their parents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotations: Option<Vec<f32>>,
    /// Places of single joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<PointDoc>,
}

/// Place of a joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointDoc {
    /// Name of the joint, as in the pack's skeleton.
    pub joint: String,
    /// Place in the keyframe's frame, metres.
    pub position_m: [f32; 3],
}
