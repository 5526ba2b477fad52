//! Falling: the path of a projectile, and the motion of a character on it until it stands again.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::ik::{Leg, Motion, Posed, Trunk, arms, forward, place_end, turn_limb, two_bone};
use crate::interpolate::{min_jerk, smoothstep};
use crate::root::heading_of;
use crate::rotation::{slerp, yaw};
use crate::skeleton::Skeleton;

/// Acceleration of free fall, m/s².
pub const GRAVITY_MPS2: f32 = 9.81;
/// Longest fall, seconds: 2 km.
pub const MAX_FALL_S: f32 = 20.0;
/// Highest frame rate of a fall, Hz.
const MAX_FPS: f32 = 240.0;

/// A point that flies through the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Throw {
    /// Where it starts, metres.
    pub position: Vec3,
    /// Velocity at the start, m/s.
    pub velocity: Vec3,
}

/// The end of a throw on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// Time from the start, seconds.
    pub seconds: f32,
    /// Place on the ground, metres.
    pub place: Vec3,
    /// Velocity on arrival, m/s.
    pub velocity: Vec3,
}

impl Throw {
    /// Place after `s` seconds, metres.
    pub fn at(&self, s: f32) -> Vec3 {
        self.position + self.velocity * s - Vec3::Y * (0.5 * GRAVITY_MPS2 * s * s)
    }

    /// Velocity after `s` seconds, m/s.
    pub fn velocity_at(&self, s: f32) -> Vec3 {
        self.velocity - Vec3::Y * (GRAVITY_MPS2 * s)
    }

    /// Time at which it passes `height` on its way down, seconds; negative if that was before the
    /// start. `None` above its summit.
    fn falls_to(&self, height: f32) -> Option<f32> {
        let up = self.velocity.y;
        let root = up * up + 2.0 * GRAVITY_MPS2 * (self.position.y - height);
        (root >= 0.0).then(|| (up + root.sqrt()) / GRAVITY_MPS2)
    }

    /// Where it meets the ground.
    ///
    /// `ground` is called once for each frame (`fps`) of the way down, with the point's place in
    /// the frame before and in this one. It returns the height of the ground that lies in between,
    /// if any. `None` if the point meets nothing within `max_s` seconds, or [`MAX_FALL_S`] if that
    /// is less, or if a value is not finite.
    pub fn lands(
        &self,
        fps: f32,
        max_s: f32,
        mut ground: impl FnMut(Vec3, Vec3) -> Option<f32>,
    ) -> Option<Landing> {
        if !usable_rate(fps) || !self.position.is_finite() || !self.velocity.is_finite() {
            return None;
        }
        let steps = (max_s.clamp(0.0, MAX_FALL_S) * fps).ceil() as usize;
        let mut before = self.position;
        for step in 1..=steps {
            let [start, end] = [step - 1, step].map(|step| step as f32 / fps);
            let now = self.at(end);
            if now.y < before.y
                && let Some(height) = ground(before, now).filter(|height| height.is_finite())
            {
                let seconds = self.falls_to(height).unwrap_or(start).max(start).min(end);
                let place = self.at(seconds);
                return Some(Landing {
                    seconds,
                    place: Vec3::new(place.x, height, place.z),
                    velocity: self.velocity_at(seconds),
                });
            }
            before = now;
        }
        None
    }
}

fn usable_rate(fps: f32) -> bool {
    fps > 0.0 && fps <= MAX_FPS
}

/// The conditions of a fall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drop<'a> {
    /// Velocity at the start, m/s.
    pub velocity: Vec3,
    /// World height of the ground on which it ends, metres.
    pub floor_m: f32,
    /// Time at which travel over the ground must have ended, in front of a wall, seconds. None
    /// without a wall.
    pub wall_s: Option<f32>,
    /// The standing pose at the end. `root.y` is its height over the ground; place and heading do
    /// not count.
    pub standing: Posed<'a>,
    /// Poses of the frames after the start as they would be without the fall: joints keep moving
    /// while the fall fades in. The last pose repeats. Empty: joints stop at once.
    pub under_way: &'a [Quat],
    /// The pose in the air. `None`: `standing` with raised arms and slightly drawn-up legs.
    pub air: Option<&'a [Quat]>,
    /// Frame rate, Hz.
    pub fps: f32,
}

