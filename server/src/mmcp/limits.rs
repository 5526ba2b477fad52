//! All limits on the protocol's requests.

/// Longest motion, seconds.
pub const MAX_SECONDS: f32 = 60.0;
/// Recommended limit for one request, seconds.
pub const RECOMMENDED_SECONDS: f32 = 20.0;
/// Lowest and highest frame rate of an answer.
pub const FPS: [f64; 2] = [1.0, 240.0];
/// Most motions of one request.
pub const MAX_SAMPLES: usize = 16;
/// Most requests of a batch.
pub const MAX_BATCH: usize = 16;
/// Most segments of a request.
pub const MAX_SEGMENTS: usize = 64;
/// Most constraints of a request.
pub const MAX_CONSTRAINTS: usize = 256;
/// Most points of a root path, and most frames of an effector target.
pub const MAX_POINTS: usize = 4096;
/// Most points of the ground.
pub const MAX_GROUND_POINTS: usize = 4096;
/// Most frames of a reference motion, for models without a limit of their own.
pub const MAX_REFERENCE_FRAMES: usize = 1024;
/// Most bytes of a request, a batch included.
pub const MAX_REQUEST_BYTES: usize = 4 << 20;
/// Most frames of the transition into a segment.
pub const MAX_TRANSITION_FRAMES: i64 = 60;
/// Fewest and most sampler steps that a request may ask for.
pub const STEPS: [i64; 2] = [1, 500];
/// Most values of an option. The protocol sets this limit.
pub const MAX_VALUES: usize = 32;
/// Lowest and highest sampling temperature.
pub const TEMPERATURES: [f32; 2] = [0.0, 2.0];
/// Smallest and largest guidance weight.
pub const GUIDANCE: [f64; 2] = [0.0, 8.0];
/// Largest distance of a position from the origin over the ground, metres.
pub const MAX_PLACE_M: f64 = 1e4;
/// Largest distance of a height from 0, metres.
pub const MAX_HEIGHT_M: f64 = 100.0;
/// Fastest allowed root path, metres per second.
pub const MAX_SPEED_MPS: f32 = 15.0;
/// Largest distance of a joint's rest position from the model's, metres.
pub const REST_TOLERANCE_M: f64 = 5e-3;
