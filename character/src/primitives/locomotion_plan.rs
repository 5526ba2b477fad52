//! What locomotion asks for: keyframes with a guide, or a path.

use troupe_motion::interpolate::smoothstep;
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::spring::critically_damped;
use troupe_motion::{GlobalRoot, LocalRoot, Quat, Vec3};

use super::super::blend::STYLE_FPS;
use super::super::follow::{self, Follow};
use super::super::path::run::Way;
use super::super::recipe::{
    ASIDE_FOLLOWS, BUILT_PARTS, CHANGE_RATIO, FORWARD_PARTS, GAMMA, HEADING_RATIO, HEIGHT_FADE_FRAMES,
    HEIGHT_RATIO, HORIZON_S, PATH_RATIO, SIDE_ANGLE, SIDE_PARTS, STILL, STOP_POSE, SWAY_FADE_FRAMES,
    TARGET_KEYS,
};
use super::super::{GapPose, Guide, PathGoal, PlanTargets, TargetKey};
use super::{NOW, Plan};
use crate::style::cycles::Moment;

/// A plan that follows its gait less is left to the networks.
const LEAST_FOLLOWED: f32 = 0.05;

impl Plan<'_> {
    /// Index of the segment's frame at the horizon.
    pub(super) fn last(&self) -> usize {
        NOW + (self.horizon_s * self.context.fps).round() as usize
    }

    /// Seconds from the last context frame to a frame of the segment.
    pub(super) fn seconds(&self, frame: usize) -> f32 {
        frame.saturating_sub(NOW) as f32 / self.context.fps
    }

    /// Heading (radians, not wrapped) and turn rate after `t` seconds.
    pub(super) fn facing(&self, t: f32) -> (f32, f32) {
        match &self.way {
            Some(way) => way.heading(t),
            None => self.turn.at(t),
        }
    }

    /// Phase of the blend at a frame of the segment, and its time at 30 Hz.
    fn phase_at(&self, frame: usize) -> (f32, u64) {
        let passed = self.seconds(frame) * STYLE_FPS;
        // Standing poses are those of the horizon throughout the plan.
        let time = self.frame + (self.horizon_s * STYLE_FPS) as u64;
        (self.phase + passed * self.blend.rate, time)
    }

    pub(super) fn moment(&self, frame: usize) -> Moment {
        let (phase, time) = self.phase_at(frame);
        self.blend.moment(phase, time)
    }

    /// r_g2 at a frame of the segment: the closed form of equation 6 for the position, or the ramp
    /// while the velocity changes.
    fn r_g2(&self, frame: usize) -> GlobalRoot {
        if frame <= NOW {
            return self.context.roots[frame];
        }
        let t = self.seconds(frame);
        let now = self.context.roots[NOW].position;
        let velocity = self.context.velocity.with_y(0.0);
        let position = match &self.way {
            Some(way) => way.position(t).with_y(self.moment(frame).height_m),
            None if self.changes => self.ramped(t).with_y(self.moment(frame).height_m),
            None => critically_damped(now, velocity, self.r_g1.position, GAMMA, t).0,
        };
        GlobalRoot::new(position, wrap_angle(self.facing(t).0))
    }

    /// Travel of the ramp after `t` seconds, starting from the character's own velocity over the
    /// context, metres.
    fn ramped(&self, t: f32) -> Vec3 {
        let [first, .., now] = self.context.roots.map(|root| root.position);
        let actual = (now - first).with_y(0.0) * (self.context.fps / NOW as f32);
        now + self.ramp.way_from(actual, t)
    }

    /// The guide at a frame of the segment. While the velocity changes, it follows the ramp.
    /// Otherwise it is a smooth curve from the character's position and velocity to the end of r_g2
    /// with the ramp's velocity there. Equation 6 itself runs ahead at first and then comes to
    /// rest, which suits a target but not a path. The guide's headings include the sway of the
    /// steps.
    fn guide_at(&self, frame: usize, end: GlobalRoot) -> GlobalRoot {
        if frame < NOW {
            return self.context.roots[frame];
        }
        let t = self.seconds(frame);
        let now = self.context.roots[NOW].position;
        let position = if let Some(way) = &self.way {
            way.position(t)
        } else if self.changes {
            self.ramped(t)
        } else if t <= self.horizon_s {
            let (from, to) = (self.context.velocity, self.ramp.velocity(self.horizon_s));
            hermite(now, from, end.position, to, self.horizon_s, t)
        } else {
            end.position + self.feasible.velocity * (t - self.horizon_s)
        };
        let moment = self.moment(frame);
        // Heights are the gait's, once the character's difference has faded.
        let off = now.y - self.moment(NOW).height_m;
        let height =
            moment.height_m + off * (1.0 - smoothstep((t * STYLE_FPS / HEIGHT_FADE_FRAMES).min(1.0)));
        let heading = self.facing(t).0 + moment.sway;
        GlobalRoot::new(position.with_y(height), wrap_angle(heading))
    }

    /// The blend's pose at a frame of the segment, in the world.
    fn pose(&self, frame: usize) -> (Vec<Quat>, Moment) {
        let mut rotations = vec![Quat::IDENTITY; self.context.skeleton.joint_count()];
        let (phase, time) = self.phase_at(frame);
        let moment = self.blend.sample(phase, time, &mut rotations);
        self.variation.hold(&mut rotations);
        rotations[0] = yaw(self.facing(self.seconds(frame)).0 + moment.sway) * rotations[0];
        (rotations, moment)
    }

    fn target(&self, frame: usize) -> TargetKey {
        let (rotations, moment) = self.pose(frame);
        let spring = self.r_g2(frame);
        let (heading, omega) = self.facing(self.seconds(frame));
        let sway = yaw(heading) * Vec3::new(moment.left_mps, 0.0, moment.forward_mps);
        let there = |way: &Way<'_>| way.velocity(self.seconds(frame));
        let ramped = self.ramp.velocity(self.seconds(frame));
        let velocity = self.way.as_ref().map_or(ramped, there) + sway;
        // The sway passes as fast as the gait runs.
        let hurry = self.blend.hurry();
        TargetKey {
            root: Some(GlobalRoot::new(
                spring.position.with_y(moment.height_m),
                wrap_angle(heading + moment.sway),
            )),
            velocity: Some(LocalRoot {
                vx: velocity.x,
                vz: velocity.z,
                omega: omega + moment.turn_rps * hurry,
                height: moment.height_m,
            }),
            rotations: Some(rotations),
            height_m: None,
        }
    }

    /// Whether the character stands already, and only goes on standing.
    fn stands(&self) -> bool {
        let turns = self.facing(self.horizon_s).0 - self.facing(0.0).0;
        self.context.velocity.with_y(0.0).length() < STILL.0 && turns.abs() < STILL.1
    }

    /// Poses in the gap. Standing clips are full of gestures, and the networks fill an empty stand
    /// with them. So a standing character has a pose half way, like a walking one. A character that
    /// stops has it late, because its feet must step freely until then. One that turns on the spot
    /// has its steps.
    fn gap_poses(&self) -> Vec<GapPose> {
        let halts = self.feasible.velocity == Vec3::ZERO;
        if halts && !self.stands() {
            return vec![self.gap_pose(STOP_POSE * self.horizon_s)];
        }
        let off = self.off();
        let parts = if halts || off < SIDE_ANGLE {
            FORWARD_PARTS
        } else if self.blend.built() > 0.5 {
            BUILT_PARTS
        } else {
            SIDE_PARTS
        };
        // A longer gap has more poses, about as far apart.
        let parts = (parts * self.horizon_s / HORIZON_S).round().max(parts);
        (1..parts as usize)
            .map(|nth| self.gap_pose(nth as f32 / parts * self.horizon_s))
            .collect()
    }

    /// Angle between travel and heading, radians to either side.
    fn off(&self) -> f32 {
        let local = yaw(-self.feasible.facing) * self.feasible.velocity;
        local.x.atan2(local.z).abs()
    }

    /// The blend's pose `ahead_s` seconds ahead.
    fn gap_pose(&self, ahead_s: f32) -> GapPose {
        let frame = NOW + (ahead_s * self.context.fps).round() as usize;
        let (rotations, moment) = self.pose(frame);
        GapPose {
            frame,
            rotations,
            height_m: moment.height_m,
        }
    }

    /// The gait's own poses, if the networks do not know them or move less smoothly than they do.
    fn follow(&self) -> Option<Follow> {
        let goes_aside = self.off() >= SIDE_ANGLE && self.feasible.velocity != Vec3::ZERO;
        let aside = if goes_aside { ASIDE_FOLLOWS } else { 0.0 };
        let share = self.blend.built().max(aside);
        if share < LEAST_FOLLOWED {
            return None;
        }
        let joints = self.context.skeleton.joint_count();
        let mut rotations = Vec::with_capacity(self.frames * joints);
        for frame in 0..self.frames {
            rotations.extend(self.pose(frame.max(NOW)).0);
        }
        let root = self.context.roots[NOW];
        let own = &self.context.rotations[NOW * joints..];
        let gait = &rotations[NOW * joints..(NOW + 1) * joints];
        let off_m = follow::apart_m(
            self.context.skeleton,
            (root.position.y, root.heading, own),
            (self.moment(NOW).height_m, self.facing(0.0).0, gait),
        );
        Some(Follow {
            weights: follow::weights(share, off_m, NOW, self.frames),
            rotations,
        })
    }

    /// The path for a body that is planned for by paths. Its headings lead from the character's to
    /// the spring's, because steps sway.
    fn path_goal(&self, words: &[(String, f32)]) -> PathGoal {
        let end = self.r_g2(self.last());
        let off = wrap_angle(self.context.roots[NOW].heading - self.facing(0.0).0);
        let root = |frame: usize| {
            if frame <= NOW {
                return self.context.roots[frame];
            }
            let root = self.guide_at(frame, end);
            let passed = (self.seconds(frame) * STYLE_FPS / SWAY_FADE_FRAMES).min(1.0);
            let heading = root.heading + off * (1.0 - smoothstep(passed));
            GlobalRoot::new(root.position, wrap_angle(heading))
        };
        PathGoal {
            roots: (0..self.frames).map(root).collect(),
            words: words.to_vec(),
        }
    }

    /// The targets of a plan by a path.
    fn by_path(&self, words: &[(String, f32)]) -> PlanTargets {
        let path = self.path_goal(words);
        PlanTargets {
            targets: Vec::new(),
            gap_poses: Vec::new(),
            frames: Some(self.frames),
            allowed_token_counts: Vec::new(),
            guide: None,
            follow: None,
            r_g1: self.r_g1,
            r_g2: path.roots.clone(),
            path: Some(path),
            unfinished: self.way.is_none() && self.turn.unfinished(),
            gaits: Vec::new(),
        }
    }

    pub(super) fn targets(&self, steps: Vec<GapPose>) -> PlanTargets {
        if let Some(words) = &self.style.words {
            return self.by_path(&words.weights);
        }
        let last = self.last();
        let end = self.r_g2(last);
        let given = self.style.allowed_token_counts.len() <= 1;
        let gap_poses = match steps.is_empty() {
            true => self.gap_poses(),
            false => steps,
        };
        PlanTargets {
            targets: (0..TARGET_KEYS)
                .map(|key| self.target(last + 1 + key - TARGET_KEYS))
                .collect(),
            gap_poses,
            frames: given.then_some(self.frames),
            allowed_token_counts: if given {
                Vec::new()
            } else {
                self.style.allowed_token_counts.clone()
            },
            guide: Some(Guide {
                path: (0..self.frames).map(|frame| self.guide_at(frame, end)).collect(),
                position_ratio: match self.way {
                    Some(_) => PATH_RATIO,
                    None if self.changes => CHANGE_RATIO.max(self.style.root_ratio),
                    None => self.style.root_ratio,
                },
                height_ratio: HEIGHT_RATIO,
                heading_ratio: HEADING_RATIO,
            }),
            follow: self.follow(),
            r_g1: self.r_g1,
            r_g2: (0..self.frames).map(|frame| self.r_g2(frame)).collect(),
            path: None,
            unfinished: self.way.is_none() && self.turn.unfinished(),
            gaits: self.blend.named(),
        }
    }
}

/// The cubic curve at `t` from `a` with velocity `va` to `b` with velocity `vb`, `length_s` later.
fn hermite(a: Vec3, va: Vec3, b: Vec3, vb: Vec3, length_s: f32, t: f32) -> Vec3 {
    let u = t / length_s;
    let (u2, u3) = (u * u, u * u * u);
    a * (2.0 * u3 - 3.0 * u2 + 1.0)
        + va * (length_s * (u3 - 2.0 * u2 + u))
        + b * (3.0 * u2 - 2.0 * u3)
        + vb * (length_s * (u3 - u2))
}
