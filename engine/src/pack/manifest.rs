//! Reads and checks `pack.toml`.

use serde::{Deserialize, Serialize};
use troupe_motion::Skeleton;
use troupe_motion::feasibility::LimitsDoc;
use troupe_motion::model::{Capabilities, Capability, Dims};
use troupe_motion::robot::RobotDoc;

use super::PackProblem;
use super::family::Family;
use super::sonic_planner::SonicPlannerDoc;
use super::unimogen::UniMoGenDoc;
use super::vermo::VerMoDoc;

/// The newest manifest format; format 1 loads as well.
const FORMAT: u32 = 2;
/// Frames a second of every pack. The timelines of sessions, the frame numbers of commands and the
/// output rates of 30, 50 and 60 Hz depend on it.
const FPS: f32 = 30.0;
/// Most numbers that a root trajectory may be drawn from.
const MAX_ROOT_CHOICES: usize = 64;

/// The parsed `pack.toml`. Unknown tables, such as an exporter's own checks, are ignored.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the manifest's own format: 1 to [`FORMAT`].
    pub format: u32,
    /// Name of the model family, which says what runs the pack. Format 1 has none: it is
    /// MotionBricks.
    #[serde(default = "format_1_family")]
    pub family: String,
    /// What the pack can do. Format 1 has no such field: its packs fill gaps and drive live
    /// characters.
    #[serde(default = "format_1_capabilities")]
    pub capabilities: Capabilities,
    /// The name of the pack in requests: lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// The pack's version, free text.
    pub version: String,
    /// Licence of the weights, free text.
    pub licence: String,
    /// Authors of the work that the pack is built on.
    #[serde(default)]
    pub credits: Vec<String>,
    /// Frames per second: 30.
    pub fps: f32,
    /// Frames of one token.
    pub frames_per_token: usize,
    /// Fewest tokens of a segment.
    pub min_tokens: usize,
    /// Most tokens of a segment.
    pub max_tokens: usize,
    /// Codebooks of a token; 0 for a family without tokens.
    #[serde(default)]
    pub heads: usize,
    /// Codes of a codebook; 0 for a family without tokens.
    #[serde(default)]
    pub codes: usize,
    /// Exact number of context keyframes in a request.
    pub context_frames: usize,
    /// Most target keyframes of a request; 0 for a family that has none.
    #[serde(default)]
    pub max_targets: usize,
    /// How many normal numbers the root stage draws a trajectory from: the width of its input
    /// `root_noise`. None for a pack without that input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root_choices: Option<usize>,
    /// Number of weights of all stages.
    pub parameters: u64,
    /// `sha256:<hex>` over the ONNX files.
    pub content_hash: String,
    /// The skeleton of the pack's motion.
    pub skeleton: Skeleton,
    /// The skeleton's hinges; only a robot's has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotDoc>,
    /// The highest speeds and so on in the motion of the training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsDoc>,
    /// Fields of packs of the family UniMoGen alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) unimogen: Option<UniMoGenDoc>,
    /// Fields of packs of the family VerMo alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) vermo: Option<VerMoDoc>,
    /// Fields of packs of NVIDIA's planner alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) sonic_planner: Option<SonicPlannerDoc>,
    /// How the pack was trained; free.
    #[serde(default)]
    pub training: toml::Table,
    /// How good its motion is; free.
    #[serde(default)]
    pub evaluation: toml::Table,
}

impl Manifest {
    /// Reads a manifest from TOML text. This checks the form alone; [`Manifest::check`] checks the
    /// values.
    ///
    /// # Errors
    /// [`PackProblem::Format`] or [`PackProblem::Parse`].
    pub fn parse(text: &str) -> Result<Self, PackProblem> {
        #[derive(Deserialize)]
        struct Version {
            format: u32,
        }
        #[derive(Deserialize)]
        #[expect(dead_code, reason = "only that they are there")]
        struct Required {
            family: String,
            capabilities: Capabilities,
        }
        // The format is read first: a manifest of another format would fail with confusing errors
        // about fields.
        let Version { format: found } = toml::from_str(text)?;
        if !(1..=FORMAT).contains(&found) {
            return Err(PackProblem::Format {
                found,
                supported: FORMAT,
            });
        }
        let manifest: Self = toml::from_str(text)?;
        if found == 1 {
            return Ok(Self {
                family: format_1_family(),
                capabilities: format_1_capabilities(),
                ..manifest
            });
        }
        // Format 2 has no defaults for what it is about.
        let Required { .. } = toml::from_str(text)?;
        Ok(manifest)
    }

