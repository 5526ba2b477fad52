//! The constants of smart locomotion, in one place.
//!
//! They come from running the whole loop (commands, plans, cross-fades) on the default pack in
//! forty scenarios. Speed, heading, foot skate, joint acceleration and likeness to the source clips
//! were compared. A comment names the alternative that a value was compared with, if that matters.

/// Seconds ahead at which targets lie (paper section 6.1).
pub const HORIZON_S: f32 = 1.0;
/// Target keyframes at a segment's end, 1 to 4. Two were no better than one.
pub const TARGET_KEYS: usize = 1;
/// Damping γ of equation 6 for the position, 1/s. With 4 the speed is 8 % short; 6 and 8 are alike.
pub const GAMMA: f32 = 8.0;
/// Damping for the heading, 1/s. The heading follows a goal that turns at a steady rate.
pub const TURN_GAMMA: f32 = 12.0;
/// Seconds in which that goal reaches a target that is near enough.
pub const TURN_S: f32 = 0.35;
/// Highest turning rate, rad/s: 1.5 times the rate below which 95 % of the turning clips stay, over
/// 8 frames. With 1.3 times, an about-turn is 16° short after a second; with 1.2 times, 24°.
pub const MOST_TURN_RPS: f32 = 5.5;
/// Acceleration of a change of velocity, m/s².
pub const ACCELERATION_MPS2: f32 = 4.0;
/// Longest duration of a change of velocity, seconds. A longer change is accelerated more.
pub const CHANGE_S: f32 = 0.8;
/// A smaller change of velocity does not count, m/s.
pub const LEAST_CHANGE_MPS: f32 = 0.1;
/// How closely the root follows the ramp while the velocity changes, 0 to 1. Left alone, the root
/// stage takes half of the new velocity in its first frame.
pub const CHANGE_RATIO: f32 = 1.0;
/// The ramp restarts from the character if the two differ by more than this, m/s, and by more than
/// what the character may have gained in [`VELOCITY_LAG_S`].
pub const RESYNC_MPS: f32 = 1.2;
/// Frames at 30 Hz over which the root's velocity at a plan's start is measured: enough to average
/// the sway of a step out.
pub const VELOCITY_FRAMES: usize = 10;
/// Lag of that velocity, seconds. Without this allowance, a run that turns round would restart the
/// ramp at every plan.
pub const VELOCITY_LAG_S: f32 = 0.5 * VELOCITY_FRAMES as f32 / 30.0;
/// How closely headings follow the spring: completely. The root stage's own headings start the turn
/// again with every plan. A turn of 90° is then 29° short after a second, compared with 1° for the
/// spring.
pub const HEADING_RATIO: f32 = 1.0;
/// How closely heights follow those of the style's gait. The root stage is 1 to 3 cm off in styles
/// with little data, which brings swinging feet too near to the ground.
pub const HEIGHT_RATIO: f32 = 1.0;
/// Frames at 30 Hz over which a plan's heights change from the character's to the gait's.
pub const HEIGHT_FADE_FRAMES: f32 = 10.0;
/// Most that a plan's headings may lead the character's, radians. A turn of 180° takes two plans.
pub const MAX_TURN: f32 = 100.0 * DEGREE;
/// The heading spring restarts from the character if the two differ by more than this, radians.
pub const RESYNC_TURN: f32 = 120.0 * DEGREE;

/// Frames at 30 Hz of a plan by a path, context included: whole tokens.
pub const PATH_PLAN_FRAMES: usize = 36;
/// Frames at 30 Hz over which the headings of such a path change from the character's, which sways,
/// to the spring's.
pub const SWAY_FADE_FRAMES: f32 = 10.0;
/// How closely the root follows a commanded path, unless the session says otherwise.
pub const PATH_RATIO: f32 = 1.0;

/// A command slower than this stands, m/s.
pub const STANDING_MPS: f32 = 0.05;
/// A character that is slower than the first value (m/s) and turns by less than the second
/// (radians) counts as standing, if its command is to stand.
pub const STILL: (f32, f32) = (0.12, 0.15);
/// A character that stops has a pose at this share of the way to its target.
pub const STOP_POSE: f32 = 0.8;
/// Below this speed a gait fades into standing, m/s, so that no speed has a jump.
pub const STARTING_MPS: f32 = 0.15;
/// Seconds of standing after which the root is held in place. Otherwise it drifts by 1 to 16 cm a
/// minute.
pub const ANCHOR_AFTER_S: f32 = 1.0;
/// Frames at 30 Hz for which one of several standing poses is kept.
pub const STAND_FRAMES: u64 = 45;

