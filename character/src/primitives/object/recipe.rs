//! The numbers of smart objects, in one place.
//!
//! They were found by running approaches to keyframes in a closed loop on the default pack, 40 to
//! 120 a figure, and comparing foot skate and joint acceleration with the walks of the same styles;
//! "fine" below means at most twice the skate and 1.5 times the acceleration.

/// A character slows down to this when it comes near, m/s: fine in 97 % from runs, against 82 % at
/// 2.0.
pub const NEAR_MPS: f32 = 1.5;
/// Near is within this of the target, metres: a run has slowed down by the time that the first set
/// begins.
pub const NEAR_M: f32 = 4.0;
/// Speed of an approach in a style that has no speed of its own, m/s.
pub const PACE_MPS: f32 = 1.2;
/// The first set begins so many seconds of the character's speed before its keyframe. 1.2 to 1.8
/// are alike (84 % fine from any side, 97 % in the seeds that it was chosen on); at 1.0, 87 % of
/// these.
pub const HAND_OVER_S: f32 = 1.4;
/// And no nearer than this, metres.
pub const HAND_OVER_M: f32 = 0.3;
/// But not by a character that is faster than this, m/s, or whose way is off the keyframe's
/// direction by more than this, radians: plans from there end up to 2 m short. It slows down and
/// turns around first.
pub const HAND_OVER_MPS: f32 = 1.8;
/// See [`HAND_OVER_MPS`].
pub const HAND_OVER_TURN: f32 = 60.0 * DEGREE;
/// A character that has been near for so many frames, and could not hand over on the way, stops
/// first.
pub const NEAR_FRAMES: i64 = 150;
/// A character within this of the keyframe, metres, that is slower than [`STANDS_MPS`] needs no
/// approach: any heading is met where it stands, 95 % fine.
pub const IN_PLACE_M: f32 = 0.15;
/// A character that is slower than this stands, m/s.
pub const STANDS_MPS: f32 = 0.3;
/// A character that stands and has no farther to go than this, metres, goes there and stops: to
/// begin the set on the way is fine in 27 to 78 % only.
pub const STAND_NEAR_M: f32 = 1.0;
/// Seconds of the character's speed before the keyframe at which it stops, where it is to stop
/// first.
pub const STOP_S: f32 = 0.6;
/// And no nearer than this, metres.
pub const STOP_M: f32 = 0.12;
/// Slower than this a character has stopped, m/s. At 0.3 it is fine in 73 % instead of 87 %.
pub const STOPPED_MPS: f32 = 0.12;
/// And no farther from the keyframe's heading than this, radians.
pub const STOPPED_TURN: f32 = 35.0 * DEGREE;
/// Frames that a stop takes at least and at most.
pub const STOP_FRAMES: (i64, i64) = (10, 75);
/// A place on the way counts as passed within so many seconds of the character's speed, and within
/// the second, metres.
pub const PASSED: (f32, f32) = (0.6, 0.3);
/// Frames between looks at the way.
pub const STEER_FRAMES: i64 = 3;
/// A command is changed where the way has turned by more than this, radians.
pub const STEER_TURN: f32 = 1.0 * DEGREE;
/// And a plan asked for at once where it has turned by more than this, radians.
pub const SHARP_TURN: f32 = 20.0 * DEGREE;
/// Frames after which an approach has failed.
pub const APPROACH_FRAMES: i64 = 600;

/// Share of the character's speed, and least speed (m/s), at which a plan covers the way to its
/// keyframe at the slowest. Plans that choose for themselves take too few tokens: 42 % fine against
/// 68 % with the best count.
pub const SLOWEST: (f32, f32) = (0.5, 0.5);
/// Tokens of the plan to the first keyframe: at least the first number, and more where the way asks
/// for it, up to the second; at most the third.
pub const FIRST_TOKENS: (u32, u32, u32) = (6, 15, 16);
/// The same for plans from one keyframe to the next: about a second where the character stays. Any
/// count from 5 is fine.
pub const NEXT_TOKENS: (u32, u32, u32) = (5, 15, 16);
/// Tokens beyond the fewest that a plan where the character stays may have.
pub const SPARE_TOKENS: u32 = 3;
/// A keyframe nearer than this is where the character stands, metres.
pub const STAYS_M: f32 = 0.2;
/// Fewest frames from where a plan takes over to its keyframe: it has faded in one frame before.
pub const LEAST_PLAN_FRAMES: u32 = 9;
/// Quickest turn on the spot, rad/s.
pub const TURN_RPS: f32 = 90.0 * DEGREE;
/// Frames over which a plan fades into the still pose of its keyframe: the joints' acceleration
/// there falls from 2.5 times a walk's to half of it.
pub const SETTLE_FRAMES: usize = 14;
/// Frames that must be left before a keyframe for its motion to be planned again.
pub const REPLAN_LEFT_FRAMES: i64 = 8;

/// Frames of a motion without the networks: to or from low hips
/// ([`troupe_motion::model::Rig::low_hips_m`]), and how far it leans on the way, radians, where the
/// hips go forward or back.
pub const LOW_STANCE: (u32, f32) = (36, 0.7);
/// The same for hips that go straight down or up.
pub const LOW_FRAMES: u32 = 33;
/// Hips that go farther than this over the ground lean, metres.
pub const LEAN_M: f32 = 0.15;
/// Fewest and most frames of one that stays up, and how many it takes for a joint that moves by a
/// metre; they grow with the square root of the way.
pub const STANCE_FRAMES: (u32, u32, f32) = (10, 24, 24.0);
/// Frames of such a motion for each foot that steps a metre in it, by the square root of the way
/// too: in fewer the knee jerks.
pub const STEP_FRAMES: f32 = 24.0;
/// A foot that stands elsewhere by less does not count as one that steps, metres.
pub const NO_STEP_M: f32 = 0.02;
/// Feet stay where they are for a pose at another height whose root is within so many metres and
/// radians of where it was.
pub const FEET_STAY: (f32, f32) = (0.6, 0.6);
/// Farthest that a joint may stay from its point, metres.
pub const REACHED_M: f32 = 0.05;

const DEGREE: f32 = std::f32::consts::PI / 180.0;
