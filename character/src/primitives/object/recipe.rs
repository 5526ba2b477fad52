//! The constants of smart objects, in one place.
//!
//! They come from approaches to keyframes in a closed loop on the default pack, 40 to 120 for each
//! figure. Foot skate and joint acceleration were compared with the walks of the same styles.
//! "Fine" means at most twice the skate and 1.5 times the acceleration.

/// Speed to which a character slows down near its goal, m/s: fine in 97 % from runs, compared with
/// 82 % at 2.0.
pub const NEAR_MPS: f32 = 1.5;
/// Near means within this distance of the goal, metres: enough for a run to slow down before the
/// first set begins.
pub const NEAR_M: f32 = 4.0;
/// Speed of an approach in a style without its own speed, m/s.
pub const PACE_MPS: f32 = 1.2;
/// The first set begins this many seconds of the character's speed before its keyframe. 1.2 to 1.8
/// are alike: 84 % fine from any side, and 97 % in the seeds that it was chosen on. At 1.0, 87 % of
/// the latter.
pub const HAND_OVER_S: f32 = 1.4;
/// The first set begins at least this far before its keyframe, metres.
pub const HAND_OVER_M: f32 = 0.3;
/// A character faster than this, m/s, does not hand over, nor does one whose direction is off the
/// keyframe's by more than [`HAND_OVER_TURN`]: such plans end up to 2 m short. It slows down and
/// turns around first.
pub const HAND_OVER_MPS: f32 = 1.8;
/// See [`HAND_OVER_MPS`], radians.
pub const HAND_OVER_TURN: f32 = 60.0 * DEGREE;
/// A character that has been near for this many frames without handing over on the way stops first.
pub const NEAR_FRAMES: i64 = 150;
/// A character within this distance of the keyframe, metres, and slower than [`STANDS_MPS`] needs
/// no approach: any heading is met from there, 95 % fine.
pub const IN_PLACE_M: f32 = 0.15;
/// A character slower than this stands, m/s.
pub const STANDS_MPS: f32 = 0.3;
/// A standing character with at most this far to go, metres, goes there and stops: beginning the
/// set on the way is fine in only 27 to 78 %.
pub const STAND_NEAR_M: f32 = 1.0;
/// A character that is to stop first stops this many seconds of its speed before the keyframe.
pub const STOP_S: f32 = 0.6;
/// It stops at least this far before the keyframe, metres.
pub const STOP_M: f32 = 0.12;
/// A character slower than this has stopped, m/s. At 0.3 the result is fine in 73 % instead of 87
/// %.
pub const STOPPED_MPS: f32 = 0.12;
/// A character that has stopped is within this angle of the keyframe's heading, radians.
pub const STOPPED_TURN: f32 = 35.0 * DEGREE;
/// Fewest and most frames of a stop.
pub const STOP_FRAMES: (i64, i64) = (10, 75);
/// A place on the way counts as passed within this many seconds of the character's speed, and
/// within the second value, metres.
pub const PASSED: (f32, f32) = (0.6, 0.3);
/// Frames between checks of the direction.
pub const STEER_FRAMES: i64 = 3;
/// A command changes if the direction has turned by more than this, radians.
pub const STEER_TURN: f32 = 1.0 * DEGREE;
/// A plan is asked for at once if the direction has turned by more than this, radians.
pub const SHARP_TURN: f32 = 20.0 * DEGREE;
/// An approach fails after this many frames.
pub const APPROACH_FRAMES: i64 = 600;

/// A plan covers the way to its keyframe at no less than this share of the character's speed, and
/// no less than the second value, m/s. Plans that choose for themselves take too few tokens: 42 %
/// fine, compared with 68 % for the best count.
pub const SLOWEST: (f32, f32) = (0.5, 0.5);
/// Tokens of the plan to the first keyframe: at least the first number; more, up to the second, if
/// the way needs them; never more than the third.
pub const FIRST_TOKENS: (u32, u32, u32) = (6, 15, 16);
/// The same for plans from one keyframe to the next: about a second if the character stays in
/// place. Any count from 5 on is fine.
pub const NEXT_TOKENS: (u32, u32, u32) = (5, 15, 16);
/// Tokens that a plan may have beyond the fewest, if the character stays in place.
pub const SPARE_TOKENS: u32 = 3;
/// A keyframe nearer than this counts as in place, metres.
pub const STAYS_M: f32 = 0.2;
/// Fewest frames from where a plan takes over to its keyframe: one more than its fade.
pub const LEAST_PLAN_FRAMES: u32 = 9;
/// Fastest turn on the spot, rad/s.
pub const TURN_RPS: f32 = 90.0 * DEGREE;
/// Frames over which a plan fades into the still pose of its keyframe. They lower the joints'
/// acceleration there from 2.5 times a walk's to half of it.
pub const SETTLE_FRAMES: usize = 14;
/// A motion is planned again only if at least this many frames are left before its keyframe.
pub const REPLAN_LEFT_FRAMES: i64 = 8;

/// A motion to or from low hips ([`troupe_motion::model::Rig::low_hips_m`]) without the networks:
/// its frames, and its lean if the hips go forward or back, radians.
pub const LOW_STANCE: (u32, f32) = (36, 0.7);
/// Frames of such a motion if the hips go straight up or down.
pub const LOW_FRAMES: u32 = 33;
/// Hips that move farther than this over the ground lean, metres.
pub const LEAN_M: f32 = 0.15;
/// Fewest and most frames of a motion with high hips, and frames for a joint that moves by a metre.
/// They grow with the square root of the distance.
pub const STANCE_FRAMES: (u32, u32, f32) = (10, 24, 24.0);
/// Frames for each foot that steps a metre, growing with the square root too. With fewer the knee
/// jerks.
pub const STEP_FRAMES: f32 = 24.0;
/// A foot that moves by less than this does not step, metres.
pub const NO_STEP_M: f32 = 0.02;
/// For a pose at another height, the feet stay in place if the root has moved by at most this
/// distance and angle, metres and radians.
pub const FEET_STAY: (f32, f32) = (0.6, 0.6);
/// Farthest that a joint may stay from its point, metres.
pub const REACHED_M: f32 = 0.05;

const DEGREE: f32 = std::f32::consts::PI / 180.0;
