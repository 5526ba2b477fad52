//! Requests as the wire has them. Unknown fields are refused.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::fault::{Code, Fault};
use troupe_base::echo::{MAX_MESSAGE, MAX_PATH, cut};

/// A joint of a skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// 1 to 128 characters, unique.
    pub name: String,
    /// The parent's name; null for the root.
    #[serde(default)]
    pub parent: Option<String>,
    /// Place in the parent's frame at rest, metres.
    pub rest_translation: [f64; 3],
    /// x, y, z, w, relative to the parent.
    pub rest_rotation: [f64; 4],
    /// What people call it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub display_name: Option<String>,
}

/// A skeleton. Parents come before their children.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skeleton {
    /// At least one.
    pub joints: Vec<Joint>,
    /// `right_handed_y_up`.
    #[serde(default = "coordinates")]
    pub coordinate_system: String,
    /// `meters`.
    #[serde(default = "units")]
    pub units: String,
}

/// The protocol's axes.
pub fn coordinates() -> String {
    "right_handed_y_up".to_owned()
}

/// The protocol's unit of length.
pub fn units() -> String {
    "meters".to_owned()
}

/// One request, whose segments and constraints are read by their types.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// `major.minor`.
    pub protocol_version: String,
    /// A model's id.
    pub model: String,
    /// The model's joints.
    pub skeleton: Skeleton,
    /// What to do, one after another.
    #[serde(default)]
    pub segments: Vec<Value>,
    /// What the motion must meet.
    #[serde(default)]
    pub constraints: Vec<Value>,
    /// Frames of a request without segments.
    #[serde(default)]
    pub duration_frames: Option<i64>,
    /// The frame rate, where not the model's.
    #[serde(default)]
    pub timing: Option<Timing>,
    /// How to make it.
    #[serde(default)]
    pub options: Option<Options>,
}

/// The frame rate of a request.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Frames a second.
    pub fps: f64,
}

/// How to make a motion.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Steps of the sampler.
    #[serde(default)]
    pub diffusion_steps: Option<i64>,
    /// Motions to make.
    #[serde(default)]
    pub num_samples: Option<i64>,
    /// Seed of all random choices.
    #[serde(default)]
    pub seed: Option<i64>,
    /// Whether feet that stand are held still.
    #[serde(default)]
    pub post_processing: Option<bool>,
    /// Frames over which a segment leads over from the one before.
    #[serde(default)]
    pub transition_frames: Option<i64>,
    /// How strictly to follow the style.
    #[serde(default)]
    pub guidance: Option<Guidance>,
    /// Whether the end meets the start.
    #[serde(default, rename = "loop")]
    pub is_loop: Option<bool>,
    /// How far thinned curves may be off.
    #[serde(default)]
    pub keyframe_budget: Option<f64>,
    /// Values of the model's own options.
    #[serde(default)]
    pub model_options: Option<BTreeMap<String, Value>>,
}

/// Classifier-free guidance.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Guidance {
    /// `nocfg`, `regular` or `separated`.
    #[serde(rename = "type")]
    pub kind: String,
    /// None, one or two weights.
    #[serde(default)]
    pub weight: Vec<f64>,
}

/// A segment of words.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// What to do.
    pub prompt: String,
    /// Its length.
    pub duration_frames: i64,
    /// The prompt's language.
    #[serde(default = "english")]
    pub language: Option<String>,
    /// Its own seed.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// The language of prompts that do not say.
pub const ENGLISH: &str = "en";

fn english() -> Option<String> {
    Some(ENGLISH.to_owned())
}

/// A segment of whatever suits the constraints.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unconditioned {
    /// Its length.
    pub duration_frames: i64,
    /// Its own seed.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// A segment of motion like another.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionReference {
    /// Its length.
    pub duration_frames: i64,
    /// The skeleton of the other motion, where not the request's.
    #[serde(default)]
    pub skeleton: Option<Skeleton>,
    /// The joints of the other motion, its root among them.
    pub joint_names: Vec<String>,
    /// `[frames][joints]`: x, y, z, w, relative to the parent; the root's in the world.
    pub rotations: Vec<Vec<[f64; 4]>>,
    /// World places of the root, one a frame, metres.
    pub root_positions: Vec<[f64; 3]>,
    /// Frames a second of the other motion.
    pub fps: f64,
    /// Its own seed.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// Places of the root over the ground.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RootPath {
    /// Growing.
    pub frames: Vec<i64>,
    /// World x and z, one a frame, metres.
    pub positions_xz: Vec<[f64; 2]>,
    /// One a frame: 0 faces +Z, a quarter turn +X.
    #[serde(default)]
    pub heading_radians: Option<Vec<f64>>,
}

