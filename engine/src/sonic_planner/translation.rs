//! From a task to the inputs of the graph.

use troupe_motion::conventions::Convention;
use troupe_motion::features::world_rotations_from_features;
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::model::{Dims, KeyTensors, PathTask};
use troupe_motion::robot::Fitted;
use troupe_motion::{Quat, Robot, Vec3};

use super::inputs::{COUNTS, Inputs, TARGETS};
use super::{QPOS, robot_of};
use crate::EngineError;
use crate::pack::sonic_planner::{CONTEXT_FRAMES, FRAMES_PER_TOKEN, SonicPlannerDoc, TOKENS};

/// Paths that are slower than this stay in place, m/s.
const STANDING_MPS: f32 = 0.05;
/// Seeds are below this. NVIDIA's code draws such seeds, and computes with them in f32.
pub(super) const SEEDS: u64 = 10_000;

/// What a pack says of its modes.
#[derive(Debug, Clone)]
pub(super) struct Translation {
    /// Whether each mode becomes mode 0 for a robot that stands.
    walks: Vec<bool>,
    default_mode: usize,
    has_specific_target: bool,
    fps: f32,
    dims: Dims,
}

/// The way of a path after the context.
struct Way {
    /// Unit length in native axes; zero if it ends where it begins.
    direction: Vec3,
    speed_mps: f32,
}

impl Translation {
    pub(super) fn new(table: &SonicPlannerDoc, fps: f32, dims: Dims) -> Self {
        let default = table.modes.iter().position(|mode| *mode == table.default_mode);
        Self {
            walks: table
                .modes
                .iter()
                .map(|mode| table.walks.contains(mode))
                .collect(),
            default_mode: default.unwrap_or(0),
            has_specific_target: table.specific_target,
            fps,
            dims,
        }
    }

    /// The inputs for a task. Its body must be the pack's robot.
    ///
    /// # Errors
    /// [`EngineError::Task`] for the first part of the task that is out of its range.
    pub(super) fn inputs(&self, task: &PathTask) -> Result<Inputs, EngineError> {
        self.check(task)?;
        let robot = robot_of(&task.body)?;
        let way = self.way(&task.path);
        let stands = way.speed_mps < STANDING_MPS;
        let frames = task.path.len();
        let last = task.path[frames - 1];
        let mut inputs = Inputs {
            facing_direction: ros(ahead(last[2])),
            random_seed: [(task.seed % SEEDS) as i64],
            has_specific_target: [i64::from(self.has_specific_target)],
            mode: [self.mode(&task.style, stands) as i64],
            ..Inputs::default()
        };
        if !stands {
            inputs.movement_direction = ros(way.direction);
            inputs.target_vel = [way.speed_mps];
        }
        let targets = &task.path[frames - TARGETS..];
        for (index, &[x, z, heading]) in targets.iter().enumerate() {
            inputs.specific_target_positions[index] = ros(Vec3::new(x, task.body.height_m, z));
            inputs.specific_target_headings[index] = heading;
        }
        inputs.allowed_pred_num_tokens[frames / FRAMES_PER_TOKEN - TOKENS[0]] = 1;
        let mut fit = Fit::new(task.body.joints());
        let qpos = inputs.context_mujoco_qpos.chunks_exact_mut(QPOS);
        for (key, qpos) in task.context.iter().zip(qpos) {
            fit.write(task, robot, key, qpos);
        }
        Ok(inputs)
    }

    /// The word with the largest weight, the first of several. Without a word the pack's default.
    fn mode(&self, style: &[f32], stands: bool) -> usize {
        let mut asked = self.default_mode;
        let mut most = 0.0;
        for (mode, &weight) in style.iter().enumerate() {
            if weight > most {
                (asked, most) = (mode, weight);
            }
        }
        if stands && self.walks[asked] { 0 } else { asked }
    }

