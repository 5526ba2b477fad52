//! Smart locomotion (paper section 6.1 and table 1): turns a command into target keyframes.
//!
//! * r_g1, naive: the root after a second with the commanded heading, and with the velocity ramping
//!   to the commanded one ([`super::ramp`]).
//! * r_g2, spring: the root on its way to r_g1 by equation 6. Targets are placed on it. Its
//!   position starts from the character at every plan; its heading is a spring that continues from
//!   command to command ([`super::heading`]).
//! * r_g3 and r_g4 are the networks'. Headings of r_g3 follow the [`Guide`].
//!
//! Target poses come from the blendspace ([`super::blend`]), at the phase that the character's step
//! will have reached. Before all this, a velocity that the style cannot do becomes the nearest that
//! it can ([`super::reach`]).

use serde::{Deserialize, Serialize};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::blend::{Blend, STYLE_FPS, Wanted};
use super::heading::{HeadingSpring, Turn};
use super::matching::Matcher;
use super::path::PathCommand;
use super::path::run::{Now, PathEnd, PathRun, Way};
use super::ramp::{Ramp, VelocityRamp};
use super::reach::{self, Feasible, Instead};
use super::recipe::{
    ACCELERATION_MPS2, ANCHOR_AFTER_S, HORIZON_S, MOST_TURN_RPS, PATH_PLAN_FRAMES, STANDING_MPS, STEP_FRAMES,
    STEP_MARGIN_FRAMES, STEP_TURN, STILL,
};
use super::variation::Variation;
use super::{CONTEXT_FRAMES, GapPose, LocomotionCommand, PlanContext, PlanTargets};
use crate::style::{STANDING_GAIT_MPS, Style};

/// Index of the context's last frame, from which time counts.
const NOW: usize = CONTEXT_FRAMES - 1;

/// State of the locomotion primitive.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Locomotion {
    command: LocomotionCommand,
    feasible: Feasible,
    heading: HeadingSpring,
    velocity: VelocityRamp,
    /// Timeline frame of the newest command.
    commanded_at: u64,
    /// Angle that the newest command turns by, radians.
    turn: f32,
    stand: Option<Standing>,
    /// The path that it follows instead of the command.
    path: Option<PathRun>,
    #[serde(skip)]
    matcher: Matcher,
    /// Frame rate of the timeline, Hz.
    fps: f32,
}

/// A character that is to stand still.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Standing {
    /// Frame of the first command to stand.
    since: u64,
    /// Where the root is held, once the character has come to rest.
    anchor: Option<Vec3>,
}

