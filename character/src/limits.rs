//! Limits of values that requests and documents share.

/// Farthest that a place may be from another that it goes with, such as the origin, in metres.
pub const MAX_DISTANCE_M: f32 = 1e4;
/// Largest distance of any given height from the ground, in metres.
pub const MAX_HEIGHT_M: f32 = 100.0;
/// How far a keyframe's heading may be from that of its pose, in radians.
pub const HEADING_TOLERANCE: f32 = 0.01;
/// How far a rotation's length may be from 1.
pub const UNIT_TOLERANCE: f32 = 1e-3;
