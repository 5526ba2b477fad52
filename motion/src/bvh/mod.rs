//! BVH: reads and writes files, and converts from and to [`Clip`](crate::Clip).
//!
//! Supported: any hierarchy (several roots too), any order and subset of channels, End Sites, any
//! whitespace and line ends, exponents, keywords in any case, one row of numbers a frame. A
//! position channel **replaces** the axis of the OFFSET that it names. Rotation channels apply in
//! the order of the file: `Z X Y` is the matrix product `Rz·Rx·Ry`.
//!
//! The reader is made for hostile input. It does not recurse. It allocates by the text that it has
//! seen, never by a count that the text declares. It stops at the limits below. The conversion to a
//! clip has its own limits ([`ConvertError::TooLong`]): a joint without channels takes no text in a
//! frame, but a rotation in a clip's.

mod convert;
mod error;
mod euler;
mod parse;
mod write;

pub use crate::convert::ConvertError;
pub use convert::{BvhOptions, BvhWriteOptions};
pub use error::{BvhError, BvhErrorKind};
pub use euler::EulerOrder;
pub use parse::{MiscountedFrames, parse, parse_bytes, parse_tolerant};
pub use write::write;

use glam::DVec3;

/// The most joints in a file.
pub const MAX_JOINTS: usize = 1024;
/// The deepest nesting of joints.
pub const MAX_DEPTH: usize = 512;
/// The most frames in a file.
pub const MAX_FRAMES: usize = 1 << 20;
/// The longest joint name, bytes.
pub const MAX_NAME_BYTES: usize = 256;

/// One degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the format")]
pub enum Channel {
    Xposition,
    Yposition,
    Zposition,
    Xrotation,
    Yrotation,
    Zrotation,
}

impl Channel {
    /// All six.
    pub const ALL: [Self; 6] = [
        Self::Xposition,
        Self::Yposition,
        Self::Zposition,
        Self::Xrotation,
        Self::Yrotation,
        Self::Zrotation,
    ];

    /// The channel's name in the format.
    pub fn name(self) -> &'static str {
        [
            "Xposition",
            "Yposition",
            "Zposition",
            "Xrotation",
            "Yrotation",
            "Zrotation",
        ][self as usize]
    }

    /// 0 for X, 1 for Y, 2 for Z.
    pub fn axis(self) -> usize {
        self as usize % 3
    }

    /// Whether it rotates, and does not move.
    pub fn is_rotation(self) -> bool {
        self as usize >= 3
    }
}

/// A joint of a BVH hierarchy, in the file's units.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhJoint {
    /// Not empty, without `{` and line ends, and without space at its ends.
    pub name: String,
    /// Index of the parent, smaller than the joint's own; `None` for a ROOT.
    pub parent: Option<usize>,
    /// OFFSET, in the file's units.
    pub offset: DVec3,
    /// Each channel at most once.
    pub channels: Vec<Channel>,
    /// OFFSETs of its End Sites.
    pub end_sites: Vec<DVec3>,
}

/// A BVH file: hierarchy and motion, in the file's own units and in degrees. All numbers are
/// finite.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhFile {
    joints: Vec<BvhJoint>,
    frame_time_s: f64,
    channels: usize,
    values: Vec<f64>,
}

/// Why a [`BvhFile`] cannot be built from parts.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BvhBuildError {
    /// No joints, or more than [`MAX_JOINTS`].
    #[error("{0} joints: from 1 to {MAX_JOINTS} are supported")]
    JointCount(usize),
    /// A name that the format cannot hold.
    #[error("joint {0}: the name {1:?} cannot be written to BVH")]
    Name(usize, String),
    /// A joint whose parent does not come before it.
    #[error("joint {0:?}: its parent does not come before it")]
    Parent(String),
    /// Joints nested deeper than [`MAX_DEPTH`].
    #[error("joint {0:?} is nested more than {MAX_DEPTH} deep")]
    Depth(String),
    /// A joint has a channel twice.
    #[error("joint {0:?} has a channel twice")]
    Channels(String),
    /// No channels at all.
    #[error("no joint has channels")]
    NoChannels,
    /// A value that is not finite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// A frame time that is not positive.
    #[error("the frame time must be positive, not {0}")]
    FrameTime(f64),
    /// Values that do not make whole frames, or more than [`MAX_FRAMES`].
    #[error("{values} values do not make 0 to {MAX_FRAMES} frames of {channels} channels")]
    Values {
        /// Number of values.
        values: usize,
        /// Channels a frame.
        channels: usize,
    },
}

