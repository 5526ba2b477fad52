//! What a UniMoGen pack has beside the common manifest: the table `[unimogen]`, and a file a body
//! (docs/unimogen-pack.md).

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::Skeleton;
use troupe_motion::feasibility::{Limits, LimitsDoc};
use troupe_motion::model::{Body, BodyParts, DESCRIPTION, Dims, SLOTS};
use troupe_motion::robot::RobotDoc;
use troupe_motion::rotation::from_wxyz;

use super::manifest::field;
use super::{PackProblem, read_text};

/// The network's file.
pub const DENOISER_FILE: &str = "denoiser.onnx";
/// Frames of the network's slowest level: a window has a multiple of it.
pub const RATE: usize = 4;

/// What the networks are told of a row, in the order of a body's description.
const DESCRIBED: [&str; DESCRIPTION] = [
    "bone_x",
    "bone_y",
    "bone_z",
    "place_x",
    "place_y",
    "place_z",
    "axis_x",
    "axis_y",
    "axis_z",
    "is_hinge",
    "is_fixed",
    "is_contact",
    "is_end",
    "is_root",
    "is_place",
    "depth",
    "left",
    "reach",
    "log_size",
];
/// Most diffusion steps.
const MAX_STEPS: usize = 1000;
/// Most words.
const MAX_WORDS: usize = 1024;

/// The table `[unimogen]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UniMoGenDoc {
    /// Names of the bodies, which are files of the folder `bodies`.
    pub bodies: Vec<String>,
    /// The body that is meant where none is named.
    pub default_body: String,
    /// The words that the network knows.
    pub words: Vec<String>,
    /// What it is told of each row.
    pub description: Vec<String>,
    /// Rows that a row's attention reads.
    pub slots: usize,
    /// Steps of the diffusion in training.
    pub diffusion_steps: usize,
    /// Steps of the sampler where none are named.
    pub sampler_steps: usize,
    /// Share of the signal's power that is left at each diffusion step.
    pub signal: Vec<f64>,
    /// Offset of the root from its path that is -1 to the network, sizes: left, up, ahead.
    pub root_low: [f32; 3],
    /// Offset of the root from its path that is 1 to the network, sizes: left, up, ahead.
    pub root_high: [f32; 3],
    /// What columns of bends are multiplied by.
    pub bend_gain: f32,
    /// Largest turn rate of a path that the network is told, radians a second.
    pub max_turn_rad_per_s: f32,
}

impl UniMoGenDoc {
    /// Checks all values.
    ///
    /// # Errors
    /// [`PackProblem::Field`] for the first value out of its range.
    pub(super) fn check(&self, dims: &Dims) -> Result<(), PackProblem> {
        let windows = [
            ("frames_per_token", dims.frames_per_token, RATE, RATE),
            ("max_targets", dims.max_targets, 1, dims.min_frames() - 1),
            ("unimogen.words", self.words.len(), 1, MAX_WORDS),
            ("unimogen.bodies", self.bodies.len(), 1, MAX_WORDS),
            ("unimogen.slots", self.slots, SLOTS, SLOTS),
            ("unimogen.diffusion_steps", self.diffusion_steps, 1, MAX_STEPS),
            (
                "unimogen.signal",
                self.signal.len(),
                self.diffusion_steps,
                self.diffusion_steps,
            ),
            (
                "unimogen.sampler_steps",
                self.sampler_steps,
                1,
                self.diffusion_steps,
            ),
        ];
        for (name, value, low, high) in windows {
            if !(low..=high).contains(&value) {
                return Err(field(name, value, format!("{low} to {high}")));
            }
        }
        let names = self.bodies.iter().chain(&self.words);
        if let Some(name) = names.clone().find(|name| !is_name(name)) {
            return Err(field("unimogen", name, "names of 1 to 64 of a-z, 0-9, - and _"));
        }
        for (what, list) in [("unimogen.bodies", &self.bodies), ("unimogen.words", &self.words)] {
            let mut seen = HashSet::new();
            if let Some(twice) = list.iter().find(|name| !seen.insert(*name)) {
                return Err(field(what, twice, "each name once"));
            }
        }
        if !self.bodies.contains(&self.default_body) {
            return Err(field(
                "unimogen.default_body",
                &self.default_body,
                "one of unimogen.bodies",
            ));
        }
        if self.description != DESCRIBED {
            let found = self.description.join(", ");
            return Err(field("unimogen.description", found, DESCRIBED.join(", ")));
        }
        let inside = self.signal.iter().all(|&share| share > 0.0 && share < 1.0);
        if !inside || !self.signal.is_sorted_by(|a, b| a > b) {
            let found = format!("{:?}", self.signal);
            return Err(field("unimogen.signal", found, "falling, between 0 and 1"));
        }
        let (low, high) = (self.root_low, self.root_high);
        let is_range =
            |axis: usize| low[axis].is_finite() && high[axis].is_finite() && low[axis] < high[axis];
        if !(0..3).all(is_range) {
            let found = format!("{low:?} to {high:?}");
            return Err(field(
                "unimogen.root_low",
                found,
                "finite, below root_high on each axis",
            ));
        }
        for (name, value) in [
            ("unimogen.bend_gain", self.bend_gain),
            ("unimogen.max_turn_rad_per_s", self.max_turn_rad_per_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(field(name, value, "more than 0"));
            }
        }
        Ok(())
    }

