//! From Troupe's frame of reference (X left, Y up, Z ahead) to Godot's (X right, Y up, Z back) and
//! back. Both are right-handed and in metres, so that half a turn about Y leads from one to the
//! other. The same functions go both ways, and headings are the same number in both.
//! `clients/conventions/poses.json` has poses in both.

use glam::{Quat, Vec3};

/// A position, offset or velocity in the other frame.
pub fn position(of: Vec3) -> Vec3 {
    Vec3::new(-of.x, of.y, -of.z)
}

/// A rotation in the other frame, relative to the world or to a parent.
pub fn rotation(of: Quat) -> Quat {
    Quat::from_xyzw(-of.x, of.y, -of.z, of.w)
}
