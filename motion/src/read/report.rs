//! What was understood of a file, with one line of evidence for each point.

use std::fmt;

use serde::{Deserialize, Serialize};

pub use crate::anatomy::RestPose;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Format {
    /// Biovision hierarchy.
    Bvh,
    /// Binary glTF 2.0.
    Glb,
    /// glTF 2.0 as text.
    Gltf,
    /// Autodesk's FBX.
    Fbx,
    /// A robot's root and angles as CSV, a frame a row.
    RobotCsv,
    /// A robot's `qpos` as one NumPy array.
    Qpos,
    /// Troupe's own NumPy archive.
    Npz,
    /// AMASS: SMPL, SMPL-H or SMPL-X as a NumPy archive.
    Amass,
    /// Kimodo's NumPy archive: SOMA, SMPL-X or G1.
    Kimodo,
    /// BeyondMimic's NumPy archive of a robot.
    BeyondMimic,
    /// A folder of CSV files as SONIC's controller reads them.
    Sonic,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bvh => "BVH",
            Self::Glb => "glTF, binary",
            Self::Gltf => "glTF, text",
            Self::Fbx => "FBX",
            Self::RobotCsv => "robot's CSV",
            Self::Qpos => "MuJoCo qpos, npy",
            Self::Npz => "Troupe npz",
            Self::Amass => "AMASS npz",
            Self::Kimodo => "Kimodo npz",
            Self::BeyondMimic => "BeyondMimic npz",
            Self::Sonic => "SONIC reference CSV",
        })
    }
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the names say the axis")]
pub enum Up {
    X,
    Y,
    Z,
    MinusX,
    MinusY,
    MinusZ,
}

impl Up {
    /// Every axis both ways.
    pub const ALL: [Self; 6] = [
        Self::X,
        Self::Y,
        Self::Z,
        Self::MinusX,
        Self::MinusY,
        Self::MinusZ,
    ];

    /// As written on a command line: `z` or `-z`.
    pub fn name(self) -> &'static str {
        ["x", "y", "z", "-x", "-y", "-z"][self as usize]
    }

    /// The axis that is written so, in any case.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|up| up.name().eq_ignore_ascii_case(name))
    }
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a value rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// The file or its format says it.
    Stated,
    /// The motion or the skeleton shows it.
    Found,
    /// An option gives it.
    Given,
    /// Neither: it is what such files usually have.
    Assumed,
}

/// A value, and why it is believed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding<T> {
    #[allow(missing_docs)]
    pub value: T,
    /// What the value rests on.
    pub basis: Basis,
    /// One line.
    pub evidence: String,
}

impl<T> Finding<T> {
    pub(super) fn new(value: T, basis: Basis, evidence: impl Into<String>) -> Self {
        Self {
            value,
            basis,
            evidence: evidence.into(),
        }
    }
}

/// What a note is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
#[allow(missing_docs, reason = "the names say it")]
pub enum Topic {
    Encoding,
    Frames,
    Up,
    Unit,
    Rate,
    Quaternion,
    Angles,
    JointOrder,
    LeadingPose,
    ZeroLength,
    Names,
    Sliding,
    Bystanders,
    Fingers,
    Body,
    Limits,
    Upright,
    Ground,
    Speed,
    Rig,
}

/// As words: `zero length`.
impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = format!("{self:?}");
        for (nth, letter) in name.chars().enumerate() {
            if nth > 0 && letter.is_uppercase() {
                f.write_str(" ")?;
            }
            write!(f, "{}", letter.to_lowercase())?;
        }
        Ok(())
    }
}

/// One line about a repair or an oddity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Note {
    #[allow(missing_docs)]
    pub topic: Topic,
    /// What was done or seen, and by which figures.
    pub text: String,
}

/// What was understood of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Name of the file, as given.
    pub file: String,
    /// Format, and what shows it.
    pub format: Finding<Format>,
    /// Program or data set that the file comes from, if anything shows it.
    pub producer: Option<Finding<String>>,
    /// Kind of skeleton.
    pub skeleton: Finding<String>,
    /// Axis of the file that points up.
    pub up: Finding<Up>,
    /// Metres a unit of the file.
    pub unit_m: Finding<f64>,
    /// Frames a second of the file.
    pub fps: Finding<f32>,
    /// Rest pose of the file's skeleton.
    pub rest_pose: Finding<RestPose>,
    /// Frames of the clip.
    pub frames: usize,
    /// Joints of the clip.
    pub joints: usize,
    /// Numbers of the joints' nodes in a glTF file, in the clip's order. Empty for other formats.
    #[serde(skip)]
    pub nodes: Vec<usize>,
    /// Joints that touch the ground.
    pub contacts: Finding<Vec<String>>,
    /// What was put right: each is certain.
    pub repairs: Vec<Note>,
    /// What looks odd and was left as it is.
    pub oddities: Vec<Note>,
}

/// Most names that a note lists.
const LISTED: usize = 8;

/// Names between commas; of many, the first and how many more there are.
pub(super) fn listed(names: &[impl AsRef<str>]) -> String {
    let first: Vec<&str> = names.iter().take(LISTED).map(AsRef::as_ref).collect();
    let more = match names.len() > LISTED {
        true => format!(" and {} more", names.len() - LISTED),
        false => String::new(),
    };
    first.join(", ") + &more
}

impl Report {
    /// The report as a table: what, its value, and the evidence. Repairs and oddities come last.
    pub fn rows(&self) -> Vec<[String; 3]> {
        fn row<T>(what: &str, of: &Finding<T>, value: String) -> [String; 3] {
            let assumed = if of.basis == Basis::Assumed {
                " (assumed)"
            } else {
                ""
            };
            [what.to_owned(), value + assumed, of.evidence.clone()]
        }
        let mut rows = vec![row("format", &self.format, self.format.value.to_string())];
        if let Some(producer) = &self.producer {
            rows.push(row("producer", producer, producer.value.clone()));
        }
        rows.push(row("skeleton", &self.skeleton, self.skeleton.value.clone()));
        rows.push(row("up axis", &self.up, self.up.value.to_string()));
        rows.push(row(
            "unit",
            &self.unit_m,
            super::units::name_of(self.unit_m.value),
        ));
        rows.push(row("rate", &self.fps, format!("{} Hz", self.fps.value)));
        rows.push(row(
            "rest pose",
            &self.rest_pose,
            self.rest_pose.value.to_string(),
        ));
        let size = format!("{:.2} s of {} joints", self.duration_s(), self.joints);
        rows.push(["frames".to_owned(), self.frames.to_string(), size]);
        let contacts = match &self.contacts.value[..] {
            [] => "none".to_owned(),
            names => names.join(", "),
        };
        rows.push(row("contacts", &self.contacts, contacts));
        for (what, notes) in [("repaired", &self.repairs), ("odd", &self.oddities)] {
            let notes = notes
                .iter()
                .map(|note| [what.to_owned(), note.topic.to_string(), note.text.clone()]);
            rows.extend(notes);
        }
        rows
    }

    /// Time from the first frame to the last at the file's rate, seconds.
    pub fn duration_s(&self) -> f32 {
        self.frames.saturating_sub(1) as f32 / self.fps.value
    }

    pub(super) fn repaired(&mut self, topic: Topic, text: impl Into<String>) {
        let text = text.into();
        self.repairs.push(Note { topic, text });
    }

    pub(super) fn odd(&mut self, topic: Topic, text: impl Into<String>) {
        let text = text.into();
        self.oddities.push(Note { topic, text });
    }
}