impl BvhFile {
    /// Checks the parts of a file and builds it. `values` has the channels of all joints, in the
    /// joints' order, frame by frame.
    ///
    /// # Errors
    /// [`BvhBuildError`] if the parts do not fit each other or the format.
    pub fn new(joints: Vec<BvhJoint>, frame_time_s: f64, values: Vec<f64>) -> Result<Self, BvhBuildError> {
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            return Err(BvhBuildError::JointCount(joints.len()));
        }
        let mut depths: Vec<usize> = Vec::with_capacity(joints.len());
        for (index, joint) in joints.iter().enumerate() {
            let name = || joint.name.clone();
            if !name_is_writable(&joint.name) {
                return Err(BvhBuildError::Name(index, name()));
            }
            let depth = match joint.parent {
                None => 1,
                Some(p) if p < index => depths[p] + 1,
                Some(_) => return Err(BvhBuildError::Parent(name())),
            };
            if depth > MAX_DEPTH {
                return Err(BvhBuildError::Depth(name()));
            }
            depths.push(depth);
            if joint
                .channels
                .iter()
                .enumerate()
                .any(|(i, c)| joint.channels[..i].contains(c))
            {
                return Err(BvhBuildError::Channels(name()));
            }
            if !(joint.offset.is_finite() && joint.end_sites.iter().all(|e| e.is_finite())) {
                return Err(BvhBuildError::NotFinite("an offset"));
            }
        }
        if !(frame_time_s.is_finite() && frame_time_s > 0.0) {
            return Err(BvhBuildError::FrameTime(frame_time_s));
        }
        let channels = joints.iter().map(|j| j.channels.len()).sum();
        if channels == 0 {
            return Err(BvhBuildError::NoChannels);
        }
        if !values.len().is_multiple_of(channels) || values.len() / channels > MAX_FRAMES {
            return Err(BvhBuildError::Values {
                values: values.len(),
                channels,
            });
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(BvhBuildError::NotFinite("a motion value"));
        }
        Ok(Self {
            joints,
            frame_time_s,
            channels,
            values,
        })
    }

    /// The joints, parents before children. A file that was read keeps the order of its text.
    pub fn joints(&self) -> &[BvhJoint] {
        &self.joints
    }

    /// Time from frame to frame, seconds.
    pub fn frame_time_s(&self) -> f64 {
        self.frame_time_s
    }

    /// Frames a second. Files round the frame time (0.0333333), so a rate within 0.05 % of a whole
    /// number is that number.
    pub fn fps(&self) -> f32 {
        let fps = 1.0 / self.frame_time_s;
        let whole = fps.round();
        if whole >= 1.0 && (fps - whole).abs() <= 5e-4 * whole {
            whole as f32
        } else {
            fps as f32
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.values.len() / self.channels
    }

    /// The numbers of one frame, joints in order.
    ///
    /// # Panics
    /// If `frame` is out of range.
    pub fn row(&self, frame: usize) -> &[f64] {
        &self.values[frame * self.channels..(frame + 1) * self.channels]
    }
}

fn name_is_writable(name: &str) -> bool {
    !name.is_empty()
        && name.len() <= MAX_NAME_BYTES
        && name.trim() == name
        && !name.contains(['{', '\n', '\r'])
}

#[cfg(test)]
mod tests;