/// Places of a joint.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectorTarget {
    /// Its name.
    pub joint: String,
    /// Frames.
    pub frames: Vec<i64>,
    /// World places, one a frame, metres.
    pub positions: Vec<[f64; 3]>,
    /// World rotations (x, y, z, w), one a frame.
    #[serde(default)]
    pub rotations: Option<Vec<[f64; 4]>>,
}

/// A pose, or a part of one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseKeyframe {
    /// Its frame.
    pub frame: i64,
    /// By the joint's name: x, y, z, w, relative to the parent; the root's in the world.
    pub joint_rotations: BTreeMap<String, [f64; 4]>,
    /// World place of the root, metres.
    #[serde(default)]
    pub root_position: Option<[f64; 3]>,
    /// What joints do that are left out.
    #[serde(default)]
    pub fill_mode: FillMode,
}

/// What joints do that a keyframe leaves out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FillMode {
    /// They are as at rest.
    Rest,
    /// They are the model's.
    #[default]
    Generate,
}

/// Points of the ground's surface.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundHeight {
    /// World x, z and height, metres.
    pub points: Vec<[f64; 3]>,
}

/// Reads a value at `place` of the request; the empty place is the request itself.
///
/// # Errors
/// [`Fault`] that names the field.
pub fn read<T: DeserializeOwned>(value: Value, place: &str) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let inner = error.inner().to_string();
        let named = ["unknown field `", "missing field `", "duplicate field `"];
        let name = named.iter().find_map(|start| inner.strip_prefix(start));
        let name = name.and_then(|rest| rest.split('`').next());
        let path = Some(path).filter(|path| path != ".");
        let mut parts: Vec<&str> = [place, path.as_deref().unwrap_or_default()].to_vec();
        // An unknown field is in the path already.
        if let Some(name) = name.filter(|name| !path.as_deref().unwrap_or_default().ends_with(name)) {
            parts.push(name);
        }
        parts.retain(|part| !part.is_empty());
        let field = match parts.is_empty() {
            true => "body".to_owned(),
            false => parts.join(".").replace(".[", "["),
        };
        let allowed = "the protocol's form of a request";
        Fault::schema(cut(&field, MAX_PATH), cut(&inner, MAX_MESSAGE), allowed)
    })
}

/// Takes the type off a segment or constraint.
///
/// # Errors
/// [`Fault`] where it is no object with a type.
pub fn take_type(value: &mut Value, place: &str) -> Result<String, Fault> {
    let Some(object) = value.as_object_mut() else {
        return Err(Fault::schema(place, "is no object", "an object with a type"));
    };
    match object.remove("type") {
        Some(Value::String(kind)) => Ok(kind),
        _ => Err(Fault::schema(
            format!("{place}.type"),
            "is missing, or no text",
            "a type's name",
        )),
    }
}

/// The major version of a protocol version; none where it has no such form.
pub fn major(version: &str) -> Option<&str> {
    let (major, minor) = version.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (digits(major) && digits(minor)).then_some(major)
}

/// Checks the protocol's version.
///
/// # Errors
/// [`Fault`] for one of another form or another major version.
pub fn check_version(version: &str) -> Result<(), Fault> {
    let found = || format!("is {:?}", cut(version, 32));
    match major(version) {
        Some(major) if major.trim_start_matches('0') == "1" => Ok(()),
        Some(_) => Err(Fault::new(
            Code::VersionUnsupported,
            "protocol_version",
            found(),
            "1.0 to 1.4, or any 1.x",
        )
        .with("supported_majors", vec!["1"])),
        None => Err(Fault::schema("protocol_version", found(), "MAJOR.MINOR")),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn versions_are_of_a_major() {
        for good in ["1.0", "1.4", "1.99", "01.0"] {
            assert_eq!(check_version(good), Ok(()), "{good}");
        }
        for (bad, code) in [
            ("2.0", Code::VersionUnsupported),
            ("1", Code::SchemaValidation),
            ("1.", Code::SchemaValidation),
            ("one.two", Code::SchemaValidation),
            ("1.4.0", Code::SchemaValidation),
        ] {
            assert_eq!(check_version(bad).unwrap_err().code, code, "{bad}");
        }
    }

    #[test]
    fn what_is_wrong_has_a_place() {
        let wrong = |value, place: &str| read::<RootPath>(value, place).unwrap_err().place.field;
        let path = json!({"frames": [1], "positions_xz": [[0, "a"]]});
        assert_eq!(wrong(path, "constraints[2]"), "constraints[2].positions_xz[0][1]");
        let unknown = json!({"frames": [1], "positions_xz": [[0, 1]], "y": 1});
        assert_eq!(wrong(unknown, "constraints[0]"), "constraints[0].y");
        assert_eq!(wrong(json!({"frames": [1]}), ""), "positions_xz");
        assert_eq!(wrong(json!(3), ""), "body");
    }
}
