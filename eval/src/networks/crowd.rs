//! Plays characters side by side, frame by frame, so that their plans share batches.

use std::sync::Arc;

use troupe_character::live::{
    Character, CharacterOptions, EventKind, FrameOut, Intent, LivePlan, PlanCause, PlanRequest, Start,
};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::style::{Gait, Style, StyleTable};
use troupe_engine::Pipeline;
use troupe_engine::onnx::{Growth, NetworkPool, OnnxStages, Runtime};
use troupe_engine::pack::Pack;
use troupe_motion::clip::Clip;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::clock::{HasCharacter, KeyframePlanner, Planned, tick};
use super::{Played, one_thread};

/// Most plans of one batch.
const MAX_BATCH: usize = 32;
/// A gait that turns faster than this (rad/s) has no straight way to go.
const TURNING_RPS: f32 = 0.3;
/// A gait farther off its heading than this goes aside, radians.
const ASIDE: f32 = 0.2;
/// A gait slower than this stands, m/s.
const STANDING_MPS: f32 = 0.1;

/// One character and its commands.
pub(super) struct LocalRole {
    pub(super) style: Arc<Style>,
    /// None for the seed of the crowd.
    pub(super) seed: Option<u64>,
    /// Where it faces, radians. None: where it goes.
    pub(super) facing: Option<f32>,
    /// Velocities, m/s, and the frames at which they are commanded.
    pub(super) commands: Vec<(usize, Vec3)>,
    pub(super) frames: usize,
}

/// What one character did.
pub(super) struct LocalTake {
    pub(super) clip: Clip,
    /// The plans for commands, each with the frame of its last context frame.
    pub(super) plans: Vec<(usize, LivePlan)>,
    /// The speed that the character reported instead of that of its newest command, m/s.
    pub(super) bounded_mps: Option<f32>,
}

/// A pack, its networks, and the styles to play.
pub(super) struct LocalCrowd {
    pack: Pack,
    pipeline: Pipeline,
    pub(super) styles: Vec<Arc<Style>>,
    look_ahead: u32,
    seed: u64,
}

struct Actor<'a> {
    role: &'a LocalRole,
    character: Character,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    plans: Vec<(usize, LivePlan)>,
    bounded_mps: Option<f32>,
    sequence: u64,
    /// The frame that is being played.
    frame: usize,
}

impl LocalCrowd {
    /// Loads the pack and its styles that walk.
    ///
    /// # Errors
    /// Those of the pack, the runtime and the networks.
    pub(super) fn load(args: &Played) -> anyhow::Result<Self> {
        let pack = Pack::load(&args.pack)?;
        let pool = NetworkPool::new(u64::MAX);
        let stages = OnnxStages::load(&Runtime::new(None)?, &pack, one_thread(Growth::AtOnce), &pool)?;
        let styles = StyleTable::load(&pack.rig, &pack.folder, None)?.list();
        let named = |style: &Arc<Style>| args.styles.is_empty() || args.styles.contains(&style.name);
        let goes = |style: &Arc<Style>| slowest_ahead(style).is_some();
        Ok(Self {
            pipeline: Pipeline::new(pack.rig.dims, Box::new(stages), MAX_BATCH),
            pack,
            styles: styles
                .into_iter()
                .filter(|style| named(style) && goes(style))
                .collect(),
            look_ahead: args.look_ahead,
            seed: args.seed,
        })
    }

    pub(super) fn skeleton(&self) -> Arc<Skeleton> {
        self.pack.rig.skeleton.clone()
    }

    pub(super) fn fps(&self) -> f32 {
        self.pack.rig.fps
    }

    /// Plays characters that stand at first.
    ///
    /// # Errors
    /// Those of characters and networks.
    pub(super) fn play(&mut self, roles: &[LocalRole]) -> anyhow::Result<Vec<LocalTake>> {
        let mut actors: Vec<Actor<'_>> = roles.iter().map(|role| self.actor(role)).collect();
        let longest = roles.iter().map(|role| role.frames).max().unwrap_or(0);
        for frame in 0..longest {
            for actor in &mut actors {
                actor.frame = frame;
                actor.note();
                actor.command()?;
            }
            let mut planner = KeyframePlanner {
                pipeline: &mut self.pipeline,
                rig: &self.pack.rig,
                holds_feet: true,
            };
            tick(&mut actors, &mut planner)?;
        }
        let takes = actors.into_iter().map(|actor| {
            Ok(LocalTake {
                clip: Clip::new(self.skeleton(), self.fps(), actor.roots, actor.rotations)?,
                plans: actor.plans,
                bounded_mps: actor.bounded_mps,
            })
        });
        takes.collect()
    }

    fn actor<'a>(&self, role: &'a LocalRole) -> Actor<'a> {
        let options = CharacterOptions {
            seed: role.seed.unwrap_or(self.seed),
            look_ahead_frames: self.look_ahead,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        let standing = LocomotionCommand::standing(&role.style);
        Actor {
            role,
            character: Character::new(self.pack.rig.clone(), options, start, standing),
            roots: Vec::new(),
            rotations: Vec::new(),
            plans: Vec::new(),
            bounded_mps: None,
            sequence: 0,
            frame: 0,
        }
    }
}

impl HasCharacter for Actor<'_> {
    fn character(&mut self) -> &mut Character {
        &mut self.character
    }

    fn planned(&mut self, request: &PlanRequest, plan: &Planned) {
        if let (Ok(plan), PlanCause::Command) = (plan, request.cause) {
            let splice = self.frame + request.splice_in_frames as usize;
            self.plans.push((splice, plan.clone()));
        }
    }
}

impl Actor<'_> {
    /// Records its frame and its events.
    fn note(&mut self) {
        if self.frame < self.role.frames {
            let mut out = FrameOut::default();
            self.character.sample(&mut out);
            self.roots.push(out.root);
            self.rotations.extend_from_slice(&out.rotations);
        }
        let mut events = Vec::new();
        self.character.take_events(&mut events);
        for event in events {
            if let EventKind::Bounded { speed_mps, .. } = event.kind {
                self.bounded_mps = Some(speed_mps);
            }
        }
    }

    /// Gives the commands of its frame.
    fn command(&mut self) -> anyhow::Result<()> {
        for (_, velocity) in self.role.commands.iter().filter(|(at, _)| *at == self.frame) {
            self.sequence += 1;
            let command = LocomotionCommand {
                velocity: *velocity,
                facing: self.role.facing,
                ..LocomotionCommand::standing(&self.role.style)
            };
            self.character
                .give(self.sequence, None, Intent::Locomote(command))?;
        }
        Ok(())
    }
}

/// The slowest gait of a style that goes straight ahead.
pub(super) fn slowest_ahead(style: &Style) -> Option<&Gait> {
    let ahead = style.gaits.iter().filter(|gait| is_straight(gait));
    ahead.min_by(|a, b| a.forward_mps.total_cmp(&b.forward_mps))
}

/// Whether a gait goes straight ahead.
pub(super) fn is_straight(gait: &Gait) -> bool {
    gait.forward_mps > STANDING_MPS
        && gait.turn_rps.abs() <= TURNING_RPS
        && gait.left_mps.atan2(gait.forward_mps).abs() < ASIDE
}
