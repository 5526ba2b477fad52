//! Requests in the protocol's form. Unknown fields are refused.

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
    /// Position in the parent's frame at rest, metres.
    pub rest_translation: [f64; 3],
    /// Quaternion x, y, z, w, relative to the parent.
    pub rest_rotation: [f64; 4],
    /// Name to show to people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub display_name: Option<String>,
}

/// A skeleton. Parents come before their children.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skeleton {
    /// One joint or more.
    pub joints: Vec<Joint>,
    /// Always `right_handed_y_up`.
    #[serde(default = "coordinates")]
    pub coordinate_system: String,
    /// Always `meters`.
    #[serde(default = "units")]
    pub units: String,
}

/// The protocol's coordinate system.
pub fn coordinates() -> String {
    "right_handed_y_up".to_owned()
}

/// The protocol's unit of length.
pub fn units() -> String {
    "meters".to_owned()
}

/// One request. Its segments and constraints are decoded later, by their types.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// `MAJOR.MINOR`, such as 1.4.
    pub protocol_version: String,
    /// Id of a model.
    pub model: String,
    /// The model's joints.
    pub skeleton: Skeleton,
    /// Segments of the motion, one after another.
    #[serde(default)]
    pub segments: Vec<Value>,
    /// Constraints that the motion must meet.
    #[serde(default)]
    pub constraints: Vec<Value>,
    /// Frames of a request without segments.
    #[serde(default)]
    pub duration_frames: Option<i64>,
    /// The frame rate. Left out: the model's.
    #[serde(default)]
    pub timing: Option<Timing>,
    /// How to make the motion.
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
    /// Number of sampler steps.
    #[serde(default)]
    pub diffusion_steps: Option<i64>,
    /// Number of motions to make.
    #[serde(default)]
    pub num_samples: Option<i64>,
    /// Seed of all random choices.
    #[serde(default)]
    pub seed: Option<i64>,
    /// Whether standing feet are held still.
    #[serde(default)]
    pub post_processing: Option<bool>,
    /// Frames of the transition from the segment before.
    #[serde(default)]
    pub transition_frames: Option<i64>,
    /// How closely to follow the style.
    #[serde(default)]
    pub guidance: Option<Guidance>,
    /// Whether the end of the motion meets its start.
    #[serde(default, rename = "loop")]
    pub is_loop: Option<bool>,
    /// Largest error of thinned curves.
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
    /// One of `nocfg`, `regular` and `separated`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Up to two weights.
    #[serde(default)]
    pub weight: Vec<f64>,
}

/// A segment of words.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// The action, in words.
    pub prompt: String,
    /// Frames of the segment.
    pub duration_frames: i64,
    /// The prompt's language.
    #[serde(default = "english")]
    pub language: Option<String>,
    /// Seed of this segment alone.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// The language of prompts that name none.
pub const ENGLISH: &str = "en";

fn english() -> Option<String> {
    Some(ENGLISH.to_owned())
}

/// A segment without words: any motion that meets the constraints.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unconditioned {
    /// Frames of the segment.
    pub duration_frames: i64,
    /// Seed of this segment alone.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// A segment that imitates a reference motion.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionReference {
    /// Frames of the segment.
    pub duration_frames: i64,
    /// The skeleton of the reference motion. Left out: the request's.
    #[serde(default)]
    pub skeleton: Option<Skeleton>,
    /// Joints of the reference motion. The root must be among them.
    pub joint_names: Vec<String>,
    /// `[frames][joints]`: quaternions x, y, z, w, relative to the parent. The root's is in the
    /// world.
    pub rotations: Vec<Vec<[f64; 4]>>,
    /// World positions of the root, one per frame, metres.
    pub root_positions: Vec<[f64; 3]>,
    /// Frame rate of the reference motion.
    pub fps: f64,
    /// Seed of this segment alone.
    #[serde(default)]
    pub seed: Option<i64>,
}

/// Positions of the root over the ground.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RootPath {
    /// In growing order.
    pub frames: Vec<i64>,
    /// World x and z, one per frame, metres.
    pub positions_xz: Vec<[f64; 2]>,
    /// One per frame: 0 faces +Z, a quarter turn +X.
    #[serde(default)]
    pub heading_radians: Option<Vec<f64>>,
}

/// Positions of a joint.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectorTarget {
    /// A joint of the request's skeleton.
    pub joint: String,
    /// From 0, below the request's frames.
    pub frames: Vec<i64>,
    /// World positions, one per frame, metres.
    pub positions: Vec<[f64; 3]>,
    /// World rotations (x, y, z, w), one per frame.
    #[serde(default)]
    pub rotations: Option<Vec<[f64; 4]>>,
}

/// A pose, or a part of one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseKeyframe {
    /// From 0, below the request's frames.
    pub frame: i64,
    /// By joint name: quaternion x, y, z, w, relative to the parent. The root's is in the world.
    pub joint_rotations: BTreeMap<String, [f64; 4]>,
    /// World position of the root, metres.
    #[serde(default)]
    pub root_position: Option<[f64; 3]>,
    /// Motion of the joints that are left out.
    #[serde(default)]
    pub fill_mode: FillMode,
}

/// Motion of the joints that a keyframe leaves out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FillMode {
    /// They keep their rest rotations.
    Rest,
    /// The model decides.
    #[default]
    Generate,
}

/// Points on the ground's surface.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundHeight {
    /// World x, z and height, metres.
    pub points: Vec<[f64; 3]>,
}

/// Decodes a value at `place` of the request. The empty place is the request itself.
///
/// # Errors
/// [`Fault`], which names the field.
pub fn read<T: DeserializeOwned>(value: Value, place: &str) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let inner = error.inner().to_string();
        let named = ["unknown field `", "missing field `", "duplicate field `"];
        let name = named.iter().find_map(|start| inner.strip_prefix(start));
        let name = name.and_then(|rest| rest.split('`').next());
        let path = Some(path).filter(|path| path != ".");
        let mut parts: Vec<&str> = [place, path.as_deref().unwrap_or_default()].to_vec();
        // The path includes an unknown field already.
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

/// Removes the type from a segment or constraint, and returns it.
///
/// # Errors
/// [`Fault`] for anything but an object with a type.
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

/// The major version of a protocol version. None: the text has another form.
pub fn major(version: &str) -> Option<&str> {
    let (major, minor) = version.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (digits(major) && digits(minor)).then_some(major)
}

/// Checks the protocol's version.
///
/// # Errors
/// [`Fault`] for a version of another form or with another major version.
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
    fn an_error_names_the_place_in_the_request() {
        let wrong = |value, place: &str| read::<RootPath>(value, place).unwrap_err().place.field;
        let path = json!({"frames": [1], "positions_xz": [[0, "a"]]});
        assert_eq!(wrong(path, "constraints[2]"), "constraints[2].positions_xz[0][1]");
        let unknown = json!({"frames": [1], "positions_xz": [[0, 1]], "y": 1});
        assert_eq!(wrong(unknown, "constraints[0]"), "constraints[0].y");
        assert_eq!(wrong(json!({"frames": [1]}), ""), "positions_xz");
        assert_eq!(wrong(json!(3), ""), "body");
    }
}
