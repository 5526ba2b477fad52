//! The parts of a pack that only packs of NVIDIA's planner for the G1 have: the table
//! `[sonic_planner]`, and the robot's file (docs/decisions/official-networks.md).

use std::path::Path;

use serde::{Deserialize, Serialize};
use troupe_motion::model::{Body, Capabilities, Capability, Dims};

use super::PackProblem;
use super::bodies::{check_names, read_body};
use super::manifest::field;

/// File name of the graph.
pub const PLANNER_FILE: &str = "planner.onnx";
/// Hinges of the robot.
pub(crate) const HINGES: usize = 29;
/// Frames that the graph continues.
pub(crate) const CONTEXT_FRAMES: usize = 4;
/// Frames of a token.
pub(crate) const FRAMES_PER_TOKEN: usize = 4;
/// Fewest and most tokens of a plan.
pub(crate) const TOKENS: [usize; 2] = [6, 16];
/// Most modes.
const MAX_MODES: usize = 1024;

/// The table `[sonic_planner]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SonicPlannerDoc {
    /// The robot. Its file is in the folder `bodies`.
    pub body: String,
    /// Names of the modes, in the order of their numbers. They are the words of the pack.
    pub modes: Vec<String>,
    /// The mode of a task without words.
    pub default_mode: String,
    /// Modes that become the first one for a robot that stands.
    pub walks: Vec<String>,
    /// Whether the graph aims at the last four frames of the path. Otherwise it goes by the
    /// direction and the speed alone.
    pub specific_target: bool,
}

impl SonicPlannerDoc {
    /// Checks all values, and those of the manifest that the graph decides.
    ///
    /// # Errors
    /// [`PackProblem::Field`] for the first value out of its range.
    pub(super) fn check(&self, dims: &Dims, capabilities: Capabilities) -> Result<(), PackProblem> {
        let [least, most] = TOKENS;
        let modes = self.modes.len();
        for (name, value, low, high) in [
            (
                "frames_per_token",
                dims.frames_per_token,
                FRAMES_PER_TOKEN,
                FRAMES_PER_TOKEN,
            ),
            ("min_tokens", dims.min_tokens, least, least),
            ("max_tokens", dims.max_tokens, most, most),
            (
                "context_frames",
                dims.context_frames,
                CONTEXT_FRAMES,
                CONTEXT_FRAMES,
            ),
            ("max_targets", dims.max_targets, 0, 0),
            ("sonic_planner.modes", modes, 1, MAX_MODES),
        ] {
            if !(low..=high).contains(&value) {
                return Err(field(name, value, format!("{low} to {high}")));
            }
        }
        if let Some(other) = capabilities.list().find(|able| *able != Capability::Live) {
            return Err(field("capabilities", other, "live alone, because of the family"));
        }
        check_names("sonic_planner.body", std::slice::from_ref(&self.body))?;
        check_names("sonic_planner.modes", &self.modes)?;
        let unknown = |name: &&String| !self.modes.contains(name);
        let default = std::iter::once(&self.default_mode).map(|name| ("sonic_planner.default_mode", name));
        let walks = self.walks.iter().map(|name| ("sonic_planner.walks", name));
        match default.chain(walks).find(|(_, name)| unknown(name)) {
            Some((list, name)) => Err(field(list, name, "modes of sonic_planner.modes")),
            None => Ok(()),
        }
    }

    /// Reads the robot's file.
    ///
    /// # Errors
    /// Those of [`read_body`], and [`PackProblem::Field`] for a body of other hinges.
    pub(super) fn read_body(&self, folder: &Path, fps: f32, dims: &Dims) -> Result<Body, PackProblem> {
        let fields = ["sonic_planner.body", "sonic_planner.modes"];
        let body = read_body(folder, &self.body, (&self.modes, fields), fps, dims)?;
        let hinges = body
            .rig
            .skeleton
            .robot
            .as_ref()
            .map_or(0, |robot| robot.hinges().len());
        match hinges {
            HINGES => Ok(body),
            other => {
                let found = format!("a body with {other} hinges");
                let allowed = format!("a robot with {HINGES}, in the order of MuJoCo's qpos");
                Err(field("sonic_planner.body", found, allowed))
            }
        }
    }
}