/// A fall from its start to standing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fall {
    /// Frames after the start. Empty if the fall cannot be made.
    pub motion: Motion,
    /// Index of the first frame with the feet on the ground.
    pub touch_down: usize,
    /// Index of the frame with the lowest root.
    pub lowest: usize,
    /// Downward speed at touch-down, m/s.
    pub impact_mps: f32,
    /// Depth of the lowest root below standing, metres.
    pub depth_m: f32,
}

/// Depth of the root below standing, metres, for a character with legs of `leg_m` metres that lands
/// at `impact_mps`. It grows with the speed, up to 0.45 of the legs.
pub fn landing_depth(impact_mps: f32, leg_m: f32) -> f32 {
    (0.04 + 0.05 * impact_mps.max(0.0)).min(0.45 * leg_m.max(0.0))
}

/// Feet touch the ground when the root is this far above its standing height, as a share of the
/// legs: straight legs could not reach ahead.
const GIVE_SHARE: f32 = 0.04;
/// Shortest and longest time for braking the travel over the ground, seconds.
const BRAKE_S: (f32, f32) = (0.1, 0.35);
/// Shortest time for braking anything, seconds: practically at once.
const SHORTEST_S: f32 = 1e-3;
/// Time for the pose to change to the pose in the air, and for the legs to change to the landing,
/// seconds.
const INTO_AIR_S: f32 = 0.27;
const LEGS_OUT_S: f32 = 0.2;
/// Time for the pose to change to the crouch, before and after touch-down, seconds.
const CROUCH_S: (f32, f32) = (0.1, 0.25);
/// Bow of the deepest crouch, radians, and depth at which it is reached, metres.
const CROUCH_BOW: f32 = 0.9;
const FULL_BOW_DEPTH_M: f32 = 0.34;
/// A slower landing is not braked, m/s.
const SOFT_MPS: f32 = 0.1;
/// Pose in the air: angle of the raised arms, radians, and shares of the legs by which feet move up
/// and forward.
const ARMS_UP: f32 = 0.6;
const FEET_UP_SHARE: f32 = 0.10;
const FEET_AHEAD_SHARE: f32 = 0.05;

/// Makes a character fall from a pose and stand up again.
///
/// The root flies as a [`Throw`] until the legs meet the ground. It is braked evenly within
/// [`landing_depth`], and rises again on the path of least jerk. Travel over the ground is braked
/// too: feet are set down ahead as far as the legs reach. If a wall ends the travel, it is braked
/// in the air. From touch-down on the feet stand. The last frame is exactly `standing` over its
/// feet, with the heading of `from`. A character that starts at or below the height of touch-down
/// sets its feet down within 0.2 s.
///
/// There are no frames if a pose lacks rotations, a value is not finite, `fps` is not in (0, 240],
/// or the way down takes longer than [`MAX_FALL_S`].
pub fn fall_motion(skeleton: &Skeleton, legs: &[Leg], from: Posed<'_>, drop: &Drop<'_>) -> Fall {
    let joints = skeleton.joint_count();
    let air_fits = drop
        .air
        .is_none_or(|air| air.len() >= joints && air.iter().all(|q| q.is_finite()));
    let goes_on = drop.under_way.len().is_multiple_of(joints) && drop.under_way.iter().all(|q| q.is_finite());
    let fits = from.fits(skeleton) && drop.standing.fits(skeleton) && air_fits && goes_on;
    let finite = from.is_finite()
        && drop.standing.is_finite()
        && drop.velocity.is_finite()
        && drop.floor_m.is_finite()
        && drop
            .wall_s
            .is_none_or(|wall_s| wall_s >= 0.0 && wall_s.is_finite());
    if !fits || !finite || !usable_rate(drop.fps) {
        return Fall::default();
    }
    match Course::new(skeleton, legs, from, drop) {
        Some(course) => Faller::new(skeleton, legs, from, drop, course).fall(),
        None => Fall::default(),
    }
}