/// Highest speed that a style may have, relative to its fastest gait in a direction.
pub const SPEED_MARGIN: f32 = 1.1;
/// Walking pace aside or backwards without a gait for it, m/s, unless the style has something
/// slower.
pub const OFF_AXIS_PACE_MPS: f32 = 1.3;
/// A gait's speed beyond that pace is available up to the first angle from its direction, and gone
/// at the second, radians.
pub const FAST_ARC: (f32, f32) = (15.0 * DEGREE, 35.0 * DEGREE);
/// Without a gait that goes farther aside, the heading turns towards the velocity until they are
/// within this angle, radians: the data has no pure side steps, and legs would slide.
pub const FORWARD_ARC: f32 = 35.0 * DEGREE;
/// If velocity and heading differ by more than this, the character walks backwards, radians.
pub const BACK_ARC: f32 = 125.0 * DEGREE;
/// A side gait also covers directions within this angle of its own, radians.
pub const GAIT_ARC: f32 = 10.0 * DEGREE;

/// Weight of a radian between directions, relative to a doubling of speed, in blending.
pub const DIRECTION_SCALE: f32 = 2.0;
/// Weight of 1 rad/s of turning in blending.
pub const TURN_SCALE: f32 = 1.0;
/// Weight of a metre of height in blending.
pub const HEIGHT_SCALE: f32 = 4.0;
/// Gaits of different directions are blended over at most this angle, radians: legs that go
/// forwards and legs that go backwards cancel each other.
pub const BLEND_ARC: f32 = 60.0 * DEGREE;
/// Share of a gait at a speed below its own: this power of the ratio of speeds. At 0.5, side gaits
/// slide more; for forward gaits, 0 to 0.5 makes no difference.
pub const STRIDE_POWER: f32 = 0.2;
/// Rate of a gait at a speed other than its own: this power of the ratio of speeds, within
/// [`RATE_RANGE`]. At 0.6 the speed a second after a start is less exact; otherwise the two are
/// alike.
pub const RATE_POWER: f32 = 0.3;
/// Lowest and highest ratio of speeds that a gait's rate follows.
pub const RATE_RANGE: (f32, f32) = (0.25, 1.6);
/// A gait runs backwards if the cosine of the angle between its direction and the commanded one is
/// below this.
pub const REVERSE_COSINE: f32 = -0.5;

/// If velocity and heading differ by at least this angle, radians, a gap has [`SIDE_PARTS`].
pub const SIDE_ANGLE: f32 = 12.0 * DEGREE;
/// Equal parts of a gap of [`HORIZON_S`], with a pose between two, for forward gaits: one pose. The
/// target alone is about one period ahead and so almost the context's pose, from which some styles
/// would drift into another.
pub const FORWARD_PARTS: f32 = 2.0;
/// For gaits that go aside or backwards, which otherwise collapse into sliding.
pub const SIDE_PARTS: f32 = 5.0;

/// How far a plan is pulled towards the gait's own poses if it goes aside or backwards by captured
/// gaits, 0 to 1. The clips move more smoothly there than the networks do. At 0 twice as many gaits
/// accelerate 1.5 times as much as their clips (docs/live.md); at 0.5 feet slide more backwards.
pub const ASIDE_FOLLOWS: f32 = 0.35;

/// For gaits that the networks do not know. Their poses lead from key to key.
pub const BUILT_PARTS: f32 = 15.0;
/// A character whose joints are within this distance of such a gait's follows it at once, metres.
/// At twice the distance it takes [`FOLLOW_FRAMES`].
pub const FOLLOWS_M: f32 = 0.05;
/// See [`FOLLOWS_M`]; frames at 30 Hz.
pub const FOLLOW_FRAMES: f32 = 10.0;

/// A turn on the spot of more than this gets steps, radians, if the style has no gait for it.
pub const STEP_TURN: f32 = 25.0 * DEGREE;
/// Frames at 30 Hz from the command to where the first and the second foot are highest.
pub const STEP_FRAMES: [u64; 2] = [12, 22];
/// Fewest frames between such a pose and the context or target.
pub const STEP_MARGIN_FRAMES: usize = 3;

const DEGREE: f32 = std::f32::consts::PI / 180.0;
