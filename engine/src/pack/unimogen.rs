//! The parts of a pack that only UniMoGen packs have: the table `[unimogen]`, and a file for each
//! body (docs/unimogen-pack.md).

use std::path::Path;

use serde::{Deserialize, Serialize};
use troupe_motion::model::{Body, DESCRIPTION, Dims, SLOTS};

use super::PackProblem;
use super::bodies::{check_names, read_body};
use super::manifest::field;

/// File name of the network for all bodies.
pub const DENOISER_FILE: &str = "denoiser.onnx";
/// A window has a multiple of this number of frames, because the network's slowest level counts in
/// such steps.
pub const RATE: usize = 4;

/// Numbers that the network gets of a row, in the order of a body's description.
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
/// Most words of a pack.
const MAX_WORDS: usize = 1024;

/// The table `[unimogen]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UniMoGenDoc {
    /// Names of the bodies. Each has a file in the folder `bodies`.
    pub bodies: Vec<String>,
    /// The body of a request that names none.
    pub default_body: String,
    /// The words that the network knows, in the order of its inputs.
    pub words: Vec<String>,
    /// Names of the numbers that it gets of each row.
    pub description: Vec<String>,
    /// Rows that the attention of a row reads.
    pub slots: usize,
    /// Steps of the diffusion in the training.
    pub diffusion_steps: usize,
    /// Steps of the sampler for a request that names none.
    pub sampler_steps: usize,
    /// Share of the signal's power that remains at each diffusion step: falling, between 0 and 1.
    pub signal: Vec<f64>,
    /// Offset of the root from its path that the network reads as -1, in body sizes: left, up,
    /// ahead.
    pub root_low: [f32; 3],
    /// Offset of the root from its path that the network reads as 1, in body sizes: left, up,
    /// ahead.
    pub root_high: [f32; 3],
    /// Factor on the columns of bends.
    pub bend_gain: f32,
    /// Largest turn rate of a path that the network gets, radians a second.
    pub max_turn_rad_per_s: f32,
    /// The bodies that have a network of their kind.
    #[serde(default)]
    pub kinds: KindsDoc,
}

/// The table `[unimogen.kinds]`: the bodies that the network of a kind moves. Without bodies a kind
/// has no network.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KindsDoc {
    pub people: Vec<String>,
    pub robots: Vec<String>,
    pub animals: Vec<String>,
}

impl KindsDoc {
    /// File and bodies of each network.
    fn networks(&self) -> impl Iterator<Item = (&'static str, &[String])> {
        let kinds = [
            ("denoiser-people.onnx", &self.people),
            ("denoiser-robots.onnx", &self.robots),
            ("denoiser-animals.onnx", &self.animals),
        ];
        let kinds = kinds.map(|(file, bodies)| (file, bodies.as_slice()));
        kinds.into_iter().filter(|(_, bodies)| !bodies.is_empty())
    }
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
        check_names("unimogen.bodies", &self.bodies)?;
        check_names("unimogen.words", &self.words)?;
        if !self.bodies.contains(&self.default_body) {
            return Err(field(
                "unimogen.default_body",
                &self.default_body,
                "one of unimogen.bodies",
            ));
        }
        let kinds = self.kinds.networks().flat_map(|(_, bodies)| bodies);
        let kinds: Vec<String> = kinds.cloned().collect();
        check_names("unimogen.kinds", &kinds)?;
        if let Some(other) = kinds.iter().find(|name| !self.bodies.contains(name)) {
            return Err(field("unimogen.kinds", other, "names of unimogen.bodies"));
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

    /// Files of the networks, in the order of [`Body::network`].
    pub(super) fn files(&self) -> Vec<&'static str> {
        let kinds = self.kinds.networks().map(|(file, _)| file);
        std::iter::once(DENOISER_FILE).chain(kinds).collect()
    }

    /// Reads the files of all bodies.
    ///
    /// # Errors
    /// Those of [`read_body`].
    pub(super) fn read_bodies(&self, folder: &Path, fps: f32, dims: &Dims) -> Result<Vec<Body>, PackProblem> {
        let fields = ["unimogen.bodies", "unimogen.words"];
        let read = |name: &String| {
            let own = self
                .kinds
                .networks()
                .position(|(_, bodies)| bodies.contains(name));
            Ok(Body {
                network: own.map_or(0, |kind| 1 + kind),
                ..read_body(folder, name, (&self.words, fields), fps, dims)?
            })
        };
        self.bodies.iter().map(read).collect()
    }
}