    /// Checks all values and gives the sizes that follow from them.
    ///
    /// # Errors
    /// [`PackProblem::Field`] for the first value out of its range.
    pub fn check(&self) -> Result<Dims, PackProblem> {
        let name_ok = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
        if self.name.is_empty() || self.name.len() > 64 || !self.name.chars().all(name_ok) {
            return Err(field("name", &self.name, "1 to 64 of a-z, 0-9, - and _"));
        }
        if self.fps != FPS {
            let why = "30: sessions and output rates count time in frames of 1/30 s";
            return Err(field("fps", self.fps, why));
        }
        let family = self.family();
        let least_targets = match family {
            Some(Family::VerMo | Family::SonicPlanner) => 0,
            Some(Family::MotionBricks | Family::UniMoGen) | None => 1,
        };
        let ranges = [
            ("frames_per_token", self.frames_per_token, 1, 64),
            ("min_tokens", self.min_tokens, 1, 1024),
            ("max_tokens", self.max_tokens, self.min_tokens, 1024),
            ("context_frames", self.context_frames, 1, 64),
            ("max_targets", self.max_targets, least_targets, 64),
        ];
        for (name, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(field(name, value, format!("{low} to {high}")));
            }
        }
        if family == Some(Family::MotionBricks) {
            for (name, value, low, high) in [("heads", self.heads, 1, 64), ("codes", self.codes, 2, 65_536)] {
                if !(low..=high).contains(&value) {
                    return Err(field(name, value, format!("{low} to {high}")));
                }
            }
        }
        if let Some(choices) = self.root_choices {
            if family != Some(Family::MotionBricks) {
                return Err(field("root_choices", choices, "none, because of the family"));
            }
            if !(1..=MAX_ROOT_CHOICES).contains(&choices) {
                return Err(field("root_choices", choices, format!("1 to {MAX_ROOT_CHOICES}")));
            }
        }
        if self.capabilities.list().next().is_none() {
            let all = Capability::ALL.map(Capability::name).join(", ");
            return Err(field("capabilities", "none", format!("at least one of {all}")));
        }
        let hash = self.content_hash.strip_prefix("sha256:").unwrap_or_default();
        if hash.len() != 64 || !hash.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(field(
                "content_hash",
                &self.content_hash,
                "sha256: and 64 hexadecimal digits",
            ));
        }
        let contacts = self
            .skeleton
            .contacts
            .as_ref()
            .map_or(0, |contacts| contacts.len());
        if contacts == 0 {
            return Err(field("skeleton.contacts.joints", "empty", "at least one joint"));
        }
        let dims = Dims {
            joints: self.skeleton.joint_count(),
            contacts,
            heads: self.heads,
            codes: self.codes,
            min_tokens: self.min_tokens,
            max_tokens: self.max_tokens,
            frames_per_token: self.frames_per_token,
            context_frames: self.context_frames,
            max_targets: self.max_targets,
            root_choices: self.root_choices.unwrap_or(0),
        };
        let keyframes = dims.slots();
        if keyframes > dims.max_frames() {
            let allowed = format!("at least {keyframes}: the frames of context and target keyframes");
            return Err(field("max_tokens x frames_per_token", dims.max_frames(), allowed));
        }
        self.check_family(&dims)?;
        Ok(dims)
    }

    /// Checks that the manifest has the table of its own family and of no other, and the table's
    /// values.
    fn check_family(&self, dims: &Dims) -> Result<(), PackProblem> {
        let family = self.family();
        for (name, allowed, has, needs) in [
            (
                "unimogen",
                "the table [unimogen]",
                self.unimogen.is_some(),
                family == Some(Family::UniMoGen),
            ),
            (
                "vermo",
                "the table [vermo]",
                self.vermo.is_some(),
                family == Some(Family::VerMo),
            ),
            (
                "sonic_planner",
                "the table [sonic_planner]",
                self.sonic_planner.is_some(),
                family == Some(Family::SonicPlanner),
            ),
        ] {
            match (has, needs) {
                (false, true) => return Err(field(name, "missing", allowed)),
                (true, false) => return Err(field(name, "present", "none, because of the family")),
                (true, true) | (false, false) => {}
            }
        }
        if let Some(table) = &self.unimogen {
            table.check(dims)?;
        }
        if let Some(table) = &self.vermo {
            table.check(dims, self.capabilities)?;
        }
        if let Some(table) = &self.sonic_planner {
            table.check(dims, self.capabilities)?;
        }
        Ok(())
    }

    /// The words that the network knows; none for a family without words.
    pub(super) fn words(&self) -> &[String] {
        match (&self.unimogen, &self.sonic_planner) {
            (Some(table), _) => &table.words,
            (None, Some(table)) => &table.modes,
            (None, None) => &[],
        }
    }

    /// The family that runs the pack; none if the engine does not know the name.
    pub(crate) fn family(&self) -> Option<Family> {
        Family::of(&self.family)
    }

    /// The free tables as JSON text: `{"training": {..}, "evaluation": {..}}`.
    pub fn figures_json(&self) -> String {
        serde_json::json!({ "training": self.training, "evaluation": self.evaluation }).to_string()
    }
}

fn format_1_family() -> String {
    Family::MotionBricks.name().to_owned()
}

fn format_1_capabilities() -> Capabilities {
    Capabilities {
        inbetween: true,
        live: true,
        ..Capabilities::default()
    }
}

pub(super) fn field(field: &'static str, found: impl ToString, allowed: impl Into<String>) -> PackProblem {
    PackProblem::Field {
        field,
        found: found.to_string(),
        allowed: allowed.into(),
    }
}
