//! The numbers of smart locomotion, in one place.
//!
//! They were found by running the whole loop (commands, plans, cross-fades) on the default pack
//! over forty scenarios and comparing speed, heading, foot skate, joint acceleration and likeness
//! to the source clips. What each is against is said where it matters.

/// Seconds ahead at which targets lie (paper section 6.1).
pub const HORIZON_S: f32 = 1.0;
/// Target keyframes at a segment's end, 1 to 4. Two gained nothing.
pub const TARGET_KEYS: usize = 1;
/// Damping γ of equation 6 for the position, 1/s. 4 leaves the speed 8 % short; 6 and 8 are alike.
pub const GAMMA: f32 = 8.0;
/// The same for the heading, which follows a goal that turns at a steady rate.
pub const TURN_GAMMA: f32 = 12.0;
/// Seconds in which that goal comes to a target that is near enough.
pub const TURN_S: f32 = 0.35;
/// Most that a heading turns, rad/s: 1.5 times the rate that 95 in 100 of the clips of turns stay
/// below, over 8 frames. With 1.3 times an about-turn is 16° short after a second, with 1.2 times
/// 24°.
pub const MOST_TURN_RPS: f32 = 5.5;
/// Acceleration by which the velocity changes, m/s².
pub const ACCELERATION_MPS2: f32 = 4.0;
/// Seconds that a change of the velocity takes at most: one that would take longer is accelerated
/// more.
pub const CHANGE_S: f32 = 0.8;
/// A change of the velocity that is smaller is none, m/s.
pub const LEAST_CHANGE_MPS: f32 = 0.1;
/// How closely the root follows the ramp while the velocity changes. Left to itself the root stage
/// goes at half of the new velocity in the first frame already.
pub const CHANGE_RATIO: f32 = 1.0;
/// The velocity's ramp starts again from the character where it is farther from it than this, m/s,
/// and than what the character may have gained in [`VELOCITY_LAG_S`].
pub const RESYNC_MPS: f32 = 1.2;
/// Frames at 30 Hz over which the root's velocity at a plan's start is measured: enough to take the
/// sway of a step out.
pub const VELOCITY_FRAMES: usize = 10;
/// Seconds by which that velocity lags behind. Without regard to it a run that is turned about
/// starts again at every plan.
pub const VELOCITY_LAG_S: f32 = 0.5 * VELOCITY_FRAMES as f32 / 30.0;
/// How closely headings follow the spring: wholly. The root stage's own headings start every plan's
/// turn again, so that a turn of 90° is 29° short after a second; with the spring's it is 1°.
pub const HEADING_RATIO: f32 = 1.0;
/// How closely heights follow those of the style's gait. The root stage is 1 to 3 cm off in styles
/// with little data, so that swinging feet pass too near the ground.
pub const HEIGHT_RATIO: f32 = 1.0;
/// Frames at 30 Hz over which a plan's heights go from the character's to the gait's.
pub const HEIGHT_FADE_FRAMES: f32 = 10.0;
/// Most that a plan's headings may be ahead of the character's, radians. A turn of 180° is made in
/// two plans.
pub const MAX_TURN: f32 = 100.0 * DEGREE;
/// The heading spring starts again from the character where it is farther from it than this,
/// radians.
pub const RESYNC_TURN: f32 = 120.0 * DEGREE;

/// Frames at 30 Hz of a plan that is asked for by a path, context included: whole tokens.
pub const PATH_PLAN_FRAMES: usize = 36;
/// Frames at 30 Hz over which the headings of such a path come from the character's, which sways,
/// to the spring's.
pub const SWAY_FADE_FRAMES: f32 = 10.0;
/// How closely the root follows a path that was commanded, where the session does not say.
pub const PATH_RATIO: f32 = 1.0;

/// A command slower than this stands, m/s.
pub const STANDING_MPS: f32 = 0.05;
/// A character that is slower than the first (m/s) and turns by less than the second (radians)
/// stands, if it is to.
pub const STILL: (f32, f32) = (0.12, 0.15);
/// Share of the way to its target at which one who comes to a stop has a pose.
pub const STOP_POSE: f32 = 0.8;
/// Below this speed (m/s) a gait fades into standing, so that no speed has a jump.
pub const STARTING_MPS: f32 = 0.15;
/// Seconds of standing after which the root is held where it is: without, it drifts by 1 to 16 cm a
/// minute.
pub const ANCHOR_AFTER_S: f32 = 1.0;
/// Frames at 30 Hz for which one of several standing poses is kept.
pub const STAND_FRAMES: u64 = 45;

