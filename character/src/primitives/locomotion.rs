//! Smart locomotion (paper section 6.1 and table 1): from a command to target keyframes.
//!
//! * r_g1, naive: the root that the commanded velocity and heading would have after a second.
//! * r_g2, spring: the root on equation 6's way to it, which is where targets are placed. Its position starts from the
//!   character at every plan, its heading from a spring that goes on from command to command ([`super::heading`]).
//! * r_g3 and r_g4 are the networks'; headings of r_g3 follow the [`Guide`].
//!
//! Target poses come from the blendspace ([`super::blend`]) at the phase that the character's step will have reached. What
//! the style cannot do is brought to the nearest that it can ([`super::reach`]) before any of this.

use serde::{Deserialize, Serialize};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::spring::critically_damped;
use troupe_motion::{GlobalRoot, LocalRoot, Quat, Vec3};

use super::blend::{Blend, STYLE_FPS, Wanted};
use super::heading::{HeadingSpring, Turn};
use super::matching::Matcher;
use super::reach::{self, Feasible};
use super::recipe::{
    ANCHOR_AFTER_S, FORWARD_PARTS, GAMMA, HEADING_RATIO, HEIGHT_FADE_FRAMES, HEIGHT_RATIO, HORIZON_S,
    SIDE_ANGLE, SIDE_PARTS, STANDING_MPS, STEP_FRAMES, STEP_MARGIN_FRAMES, STEP_TURN, STILL, STOP_POSE,
    TARGET_KEYS,
};
use super::{CONTEXT_FRAMES, GapPose, Guide, LocomotionCommand, PlanContext, PlanTargets, TargetKey};
use crate::style::cycles::Moment;
use crate::style::{STANDING_GAIT_MPS, Style};

/// The context's last frame, from which time counts.
const NOW: usize = CONTEXT_FRAMES - 1;

/// The locomotion primitive's state.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Locomotion {
    command: LocomotionCommand,
    feasible: Feasible,
    heading: HeadingSpring,
    /// The frame of the newest command.
    commanded_at: u64,
    /// The turn that it asked for, radians.
    turn: f32,
    stand: Option<Standing>,
    #[serde(skip)]
    matcher: Matcher,
    /// Frames a second of the timeline.
    fps: f32,
}

/// A character that is to stand.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Standing {
    /// The frame since which it is.
    since: u64,
    /// Where its root is held.
    anchor: Option<Vec3>,
}

/// What a plan is made of, worked out step by step.
struct Plan<'a> {
    context: &'a PlanContext<'a>,
    style: &'a Style,
    feasible: Feasible,
    turn: Turn,
    blend: Blend<'a>,
    /// Frames of the segment, or the most that it may have.
    frames: usize,
    /// Seconds from the last context frame to r_g1.
    horizon_s: f32,
    /// Phase at the last context frame, cycles.
    phase: f32,
    /// Time of the last context frame, frames at 30 Hz.
    frame: u64,
    r_g1: GlobalRoot,
}

impl Locomotion {
    /// A character that faces `heading` (radians) at timeline frame `frame` and moves as `command` says from there on.
    /// `fps`: frames a second of the timeline.
    pub fn new(frame: u64, heading: f32, fps: f32, command: LocomotionCommand) -> Self {
        let mut locomotion = Self {
            feasible: Feasible {
                velocity: Vec3::ZERO,
                facing: heading,
            },
            heading: HeadingSpring::new(frame, heading),
            commanded_at: frame,
            turn: 0.0,
            stand: None,
            matcher: Matcher::default(),
            fps,
            command,
        };
        locomotion.take_up(frame);
        locomotion
    }

    /// The current command.
    pub fn command(&self) -> &LocomotionCommand {
        &self.command
    }

    /// Takes a new command from timeline frame `frame` on.
    pub fn set_command(&mut self, frame: u64, command: LocomotionCommand) {
        self.command = command;
        self.take_up(frame);
    }

    /// Has a character that stands do so at `place` over the ground, rather than where it comes to rest.
    pub fn stand_at(&mut self, place: Vec3) {
        if let Some(standing) = &mut self.stand {
            standing.anchor = Some(place);
        }
    }