    fn way(&self, path: &[[f32; 3]]) -> Way {
        let coming = &path[CONTEXT_FRAMES - 1..];
        let place = |&[x, z, _]: &[f32; 3]| Vec3::new(x, 0.0, z);
        let length: f32 = coming
            .windows(2)
            .map(|pair| place(&pair[0]).distance(place(&pair[1])))
            .sum();
        Way {
            direction: (place(&coming[coming.len() - 1]) - place(&coming[0])).normalize_or_zero(),
            speed_mps: length * self.fps / (coming.len() - 1) as f32,
        }
    }

    fn check(&self, task: &PathTask) -> Result<(), EngineError> {
        let wrong = |field, found: &dyn ToString, allowed: String| {
            Err(EngineError::Task {
                field,
                found: found.to_string(),
                allowed,
            })
        };
        let frames = task.path.len();
        let (least, most) = (self.dims.min_frames(), self.dims.max_frames());
        if !(least..=most).contains(&frames) || !frames.is_multiple_of(FRAMES_PER_TOKEN) {
            let allowed = format!("{least} to {most} frames, a multiple of {FRAMES_PER_TOKEN}");
            return wrong("path", &frames, allowed);
        }
        if task.context.len() != CONTEXT_FRAMES {
            let allowed = format!("{CONTEXT_FRAMES} frames");
            return wrong("context", &task.context.len(), allowed);
        }
        let is_whole = |key: &KeyTensors| key.global_root.is_some() && key.pose.is_some();
        if let Some(frame) = task.context.iter().position(|key| !is_whole(key)) {
            return wrong(
                "context",
                &format!("frame {frame} without root or pose"),
                "both".to_owned(),
            );
        }
        if !task.targets.is_empty() {
            return wrong("targets", &task.targets.len(), "none".to_owned());
        }
        if task.style.len() != self.walks.len() {
            let allowed = format!("{} weights, one a mode", self.walks.len());
            return wrong("style", &task.style.len(), allowed);
        }
        let poses = task
            .context
            .iter()
            .filter_map(|key| key.pose.as_deref())
            .flatten();
        let roots = task.context.iter().filter_map(|key| key.global_root).flatten();
        let numbers = task
            .path
            .as_flattened()
            .iter()
            .chain(&task.style)
            .chain(poses)
            .copied();
        match numbers.chain(roots).find(|number| !number.is_finite()) {
            Some(number) => wrong("path, context and style", &number, "finite numbers".to_owned()),
            None => Ok(()),
        }
    }
}

/// Memory for bringing poses onto the hinges.
struct Fit {
    world: Vec<Quat>,
    local: Vec<Quat>,
    fitted: Fitted,
}

impl Fit {
    fn new(joints: usize) -> Self {
        Self {
            world: vec![Quat::IDENTITY; joints],
            local: vec![Quat::IDENTITY; joints],
            fitted: Fitted::default(),
        }
    }

    /// Writes a keyframe as a frame of the graph.
    fn write(&mut self, task: &PathTask, robot: &Robot, key: &KeyTensors, qpos: &mut [f32]) {
        let (Some([x, y, z, ..]), Some(pose)) = (key.global_root, &key.pose) else {
            return;
        };
        world_rotations_from_features(pose, &mut self.world);
        local_from_world_rotations(&task.body.rig.skeleton, &self.world, &mut self.local);
        robot.fit(&mut self.local, &mut self.fitted);
        robot.write_qpos(Vec3::new(x, y, z), self.local[0], &self.fitted.angles, qpos);
    }
}

/// The direction of a heading, native axes.
fn ahead(heading: f32) -> Vec3 {
    let (sin, cos) = heading.sin_cos();
    Vec3::new(sin, 0.0, cos)
}

fn ros(native: Vec3) -> [f32; 3] {
    Convention::Ros.position_from_native(native).to_array()
}

// A mask has a place for every number of tokens of a pack.
const _: () = assert!(COUNTS == 11, "the graph's input has 11 counts");
