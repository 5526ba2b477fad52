//! Why a file was not read. Each error names the file, the place in it and the option that decides.

use super::choices::{Advice, Choice, OptionName};
use super::report::Topic;
use crate::bvh::BvhError;
use crate::clip::ClipError;
use crate::convert::ConvertError;
use crate::files::NumpyError;
use crate::glb::GlbReadError;

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {kind}")]
pub struct ReadError {
    /// Name of the file, as given.
    pub file: String,
    /// What is wrong with it.
    pub kind: ReadErrorKind,
}

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadErrorKind {
    /// No format that is read.
    #[error(
        "neither its ending nor its content is that of motion: .bvh, .fbx, .glb, .gltf or .npz, or .csv or .npy of a robot"
    )]
    Unknown,
    /// A format that is not read, and how to convert it.
    #[error("{format} is not read; {how}")]
    NotRead {
        /// Name of the format.
        format: &'static str,
        /// What makes a file that is read.
        how: &'static str,
    },
    /// An error in a BVH text.
    #[error("{error}{}", advice(.option))]
    Bvh {
        /// The error, with its line.
        error: BvhError,
        /// The option that decides, if there is one.
        option: Option<Advice>,
    },
    /// An error in a glTF file.
    #[error("{error}{}", advice(.option))]
    Glb {
        /// The error, with the animation and node.
        error: GlbReadError,
        /// The option that decides, if there is one.
        option: Option<Advice>,
    },
    /// The file has several animations, and none is named.
    #[error("it has {} animations: {}; {} decides", .0.len(), .0.join(", "), OptionName::Animation.flag())]
    SeveralAnimations(Vec<String>),
    /// No animation of the file has this name.
    #[error("no animation {wanted:?}; the file has {}", .names.join(", "))]
    UnknownAnimation {
        /// The name that was given.
        wanted: String,
        /// Names of the file's animations.
        names: Vec<String>,
    },
    /// An FBX file without animation.
    #[error("it has no animation")]
    NoAnimation,
    /// An error in an FBX file.
    #[error("{0}")]
    Fbx(String),
    /// The motion does not make a clip, or not one on the skeleton.
    #[error("{error}{}", advice(.option))]
    Convert {
        /// The error, with the joint and frame.
        error: ConvertError,
        /// The option that decides, if there is one.
        option: Option<Advice>,
    },
    /// An error in a NumPy file.
    #[error(transparent)]
    Numpy(#[from] NumpyError),
    /// The frames do not make a clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// What the file leaves open, with the options that decide.
    #[error("{what} is unclear: {evidence}; {options}")]
    Open {
        /// What it is about.
        topic: Topic,
        /// As it stands in a sentence.
        what: &'static str,
        /// What speaks for either.
        evidence: String,
        /// The options that decide.
        options: Advice,
    },
    /// A joint moves in its parent farther than can be held.
    #[error(
        "joint {joint:?} moves {slide_m:.3} m in its parent (most in frame {frame}), and {carries} on it; \
         allowed: {allowed_m:.3} m. {advice}"
    )]
    Slides {
        /// Name of the joint.
        joint: String,
        /// Largest distance from its place in the first frame, metres.
        slide_m: f32,
        /// Frame of that distance, from 0.
        frame: usize,
        /// What hangs on the joint, with its verb.
        carries: String,
        /// Largest distance that is held, metres.
        allowed_m: f32,
        /// The options that decide.
        advice: Advice,
    },
    /// A value of an option or of the file is out of range.
    #[error("{field} is {found}; allowed: {allowed}{}", advice(.option))]
    Range {
        /// Field of the file or name of an option.
        field: String,
        /// The value that it has.
        found: String,
        /// The values that are allowed.
        allowed: String,
        /// The option that decides, if there is one.
        option: Option<Advice>,
    },
    /// The numbers are a robot's, and no robot is given.
    #[error("its numbers are angles of a robot's hinges: {} gives the robot", OptionName::Skeleton.flag())]
    NoRobot,
    /// Angles are far beyond their limits, whatever they mean.
    #[error("{evidence}: {advice}")]
    Angles {
        /// The worst of them.
        evidence: String,
        /// The options that say what they mean.
        advice: Advice,
    },
    /// An option is given that robots' files have no use for.
    #[error(
        "{} does not apply to a robot's file: its axes and unit are fixed, and its joints are the robot's",
        .0.flag()
    )]
    Unused(OptionName),
    /// An animation is named, but the format has none.
    #[error("animation {0:?}: only .glb, .gltf and .fbx files have animations with names")]
    NoAnimations(String),
    /// A robot's file does not fit the robot.
    #[error("{0}")]
    Robot(String),
}

/// The end of a sentence that names the option that decides.
fn advice(option: &Option<Advice>) -> String {
    option
        .as_ref()
        .map_or_else(String::new, |option| format!("; {option}"))
}

impl ReadError {
    /// The options that decide; empty if no option helps.
    pub fn options(&self) -> Vec<Choice> {
        self.kind.options()
    }
}

impl ReadErrorKind {
    /// The options that decide; empty if no option helps.
    pub fn options(&self) -> Vec<Choice> {
        match self {
            Self::SeveralAnimations(names) | Self::UnknownAnimation { names, .. } => {
                vec![Choice::new(OptionName::Animation, names)]
            }
            Self::Open { options, .. }
            | Self::Angles { advice: options, .. }
            | Self::Slides { advice: options, .. } => options.choices().to_vec(),
            Self::NoRobot => vec![Choice::any(OptionName::Skeleton)],
            Self::Unused(option) => vec![Choice::any(*option)],
            Self::Range {
                field, option: None, ..
            } => {
                // The field may be the option itself.
                let named = OptionName::all().find(|option| option.flag() == field);
                named.map(Choice::any).into_iter().collect()
            }
            Self::Bvh { option, .. }
            | Self::Glb { option, .. }
            | Self::Convert { option, .. }
            | Self::Range { option, .. } => option.iter().flat_map(Advice::choices).cloned().collect(),
            Self::Unknown
            | Self::NotRead { .. }
            | Self::NoAnimation
            | Self::Fbx(_)
            | Self::Numpy(_)
            | Self::Clip(_)
            | Self::NoAnimations(_)
            | Self::Robot(_) => Vec::new(),
        }
    }

    /// Whether the file has no animation, but may have a skeleton at rest.
    pub fn lacks_animation(&self) -> bool {
        let of_glb = |error: &GlbReadError| matches!(error, GlbReadError::NoAnimation);
        matches!(self, Self::NoAnimation) || matches!(self, Self::Glb { error, .. } if of_glb(error))
    }

    pub(super) fn of(self, file: &str) -> ReadError {
        ReadError {
            file: file.to_owned(),
            kind: self,
        }
    }

    pub(super) fn convert(error: ConvertError) -> Self {
        let option = match &error {
            ConvertError::OffsetMismatch { .. } => Some(Advice::new(
                "is {} right? {} plays the motion on the skeleton's own bones",
                [OptionName::Unit, OptionName::OtherBones].map(Choice::any),
            )),
            ConvertError::SeveralRoots(_) => Some(Advice::new(
                "{} names the joint that is the character's root",
                [Choice::any(OptionName::Root)],
            )),
            _ => None,
        };
        Self::Convert { error, option }
    }
}