    fn take_up(&mut self, frame: u64) {
        let LocomotionCommand {
            velocity,
            facing,
            style,
            ..
        } = &self.command;
        let moves = velocity.with_y(0.0).length() >= STANDING_MPS;
        let target = facing.or_else(|| moves.then(|| velocity.x.atan2(velocity.z)));
        let only = only_gait(&self.command);
        self.feasible = reach::nearest(style, only, *velocity, target.unwrap_or(0.0));
        // A style that cannot move at all still turns to where it should go.
        self.heading
            .turn_to(frame, self.fps, target.map(|_| self.feasible.facing));
        self.turn = self.heading.remaining(frame, self.fps);
        self.commanded_at = frame;
        self.stand = match self.stand {
            _ if self.feasible.velocity != Vec3::ZERO => None,
            Some(standing) => Some(standing),
            None => Some(Standing {
                since: frame,
                anchor: None,
            }),
        };
    }

    /// Keyframe constraints for the plan that starts at `context`.
    ///
    /// # Panics
    /// If the context's rotations are not four poses of its skeleton.
    pub fn plan(&mut self, context: &PlanContext<'_>) -> PlanTargets {
        let now = context.roots[NOW];
        let turn = self.heading.turn(context.frame, context.fps, now.heading);
        let anchor = self.anchor(context);
        let style = &*self.command.style;
        let (frames, horizon_s) = length(style, context);
        let turned = turn.at(horizon_s).0 - turn.at(0.0).0;
        let local = yaw(-self.feasible.facing) * self.feasible.velocity;
        let wanted = Wanted {
            left_mps: local.x,
            forward_mps: local.z,
            turn_rps: turned / horizon_s,
            height_m: self.command.height_m,
        };
        let cycles = style.cycles(context.skeleton);
        let blend = Blend::new(style, cycles, only_gait(&self.command), &wanted);
        let frame = (context.frame as f64 * f64::from(STYLE_FPS / context.fps)) as u64;
        let phase = if blend.rate == 0.0 {
            0.0
        } else {
            self.matcher.nearest(&blend, context, frame)
        };
        let r_g1 = GlobalRoot::new(
            anchor.unwrap_or(now.position + self.feasible.velocity * horizon_s),
            self.feasible_heading(&turn),
        );
        let mut plan = Plan {
            context,
            style,
            feasible: self.feasible,
            turn,
            blend,
            frames,
            horizon_s,
            phase,
            frame,
            r_g1,
        };
        let height_m = plan.moment(plan.last()).height_m;
        plan.r_g1.position.y = height_m;
        let steps = self.steps(&plan);
        plan.targets(steps)
    }

    /// The commanded heading; where none is, the one that the character comes to rest at.
    fn feasible_heading(&self, turn: &Turn) -> f32 {
        let at_rest = turn.at(10.0 * HORIZON_S).0;
        match self.command.facing {
            None if self.stand.is_some() => wrap_angle(at_rest),
            _ => self.feasible.facing,
        }
    }

    /// Where a character that has stood for a while is held.
    fn anchor(&mut self, context: &PlanContext<'_>) -> Option<Vec3> {
        let standing = self.stand.as_mut()?;
        let stood_s = context.frame.saturating_sub(standing.since) as f32 / context.fps;
        if standing.anchor.is_none() && stood_s >= ANCHOR_AFTER_S {
            standing.anchor = Some(context.roots[NOW].position);
        }
        standing.anchor
    }