/// What a plan is made of, worked out step by step.
struct Plan<'a> {
    context: &'a PlanContext<'a>,
    style: &'a Style,
    feasible: Feasible,
    turn: Turn,
    ramp: Ramp,
    /// The velocity changes, so the root follows the ramp.
    changes: bool,
    /// Where the path leads; none without a path.
    way: Option<Way<'a>>,
    blend: Blend<'a>,
    variation: Variation<'a>,
    /// Frames of the segment; the most if the root stage chooses.
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
    /// A character that faces `heading` (radians) at timeline frame `frame` and follows `command`
    /// from there on. `fps` is the frame rate of the timeline.
    pub fn new(frame: u64, heading: f32, fps: f32, command: LocomotionCommand) -> Self {
        let mut locomotion = Self {
            feasible: Feasible {
                velocity: Vec3::ZERO,
                facing: heading,
            },
            heading: HeadingSpring::new(frame, heading),
            velocity: VelocityRamp::new(frame),
            commanded_at: frame,
            turn: 0.0,
            stand: None,
            path: None,
            matcher: Matcher::default(),
            fps,
            command,
        };
        locomotion.take_up(frame);
        locomotion
    }

    /// The current command. On a path: the command to stand in its style.
    pub fn command(&self) -> &LocomotionCommand {
        &self.command
    }

    /// Takes a new command from timeline frame `frame` on.
    pub fn set_command(&mut self, frame: u64, command: LocomotionCommand) {
        self.leave_path(frame);
        self.command = command;
        self.take_up(frame);
    }

    /// Whether the character follows no path, and a command that asks for the same as this one.
    pub(crate) fn goes_by(&self, command: &LocomotionCommand) -> bool {
        self.path.is_none() && self.command.is_same_as(command)
    }

    /// Takes a path to follow from timeline frame `frame` on.
    pub fn set_path(&mut self, frame: u64, path: PathCommand) {
        self.leave_path(frame);
        self.command = LocomotionCommand::standing(&path.style);
        self.commanded_at = frame;
        self.stand = None;
        self.turn = 0.0;
        self.path = Some(PathRun::new(frame, path));
    }

    /// What is done instead of a command that the style cannot follow; none if it can.
    pub fn instead(&self) -> Option<Instead> {
        match self.path {
            Some(_) => None,
            None => self
                .feasible
                .instead_of(self.command.velocity, self.command.facing),
        }
    }

    /// The path that it follows.
    pub fn path(&self) -> Option<&PathCommand> {
        self.path.as_ref().map(|run| &run.command)
    }

    /// The heading spring continues from where the path had the character face.
    fn leave_path(&mut self, frame: u64) {
        if let Some(run) = self.path.take()
            && let Some((heading, omega)) = run.facing(frame, self.fps)
        {
            self.heading = HeadingSpring::moving(frame, heading, omega);
            self.velocity = VelocityRamp::new(frame);
        }
    }

    /// Makes a character stand at the end of its path, if its root at `position` has come there.
    pub(crate) fn end_path(&mut self, frame: u64, position: Vec3) -> Option<PathEnd> {
        let end = self.path.as_ref()?.end(frame, self.fps, position)?;
        let command = LocomotionCommand {
            facing: Some(end.heading),
            ..LocomotionCommand::standing(&self.command.style)
        };
        self.set_command(frame, command);
        self.stand_at(end.place);
        Some(end)
    }

    /// Makes a standing character stand at `place` over the ground, instead of where it comes to
    /// rest.
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
        // A style that cannot move at all still turns to the direction that it should go.
        let facing = target.map(|_| self.feasible.facing);
        self.heading.turn_to(frame, self.fps, facing, MOST_TURN_RPS);
        self.velocity
            .go_to(frame, self.fps, self.feasible.velocity, ACCELERATION_MPS2);
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
        let ramp = (self.velocity).ramp(context.frame, context.fps, context.velocity.with_y(0.0));
        let anchor = self.anchor(context);
        let style = &*self.command.style;
        let (frames, horizon_s) = length(style, context);
        if let Some(run) = &mut self.path {
            run.plan(&now_of(context), horizon_s, &self.heading);
        }
        let way = self.path.as_ref().and_then(PathRun::way);
        let feasible = way.map_or(self.feasible, |way| way.feasible(horizon_s));
        let turned = match way {
            Some(way) => way.heading(horizon_s).0 - way.heading(0.0).0,
            None => turn.at(horizon_s).0 - turn.at(0.0).0,
        };
        let local = yaw(-feasible.facing) * feasible.velocity;
        let wanted = Wanted {
            left_mps: local.x,
            forward_mps: local.z,
            turn_rps: turned / horizon_s,
            height_m: self.command.height_m,
        };
        let cycles = style.cycles(context.skeleton);
        let variation = Variation::of(style, context.seed);
        let mut blend = Blend::new(style, cycles, only_gait(&self.command), &wanted);
        blend.hurry_by(variation.cadence());
        let frame = (context.frame as f64 * f64::from(STYLE_FPS / context.fps)) as u64;
        let frame = frame + variation.stand_frames;
        let rests = context.velocity.with_y(0.0).length() < STILL.0;
        let first_step = if rests { variation.first_step } else { 0.0 };
        let phase = if blend.rate == 0.0 {
            0.0
        } else {
            self.matcher.nearest(&blend, context, frame) + first_step
        };
        let r_g1 = match way {
            Some(way) => GlobalRoot::new(way.position(horizon_s), way.heading(horizon_s).0),
            None => GlobalRoot::new(
                anchor.unwrap_or(now.position + ramp.way(horizon_s)),
                self.feasible_heading(&turn),
            ),
        };
        let mut plan = Plan {
            context,
            style,
            feasible,
            turn,
            ramp,
            changes: way.is_none() && anchor.is_none() && ramp.changes(),
            way,
            blend,
            variation,
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

    /// The commanded heading. Without one: the heading at which the character comes to rest.
    fn feasible_heading(&self, turn: &Turn) -> f32 {
        let at_rest = turn.at(10.0 * HORIZON_S).0;
        match self.command.facing {
            None if self.stand.is_some() => wrap_angle(at_rest),
            _ => self.feasible.facing,
        }
    }

    /// The place that a character is held at after standing for a while.
    fn anchor(&mut self, context: &PlanContext<'_>) -> Option<Vec3> {
        let standing = self.stand.as_mut()?;
        let stood_s = context.frame.saturating_sub(standing.since) as f32 / context.fps;
        if standing.anchor.is_none() && stood_s >= ANCHOR_AFTER_S {
            standing.anchor = Some(context.roots[NOW].position);
        }
        standing.anchor
    }

    /// Poses with a lifted foot, for a turn on the spot in a style without a gait for it.
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
        // The foot on the side of the turn steps first.
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
            plan.variation.hold(&mut rotations);
            rotations[0] = yaw(plan.facing(plan.seconds(frame)).0 + moment.sway) * rotations[0];
            Some(GapPose {
                frame,
                rotations,
                height_m: moment.height_m,
            })
        };
        STEP_FRAMES.into_iter().zip(phases).filter_map(pose).collect()
    }
}

fn now_of(context: &PlanContext<'_>) -> Now {
    let GlobalRoot { position, heading } = context.roots[NOW];
    Now {
        frame: context.frame,
        fps: context.fps,
        position,
        velocity: context.velocity,
        heading,
    }
}

/// Index of the gait that the command names. If the style does not have it, the velocity decides.
fn only_gait(command: &LocomotionCommand) -> Option<usize> {
    let name = command.gait.as_ref()?;
    command.style.gaits.iter().position(|gait| gait.name == *name)
}

/// Frames of the segment (the most if the root stage chooses) and seconds to its target.
fn length(style: &Style, context: &PlanContext<'_>) -> (usize, f32) {
    let longest = style.allowed_token_counts.iter().max();
    let usual = || CONTEXT_FRAMES + (HORIZON_S * context.fps).round() as usize;
    let frames = match longest {
        // A path has whole tokens.
        None if style.words.is_some() => {
            let frames = context.plan_frames.unwrap_or(PATH_PLAN_FRAMES);
            frames.next_multiple_of(context.frames_per_token)
        }
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

#[path = "locomotion_plan.rs"]
mod plan;

#[cfg(test)]
#[path = "locomotion_tests.rs"]
mod tests;
