//! The motion core of Troupe: pure maths and file formats, without async, network or inference.
//!
//! Conventions, unless an item says otherwise: right-handed, Y up, +Z forward, metres, seconds,
//! radians. A heading ψ is the angle about +Y; forward is `(sin ψ, 0, cos ψ)`. Arrays over frames
//! and joints are flat and frame-major: entry `frame * joints + joint`. Rotations of a pose are one
//! quaternion a joint: joint 0 (the pelvis) in the world, every other relative to its parent.
//!
//! State of a frame (MotionBricks, section 4): global root `r_g` ([`root::GlobalRoot`]), local root
//! `r_l` ([`root::LocalRoot`]), joint positions relative to the projected root and 6D rotations in
//! the world ([`features`]), joint velocities, and foot contacts ([`contacts`]).

pub mod anatomy;
pub mod ballistic;
pub mod bend;
pub mod bones;
pub mod bvh;
pub mod clip;
pub mod codec;
pub mod contacts;
pub mod conventions;
pub mod convert;
pub mod feasibility;
pub mod features;
#[cfg(feature = "files")]
pub mod files;
pub mod fk;
pub mod gait;
pub mod glb;
pub mod gltf;
pub mod ik;
pub mod inspect;
pub mod interpolate;
pub mod looping;
pub mod metrics;
pub mod model;
pub mod path;
pub mod pin;
#[cfg(feature = "files")]
pub mod read;
pub mod retarget;
pub mod robot;
pub mod root;
pub mod rotation;
pub mod segment;
pub mod skeleton;
pub mod spring;
pub mod stance;
pub mod terrain;

#[cfg(test)]
mod testing;

pub use clip::Clip;
pub use robot::Robot;
pub use root::{GlobalRoot, LocalRoot};
pub use segment::SegmentFrame;
pub use skeleton::{ContactParams, Joint, Skeleton};

pub use glam::{Quat, Vec2, Vec3};