    /// Poses with a foot up, for a turn on the spot by a style without a gait for that.
    fn steps(&self, plan: &Plan<'_>) -> Vec<GapPose> {
        let turns = |style: &Style| {
            style
                .gaits
                .iter()
                .any(|g| g.speed_mps() < STANDING_GAIT_MPS && !g.stands())
        };
        let cycles = plan.style.cycles(plan.context.skeleton);
        let Some(steps) = cycles.steps else {
            return Vec::new();
        };
        if self.stand.is_none() || self.turn.abs() < STEP_TURN || turns(plan.style) {
            return Vec::new();
        }
        let [left, right] = steps.left_right;
        // The foot on the side of the turn goes first.
        let phases = if self.turn > 0.0 {
            [left, right]
        } else {
            [right, left]
        };
        let gait = &plan.style.gaits[steps.gait];
        let per_frame = plan.context.fps / STYLE_FPS;
        let pose = |(after, phase): (u64, f32)| {
            let at = self.commanded_at + (after as f32 * per_frame).round() as u64;
            let frame = NOW + usize::try_from(at.checked_sub(plan.context.frame)?).ok()?;
            let inside = NOW + STEP_MARGIN_FRAMES..plan.frames.saturating_sub(STEP_MARGIN_FRAMES + 1);
            if !inside.contains(&frame) {
                return None;
            }
            let mut rotations = vec![Quat::IDENTITY; plan.context.skeleton.joint_count()];
            let moment = cycles.gaits[steps.gait].sample(gait, phase, |joint, q| rotations[joint] = q);
            rotations[0] = yaw(plan.turn.at(plan.seconds(frame)).0 + moment.sway) * rotations[0];
            Some(GapPose {
                frame,
                rotations,
                height_m: moment.height_m,
            })
        };
        STEP_FRAMES.into_iter().zip(phases).filter_map(pose).collect()
    }
}

/// The gait that the command names. A name that the style does not have leaves the choice to the velocity.
fn only_gait(command: &LocomotionCommand) -> Option<usize> {
    let name = command.gait.as_ref()?;
    command.style.gaits.iter().position(|gait| gait.name == *name)
}

/// Frames of the segment (the most, where the root stage chooses) and seconds to its target.
fn length(style: &Style, context: &PlanContext<'_>) -> (usize, f32) {
    let longest = style.allowed_token_counts.iter().max();
    let usual = || CONTEXT_FRAMES + (HORIZON_S * context.fps).round() as usize;
    let frames = match longest {
        None => context.plan_frames.unwrap_or_else(usual),
        Some(&tokens) => tokens as usize * context.frames_per_token,
    };
    let horizon_s = if style.allowed_token_counts.len() > 1 {
        HORIZON_S
    } else {
        frames.saturating_sub(CONTEXT_FRAMES).max(1) as f32 / context.fps
    };
    (frames, horizon_s)
}