    /// Reads the bodies' files.
    ///
    /// # Errors
    /// [`PackProblem::Read`], [`PackProblem::BodyFile`], [`PackProblem::Body`] or
    /// [`PackProblem::BodyLimits`].
    pub(super) fn read_bodies(&self, folder: &Path, fps: f32, dims: &Dims) -> Result<Vec<Body>, PackProblem> {
        let read = |name: &String| {
            let text = read_text(&body_file(folder, name))?;
            let doc: BodyDoc = toml::from_str(&text).map_err(|cause| PackProblem::BodyFile {
                body: name.clone(),
                cause: Box::new(cause),
            })?;
            let failed = |problem| PackProblem::Body {
                body: name.clone(),
                problem: Box::new(problem),
            };
            if &doc.name != name {
                return Err(field(
                    "unimogen.bodies",
                    name,
                    format!("{:?}, as its file says", doc.name),
                ));
            }
            if let Some(word) = doc.words.iter().find(|word| !self.words.contains(word)) {
                return Err(field(
                    "unimogen.words",
                    word,
                    format!("words of the pack, in bodies/{name}.toml"),
                ));
            }
            let limits = doc.limits.clone();
            let mut body = Body::new(doc.parts()?, fps, dims).map_err(failed)?;
            if let Some(doc) = limits {
                let limits = Limits::new(&doc, &body.rig.skeleton);
                let limits = limits.map_err(|problem| PackProblem::BodyLimits {
                    body: name.clone(),
                    problem: Box::new(problem),
                })?;
                Arc::make_mut(&mut body.rig).limits = Some(Arc::new(limits));
            }
            Ok(body)
        };
        self.bodies.iter().map(read).collect()
    }
}

/// The file of one body in a pack's folder.
pub(super) fn body_file(folder: &Path, name: &str) -> PathBuf {
    folder.join("bodies").join(format!("{name}.toml"))
}

fn is_name(name: &str) -> bool {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    (1..=64).contains(&name.len()) && name.chars().all(allowed)
}

/// A file of the folder `bodies`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BodyDoc {
    name: String,
    words: Vec<String>,
    height_m: f32,
    size_m: f32,
    neutral: NeutralDoc,
    skeleton: Skeleton,
    robot: Option<RobotDoc>,
    limits: Option<LimitsDoc>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NeutralDoc {
    sides: Vec<i8>,
    /// (w, x, y, z), world.
    rotations: Vec<[f32; 4]>,
}

impl BodyDoc {
    fn parts(self) -> Result<BodyParts, PackProblem> {
        let skeleton = match &self.robot {
            Some(robot) => self.skeleton.with_robot(robot)?,
            None => self.skeleton,
        };
        Ok(BodyParts {
            name: self.name,
            skeleton,
            neutral: self.neutral.rotations.into_iter().map(from_wxyz).collect(),
            sides: self.neutral.sides,
            height_m: Some(self.height_m),
            size_m: Some(self.size_m),
            words: self.words,
        })
    }
}
