//! Values of messages: checked, brought into native units and axes, and back.
//!
//! Conventions are dealt with here, at the edge; everything that comes out is in metres, radians
//! and the native axes. [`units`] has single values, [`keyframe`] keyframes, [`context`] those that
//! a live character begins with.

mod context;
mod hinges;
pub(crate) mod keyframe;
pub(crate) mod units;

pub use context::{ContextFrame, check_context, check_frame, to_native};

/// Largest distance of any keyframe from the last context frame, in metres.
pub const MAX_DISTANCE_M: f32 = 1e4;
/// How far apart the heights that one keyframe gives may be, in metres.
pub const HEIGHT_TOLERANCE_M: f32 = 1e-3;
/// Largest given velocity of a keyframe, in m/s along an axis and in rad/s.
pub const MAX_VELOCITY: f32 = 1e3;
/// How far outside of its hinge's limits an angle of a keyframe may be, radians; it is taken as the
/// limit.
pub const ANGLE_TOLERANCE_RAD: f32 = 0.01;
/// Highest sampling temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;
/// Most characters of a sentence to act out.
pub const MAX_PROMPT_CHARS: usize = 1000;
/// Most characters of a message that may echo the request.
pub const MAX_MESSAGE: usize = 512;
/// Most characters of a field's path that may echo the request.
pub const MAX_PATH: usize = 256;

/// What an error echoes of a request: at most `limit` characters of it, and an ellipsis where there
/// is more.
pub fn cut(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_echoed_is_cut_between_characters() {
        assert_eq!(cut("naïve", 3), "naï…");
        assert_eq!(cut("naïve", 5), "naïve");
        assert_eq!(cut("", 0), "");
    }
}