/// The course of the root.
#[derive(Clone, Copy, Debug)]
struct Course {
    throw: Throw,
    /// Height of the root at rest, metres.
    stand: f32,
    /// Lowest height of the root, metres.
    bottom: f32,
    /// Height and time of touch-down, and the root's downward speed then.
    touch: f32,
    touch_s: f32,
    impact: f32,
    /// Duration of the braking of the way down, seconds.
    brake_s: f32,
    /// When travel over the ground begins to be braked, and for how long, seconds.
    slides_s: f32,
    slide_s: f32,
    recover_s: f32,
}

impl Course {
    fn new(skeleton: &Skeleton, legs: &[Leg], from: Posed<'_>, drop: &Drop<'_>) -> Option<Self> {
        let throw = Throw {
            position: from.root,
            velocity: drop.velocity,
        };
        let stand = drop.floor_m + drop.standing.root.y;
        let leg_m = legs
            .iter()
            .map(|leg| leg.length_m(skeleton))
            .fold(f32::INFINITY, f32::min);
        let leg_m = if leg_m.is_finite() { leg_m } else { 0.0 };
        let give = GIVE_SHARE * leg_m;
        let touch_s = throw.falls_to(stand - give).unwrap_or(0.0).max(0.0);
        if touch_s > MAX_FALL_S {
            return None;
        }
        let touch = throw.at(touch_s).y;
        let impact = (-throw.velocity_at(touch_s).y).max(0.0);
        let soft = impact < SOFT_MPS;
        let bottom = match soft {
            true => touch,
            false => (stand - landing_depth(impact, leg_m)).min(touch - 0.01),
        };
        let over_ground = Vec3::new(drop.velocity.x, 0.0, drop.velocity.z).length();
        let lead = lead(skeleton, legs, drop.standing, stand - touch);
        let height = impact * impact / (2.0 * GRAVITY_MPS2);
        let mut slide_s = (2.0 * lead / over_ground.max(1e-3)).clamp(BRAKE_S.0, BRAKE_S.1);
        let mut slides_s = touch_s;
        if let Some(wall_s) = drop.wall_s {
            // Even braking takes twice the time.
            slide_s = slide_s.min(2.0 * wall_s).max(SHORTEST_S);
            slides_s = touch_s.min(wall_s - 0.5 * slide_s).max(0.0);
        }
        Some(Self {
            throw,
            stand,
            bottom,
            touch,
            touch_s,
            impact,
            brake_s: if soft {
                0.0
            } else {
                2.0 * (touch - bottom) / impact
            },
            slides_s,
            slide_s,
            recover_s: 0.8 + 0.4 * height.min(1.0),
        })
    }

    fn end_s(&self) -> f32 {
        self.touch_s + self.brake_s.max(self.slide_s) + self.recover_s
    }

    fn root(&self, s: f32) -> Vec3 {
        let slid = (s - self.slides_s).clamp(0.0, self.slide_s);
        let way = s.min(self.slides_s) + slid - slid * slid / (2.0 * self.slide_s);
        let mut root = self.throw.position + self.throw.velocity * way;
        let since = s - self.touch_s;
        root.y = if since <= 0.0 {
            self.throw.at(s).y
        } else if since < self.brake_s {
            self.touch - self.impact * since * (1.0 - 0.5 * since / self.brake_s)
        } else {
            let up = min_jerk((since - self.brake_s) / self.recover_s);
            self.bottom + (self.stand - self.bottom) * up
        };
        root
    }
}

/// How far ahead of the hips feet can be set down if the root is `lower` than in `standing`,
/// metres.
fn lead(skeleton: &Skeleton, legs: &[Leg], standing: Posed<'_>, lower: f32) -> f32 {
    let place = |joint: usize| joint_transform(skeleton, standing.root, standing.rotations, joint).0;
    let lead = legs.iter().map(|leg| {
        let leg_m = leg.length_m(skeleton) * 0.9985;
        let over = place(leg.upper) - place(leg.foot);
        let height = over.y - lower;
        let aside = Vec3::new(over.x, 0.0, over.z).length();
        (leg_m * leg_m - height * height).max(0.0).sqrt() - aside
    });
    lead.fold(f32::INFINITY, f32::min).clamp(0.0, 1.0)
}

