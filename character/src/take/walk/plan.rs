//! The windows of a walk: keyframes, and the way to them.

use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::Task;
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, Vec3};

use super::{Pending, Walk};
use crate::live::request::{Context, build};
use crate::live::{CONTEXT_FRAMES, CharacterOptions, PlanItem};
use crate::primitives::path::PathPoint;
use crate::primitives::{
    GapPose, Guide, Locomotion, LocomotionCommand, PathCommand, PlanContext, PlanTargets, TargetKey,
};

/// Frames that are taken of a window of smart locomotion. The next window begins behind them.
const FRESH: usize = 24;
/// A window ends with a keyframe that is this many frames away, at least and at most.
pub(super) const KEY_FRAMES: [usize; 2] = [8, 48];
/// Frames over which the root's velocity is measured.
const VELOCITY_FRAMES: usize = 10;

impl Walk {
    /// A window of keyframes. At most `left` of its frames are taken.
    pub(super) fn plan(&mut self, left: usize, seed: u64) -> Option<Task> {
        self.fill_context();
        let now = self.track.len() - 1;
        let [least, most] = KEY_FRAMES;
        let target = self
            .keys
            .range(now + least..)
            .next()
            .map(|(frame, _)| frame - now);
        let (targets, fresh) = match target {
            Some(away) if away <= most => self.to_key(now, away),
            _ => {
                let fresh = target.map_or(FRESH, |away| FRESH.min(away - least));
                (self.by_style(now), fresh)
            }
        };
        let from = self.track.len() - CONTEXT_FRAMES;
        let context = Context {
            roots: std::array::from_fn(|frame| self.track.roots[from + frame]),
            rotations: self.track.part(from, CONTEXT_FRAMES).rotations,
        };
        let options = CharacterOptions {
            seed,
            look_ahead_frames: 0,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: self.take.look.temperature,
        };
        let (item, shape) = build(&self.rig, &options, self.windows as u64, context, targets);
        self.pending = Some(Pending::Plan {
            shape: Box::new(shape),
            fresh: fresh.min(left),
        });
        match item {
            PlanItem::Keyframes(task) => Some(Task::Keyframes(task)),
            // Only bodies that take paths have such plans, and they do not walk.
            PlanItem::Path(_) => None,
        }
    }

    /// The keyframes of smart locomotion on the way, and the given poses that are too near to end a
    /// window.
    fn by_style(&mut self, now: usize) -> PlanTargets {
        let rig = self.rig.clone();
        let rotations = self
            .track
            .part(now + 1 - CONTEXT_FRAMES, CONTEXT_FRAMES)
            .rotations;
        let roots =
            std::array::from_fn(|frame| self.track.root(now + 1 - CONTEXT_FRAMES + frame, &rig.skeleton));
        let context = PlanContext {
            frame: now as u64,
            roots,
            rotations: &rotations,
            velocity: self.velocity(now),
            seed: 0,
            skeleton: &rig.skeleton,
            fps: rig.fps,
            frames_per_token: rig.dims.frames_per_token,
            plan_frames: None,
        };
        if self.locomotion.is_none() {
            self.locomotion = self.locomotion(now, context.roots[CONTEXT_FRAMES - 1]);
        }
        let planned = self
            .locomotion
            .as_mut()
            .map(|locomotion| locomotion.plan(&context));
        let mut targets = planned.unwrap_or_else(|| stand(context.roots[CONTEXT_FRAMES - 1]));
        let frames = targets.frames.unwrap_or(rig.dims.max_frames());
        targets.gap_poses.extend(self.gap_poses(now, frames));
        targets
    }

    fn locomotion(&mut self, now: usize, root: GlobalRoot) -> Option<Locomotion> {
        let style = self.take.look.style.clone()?;
        let frame = now as f32 - self.lead as f32;
        if !self.way.is_given {
            self.way.shift_to(frame, [root.position.x, root.position.z]);
        }
        let points = self.way.knots.iter().map(|knot| PathPoint {
            position: Vec3::new(knot.place[0], 0.0, knot.place[1]),
            heading: knot.heading,
            time_s: (knot.frame - frame) / self.way.fps,
        });
        let path = PathCommand {
            style: style.clone(),
            points: points.collect(),
            closing_s: None,
        };
        let standing = LocomotionCommand::standing(&style);
        let mut locomotion = Locomotion::new(now as u64, root.heading, self.rig.fps, standing);
        locomotion.set_path(now as u64, path);
        Some(locomotion)
    }

