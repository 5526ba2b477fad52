//! Limits of values that both requests and documents have.

/// Largest distance between two places that belong together, such as a place and the origin,
/// metres.
pub const MAX_DISTANCE_M: f32 = 1e4;
/// Largest height over the ground that may be given, metres.
pub const MAX_HEIGHT_M: f32 = 100.0;
/// Largest difference between a keyframe's heading and that of its pose, radians.
pub const HEADING_TOLERANCE: f32 = 0.01;
/// Largest difference between a rotation's length and 1.
pub const UNIT_TOLERANCE: f32 = 1e-3;