/// The character on its course.
struct Faller<'a> {
    skeleton: &'a Skeleton,
    legs: &'a [Leg],
    from: Posed<'a>,
    under_way: &'a [Quat],
    fps: f32,
    course: Course,
    standing: Vec<Quat>,
    air: Vec<Quat>,
    trunk: Trunk,
    /// Place and rotation of each foot after the landing.
    feet: Vec<(Vec3, Quat)>,
}

impl<'a> Faller<'a> {
    fn new(
        skeleton: &'a Skeleton,
        legs: &'a [Leg],
        from: Posed<'a>,
        drop: &Drop<'a>,
        course: Course,
    ) -> Self {
        let joints = skeleton.joint_count();
        let turn = |pose: &[Quat]| {
            let heading = |pose: &[Quat]| heading_of(pose[0], skeleton.left_axis);
            let mut turned = pose[..joints].to_vec();
            turned[0] = (yaw(heading(from.rotations) - heading(pose)) * turned[0]).normalize();
            turned
        };
        let standing = turn(drop.standing.rotations);
        let air = match drop.air {
            Some(air) => turn(air),
            None => air_pose(skeleton, legs, &standing),
        };
        let end = course.root(course.end_s());
        let feet = legs
            .iter()
            .map(|leg| joint_transform(skeleton, end, &standing, leg.foot))
            .collect();
        Self {
            skeleton,
            legs,
            from,
            under_way: drop.under_way,
            fps: drop.fps,
            course,
            standing,
            air,
            trunk: Trunk::of(skeleton),
            feet,
        }
    }

    fn fall(&self) -> Fall {
        let (joints, course) = (self.skeleton.joint_count(), &self.course);
        let count = ((course.end_s() * self.fps).ceil() as usize).max(1);
        // Frames count from 1: frame 0 is the start. However near the ground is, legs take their
        // time.
        let touch_s = course.touch_s.max(LEGS_OUT_S);
        let touch = ((touch_s * self.fps).ceil() as usize).clamp(1, count);
        let mut fall = Fall {
            motion: Motion::with_capacity(count, joints),
            touch_down: touch - 1,
            impact_mps: course.impact,
            depth_m: course.stand - course.bottom,
            ..Fall::default()
        };
        let mut landing = vec![Quat::IDENTITY; joints];
        self.landed(touch_s, &mut landing, &mut 0.0);
        let down = self.legs.iter().fold(0, |bits, leg| bits | leg.contact_bits());
        let mut pose = landing.clone();
        for frame in 1..=count {
            let s = frame as f32 / self.fps;
            let root = course.root(s);
            let contacts = if frame < touch {
                self.flying(s, touch_s, &landing, &mut pose);
                0
            } else {
                self.landed(s, &mut pose, &mut fall.motion.short_m);
                down
            };
            let (root, pose) = match frame == count {
                true => (course.root(course.end_s()), &self.standing),
                false => (root, &pose),
            };
            fall.motion
                .push(root, pose, contacts, &self.from.rotations[..joints]);
        }
        let height = |frame: &usize| fall.motion.roots[*frame].y;
        let landed = fall.touch_down..count;
        fall.lowest = landed
            .min_by(|a, b| height(a).total_cmp(&height(b)))
            .unwrap_or_default();
        fall
    }