impl Plan<'_> {
    /// The frame of the segment at the horizon.
    fn last(&self) -> usize {
        NOW + (self.horizon_s * self.context.fps).round() as usize
    }

    /// Seconds from the last context frame to a frame of the segment.
    fn seconds(&self, frame: usize) -> f32 {
        frame.saturating_sub(NOW) as f32 / self.context.fps
    }

    /// Phase of the blend at a frame of the segment, and its time at 30 Hz.
    fn phase_at(&self, frame: usize) -> (f32, u64) {
        let passed = self.seconds(frame) * STYLE_FPS;
        // Standing poses are those of the horizon in the whole plan.
        let time = self.frame + (self.horizon_s * STYLE_FPS) as u64;
        (self.phase + passed * self.blend.rate, time)
    }

    fn moment(&self, frame: usize) -> Moment {
        let (phase, time) = self.phase_at(frame);
        self.blend.moment(phase, time)
    }

    /// r_g2 at a frame of the segment: the closed form of equation 6 for the position.
    fn r_g2(&self, frame: usize) -> GlobalRoot {
        if frame <= NOW {
            return self.context.roots[frame];
        }
        let t = self.seconds(frame);
        let now = self.context.roots[NOW].position;
        let velocity = self.context.velocity.with_y(0.0);
        let (position, _) = critically_damped(now, velocity, self.r_g1.position, GAMMA, t);
        GlobalRoot::new(position, wrap_angle(self.turn.at(t).0))
    }

    /// The guide at a frame of the segment. Its way is a smooth curve from the character's place and velocity to r_g2's end
    /// and the commanded velocity: equation 6 itself runs ahead at first and comes to rest, which is right for where a
    /// target lies, but not for a path. Its headings carry the sway of the steps.
    fn guide_at(&self, frame: usize, end: GlobalRoot) -> GlobalRoot {
        if frame < NOW {
            return self.context.roots[frame];
        }
        let t = self.seconds(frame);
        let now = self.context.roots[NOW].position;
        let position = if t <= self.horizon_s {
            let (from, to) = (self.context.velocity, self.feasible.velocity);
            hermite(now, from, end.position, to, self.horizon_s, t)
        } else {
            end.position + self.feasible.velocity * (t - self.horizon_s)
        };
        let moment = self.moment(frame);
        // Heights are the gait's, once what the character is off by has faded.
        let off = now.y - self.moment(NOW).height_m;
        let height =
            moment.height_m + off * (1.0 - smoothstep((t * STYLE_FPS / HEIGHT_FADE_FRAMES).min(1.0)));
        let heading = self.turn.at(t).0 + moment.sway;
        GlobalRoot::new(position.with_y(height), wrap_angle(heading))
    }

    /// The blend's pose at a frame of the segment, in the world.
    fn pose(&self, frame: usize) -> (Vec<Quat>, Moment) {
        let mut rotations = vec![Quat::IDENTITY; self.context.skeleton.joint_count()];
        let (phase, time) = self.phase_at(frame);
        let moment = self.blend.sample(phase, time, &mut rotations);
        rotations[0] = yaw(self.turn.at(self.seconds(frame)).0 + moment.sway) * rotations[0];
        (rotations, moment)
    }

    fn target(&self, frame: usize) -> TargetKey {
        let (rotations, moment) = self.pose(frame);
        let spring = self.r_g2(frame);
        let (heading, omega) = self.turn.at(self.seconds(frame));
        let sway = yaw(heading) * Vec3::new(moment.left_mps, 0.0, moment.forward_mps);
        let velocity = self.feasible.velocity + sway;
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

    /// Whether it stands already, and only goes on standing.
    fn stands(&self) -> bool {
        let turns = self.turn.at(self.horizon_s).0 - self.turn.at(0.0).0;
        self.context.velocity.with_y(0.0).length() < STILL.0 && turns.abs() < STILL.1
    }

    /// Poses in the gap. The data's stands are full of gestures, and the networks fill one with them that is left to them; so one
    /// who stands has a pose half way, as one who walks. One who comes to a stop has it late, for until then its feet step as they
    /// must; one who turns on the spot has its steps.
    fn gap_poses(&self) -> Vec<GapPose> {
        let halts = self.feasible.velocity == Vec3::ZERO;
        if halts && !self.stands() {
            return vec![self.gap_pose(STOP_POSE * self.horizon_s)];
        }
        let local = yaw(-self.feasible.facing) * self.feasible.velocity;
        let parts = if halts || local.x.atan2(local.z).abs() < SIDE_ANGLE {
            FORWARD_PARTS
        } else {
            SIDE_PARTS
        };
        // A gap of more than the usual length has more of them, about as far apart.
        let parts = (parts * self.horizon_s / HORIZON_S).round().max(parts);
        (1..parts as usize)
            .map(|nth| self.gap_pose(nth as f32 / parts * self.horizon_s))
            .collect()
    }

    /// The blend's pose so many seconds ahead.
    fn gap_pose(&self, ahead_s: f32) -> GapPose {
        let frame = NOW + (ahead_s * self.context.fps).round() as usize;
        let (rotations, moment) = self.pose(frame);
        GapPose {
            frame,
            rotations,
            height_m: moment.height_m,
        }
    }

    fn targets(&self, steps: Vec<GapPose>) -> PlanTargets {
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
                position_ratio: self.style.root_ratio,
                height_ratio: HEIGHT_RATIO,
                heading_ratio: HEADING_RATIO,
            }),
            r_g1: self.r_g1,
            r_g2: (0..self.frames).map(|frame| self.r_g2(frame)).collect(),
            unfinished: self.turn.unfinished(),
            gaits: self.blend.named(),
        }
    }
}

/// The cubic from `a` with velocity `va` to `b` with velocity `vb`, `length_s` later, at `t`.
fn hermite(a: Vec3, va: Vec3, b: Vec3, vb: Vec3, length_s: f32, t: f32) -> Vec3 {
    let u = t / length_s;
    let (u2, u3) = (u * u, u * u * u);
    a * (2.0 * u3 - 3.0 * u2 + 1.0)
        + va * (length_s * (u3 - 2.0 * u2 + u))
        + b * (3.0 * u2 - 2.0 * u3)
        + vb * (length_s * (u3 - u2))
}

#[cfg(test)]
#[path = "locomotion_tests.rs"]
mod tests;