    /// Velocity over the ground without the sway of a step, m/s.
    fn velocity(&self, now: usize) -> Vec3 {
        let from = now.saturating_sub(VELOCITY_FRAMES);
        let way = (self.track.roots[now] - self.track.roots[from]).with_y(0.0);
        way * self.rig.fps / (now - from).max(1) as f32
    }

    /// A window that ends with the keyframe `away` frames ahead and those right behind it, and how
    /// many frames it makes.
    fn to_key(&self, now: usize, away: usize) -> (PlanTargets, usize) {
        let first = now + away;
        let most = self.rig.dims.max_targets;
        let row = (first..).take(most).map_while(|frame| self.keys.get(&frame));
        let keys: Vec<TargetKey> = row.cloned().collect();
        let fresh = away + keys.len() - 1;
        let frames = CONTEXT_FRAMES + fresh;
        let here = self.track.root(now, &self.rig.skeleton);
        let to = keys.last().and_then(|key| key.root);
        let targets = PlanTargets {
            targets: keys,
            gap_poses: self.gap_poses(now, CONTEXT_FRAMES + away - 1),
            frames: Some(frames),
            allowed_token_counts: Vec::new(),
            guide: self.way.is_given.then(|| self.guide(now, frames, here, to)),
            follow: None,
            r_g1: to.unwrap_or(here),
            r_g2: Vec::new(),
            path: None,
            unfinished: false,
            gaits: Vec::new(),
        };
        (targets, fresh)
    }

    /// The keyed poses inside the window of `frames` frames that begins behind `now`.
    fn gap_poses(&self, now: usize, frames: usize) -> Vec<GapPose> {
        let inside = self
            .keys
            .range(now + 1..now + 1 + frames.saturating_sub(CONTEXT_FRAMES));
        let pose = |(frame, key): (&usize, &TargetKey)| {
            let root_m = key.root.map(|root| root.position.y);
            Some(GapPose {
                frame: frame - now + CONTEXT_FRAMES - 1,
                rotations: key.rotations.clone()?,
                height_m: root_m.or(key.height_m)?,
            })
        };
        inside.filter_map(pose).collect()
    }

    /// The way of a window, which begins at the newest frame and ends at `to`.
    fn guide(&self, now: usize, frames: usize, here: GlobalRoot, to: Option<GlobalRoot>) -> Guide {
        let first = now as f32 - self.lead as f32;
        let last = frames - CONTEXT_FRAMES;
        let at = |step: usize| {
            let [x, z, heading] = self.way.at(first + step as f32);
            GlobalRoot::new(Vec3::new(x, 0.0, z), heading)
        };
        let off = |root: GlobalRoot, way: GlobalRoot| {
            let place = (root.position - way.position).with_y(0.0);
            (place, wrap_angle(root.heading - way.heading))
        };
        let start = off(here, at(0));
        let end = to.map_or((Vec3::ZERO, 0.0), |to| off(to, at(last)));
        let height_m = to.map_or(here.position.y, |to| to.position.y);
        let root = |frame: usize| {
            let Some(step) = frame.checked_sub(CONTEXT_FRAMES - 1) else {
                let from = now + 1 + frame - CONTEXT_FRAMES;
                return self.track.root(from, &self.rig.skeleton);
            };
            let share = smoothstep((step as f32 / last.max(1) as f32).min(1.0));
            let way = at(step);
            let place = way.position + start.0 * (1.0 - share) + end.0 * share;
            let y = here.position.y + (height_m - here.position.y) * share;
            let heading = way.heading + start.1 * (1.0 - share) + end.1 * share;
            GlobalRoot::new(place.with_y(y), wrap_angle(heading))
        };
        Guide {
            path: (0..frames).map(root).collect(),
            position_ratio: 1.0,
            height_ratio: 0.0,
            heading_ratio: 1.0,
        }
    }
}

/// The keyframes of a body without a style: it stays in its place.
fn stand(here: GlobalRoot) -> PlanTargets {
    PlanTargets {
        targets: vec![TargetKey {
            root: Some(here),
            ..TargetKey::default()
        }],
        gap_poses: Vec::new(),
        frames: Some(CONTEXT_FRAMES + FRESH),
        allowed_token_counts: Vec::new(),
        guide: None,
        follow: None,
        r_g1: here,
        r_g2: Vec::new(),
        path: None,
        unfinished: false,
        gaits: Vec::new(),
    }
}