    /// The pose of a frame in the air. It changes to the pose in the air, near the end to the
    /// landing, and stays above the ground.
    fn flying(&self, s: f32, touch_s: f32, landing: &[Quat], pose: &mut [Quat]) {
        self.body(s, pose);
        let weight = smoothstep(1.0 - ((touch_s - s) / LEGS_OUT_S).clamp(0.0, 1.0));
        for (made, &landing) in pose.iter_mut().zip(landing) {
            *made = slerp(*made, landing, weight);
        }
        let root = self.course.root(s);
        for (leg, &(on_ground, _)) in self.legs.iter().zip(&self.feet) {
            let foot = joint_transform(self.skeleton, root, pose, leg.foot).0;
            if foot.y < on_ground.y {
                let goal = Vec3::new(foot.x, on_ground.y, foot.z);
                two_bone(
                    self.skeleton,
                    root,
                    pose,
                    leg.chain(),
                    goal,
                    forward(self.skeleton, pose),
                    true,
                );
            }
        }
    }

    /// The pose of a frame with the feet on the ground.
    fn landed(&self, s: f32, pose: &mut [Quat], short_m: &mut f32) {
        self.body(s, pose);
        let root = self.course.root(s);
        let pole = forward(self.skeleton, pose);
        for (leg, &(place, rotation)) in self.legs.iter().zip(&self.feet) {
            let short = place_end(
                self.skeleton,
                root,
                pose,
                leg.chain(),
                (place, 0.0),
                pole,
                rotation,
            );
            *short_m = short_m.max(short);
        }
    }

    /// The pose without the fall.
    fn goes_on(&self, s: f32) -> &[Quat] {
        let mut poses = self.under_way.chunks_exact(self.skeleton.joint_count());
        let nth = (s * self.fps).round() as usize;
        match nth
            .min(poses.len())
            .checked_sub(1)
            .and_then(|last| poses.nth(last))
        {
            Some(pose) => pose,
            None => self.from.rotations,
        }
    }

    /// The pose of a frame without its legs.
    fn body(&self, s: f32, pose: &mut [Quat]) {
        let course = &self.course;
        let ramp = |from: f32, to: f32| smoothstep(((s - from) / (to - from).max(1e-3)).clamp(0.0, 1.0));
        let touch = course.touch_s;
        let crouch_end = touch + CROUCH_S.1.max(course.brake_s);
        let into_air = ramp(0.0, INTO_AIR_S);
        let into_stand = ramp((touch - CROUCH_S.0).max(0.0), crouch_end);
        let from = self.goes_on(s);
        for (joint, made) in pose.iter_mut().enumerate() {
            let flying = slerp(from[joint], self.air[joint], into_air);
            *made = slerp(flying, self.standing[joint], into_stand);
        }
        let depth = (course.stand - course.bottom) / FULL_BOW_DEPTH_M;
        let down = ramp(touch, crouch_end) - min_jerk((s - crouch_end) / (course.end_s() - crouch_end));
        let angle = CROUCH_BOW * depth.min(1.0) * down.max(0.0);
        self.trunk.bow(self.skeleton, pose, angle);
    }
}

/// `standing` with arms raised to the sides and feet slightly drawn up.
fn air_pose(skeleton: &Skeleton, legs: &[Leg], standing: &[Quat]) -> Vec<Quat> {
    let forward = forward(skeleton, standing);
    let left = Vec3::Y.cross(forward);
    let mut pose = standing.to_vec();
    for leg in legs {
        let length = leg.length_m(skeleton);
        let foot = joint_transform(skeleton, Vec3::ZERO, standing, leg.foot).0;
        let goal = foot + (Vec3::Y * FEET_UP_SHARE + forward * FEET_AHEAD_SHARE) * length;
        two_bone(skeleton, Vec3::ZERO, &mut pose, leg.chain(), goal, forward, true);
    }
    for arm in arms(skeleton) {
        let [upper, _, end] = arm;
        let [shoulder, hand] =
            [upper, end].map(|joint| joint_transform(skeleton, Vec3::ZERO, standing, joint));
        let down = hand.0 - shoulder.0;
        if down.y < 0.0 {
            // A positive turn about the forward axis raises the left arm, on the side that `left`
            // points to.
            let side = if shoulder.0.dot(left) < 0.0 { -1.0 } else { 1.0 };
            let turn = Quat::from_axis_angle(forward, ARMS_UP * side);
            turn_limb(skeleton, &mut pose, arm, turn);
        }
    }
    pose
}

#[cfg(test)]
mod tests;