/// Speeds that a style is trusted with, against its fastest gait in a direction.
pub const SPEED_MARGIN: f32 = 1.1;
/// Walking pace of a body that goes aside or backwards without a gait for it, m/s, where the style
/// has nothing slower.
pub const OFF_AXIS_PACE_MPS: f32 = 1.3;
/// A gait's speed beyond that pace holds up to the first angle from its direction and is gone at
/// the second, radians.
pub const FAST_ARC: (f32, f32) = (15.0 * DEGREE, 35.0 * DEGREE);
/// Facing is turned towards the velocity until that is no farther off than this, radians, where the
/// style has no gait that goes farther aside: pure side steps are not in the data, and the legs
/// would slide.
pub const FORWARD_ARC: f32 = 35.0 * DEGREE;
/// Beyond this angle between velocity and facing the character walks backwards, radians.
pub const BACK_ARC: f32 = 125.0 * DEGREE;
/// Room about a side gait's own direction, radians.
pub const GAIT_ARC: f32 = 10.0 * DEGREE;

/// Weight of a radian between directions against a doubling of speed in blending.
pub const DIRECTION_SCALE: f32 = 2.0;
/// Weight of 1 rad/s of turning in blending.
pub const TURN_SCALE: f32 = 1.0;
/// Weight of a metre of height in blending.
pub const HEIGHT_SCALE: f32 = 4.0;
/// Gaits of different directions are blended over this angle at most, radians: legs that go
/// forwards and legs that go backwards cancel each other.
pub const BLEND_ARC: f32 = 60.0 * DEGREE;
/// How much of a gait is left at a speed below its own: the power of the speeds' ratio. At 0.5,
/// gaits that go aside slide more; forwards nothing between 0 and 0.5 makes a difference.
pub const STRIDE_POWER: f32 = 0.2;
/// How fast a gait runs at a speed other than its own: the power of the speeds' ratio, which is
/// kept within [`RATE_RANGE`]. At 0.6 a second after a start the speed is farther off, else the two
/// are alike.
pub const RATE_POWER: f32 = 0.3;
/// Ratios of speeds that a gait's rate follows.
pub const RATE_RANGE: (f32, f32) = (0.25, 1.6);
/// A gait runs backwards where the cosine of the angle between its direction and the commanded one
/// is below this.
pub const REVERSE_COSINE: f32 = -0.5;

/// From this angle between velocity and facing on, a gap has [`SIDE_PARTS`], radians.
pub const SIDE_ANGLE: f32 = 12.0 * DEGREE;
/// Equal parts of a gap of [`HORIZON_S`], with a pose between two: one pose for gaits that go
/// forwards. The target alone is about one period ahead, so nearly the pose of the context, and
/// some styles would drift into another.
pub const FORWARD_PARTS: f32 = 2.0;
/// For gaits that go aside or backwards: without, they collapse into sliding.
pub const SIDE_PARTS: f32 = 5.0;

/// For gaits that the networks do not know. They go from key to key.
pub const BUILT_PARTS: f32 = 15.0;
/// A character whose joints are nearer than this to such a gait's follows it at once, one that is
/// twice as far off in so many frames at 30 Hz.
pub const FOLLOWS_M: f32 = 0.05;
/// See [`FOLLOWS_M`].
pub const FOLLOW_FRAMES: f32 = 10.0;

/// A turn on the spot of more than this gets steps, radians, where the style has no gait that turns
/// on the spot.
pub const STEP_TURN: f32 = 25.0 * DEGREE;
/// Frames at 30 Hz after the command at which the first and the second foot are highest.
pub const STEP_FRAMES: [u64; 2] = [12, 22];
/// Least frames between such a pose and the context or target.
pub const STEP_MARGIN_FRAMES: usize = 3;

const DEGREE: f32 = std::f32::consts::PI / 180.0;
