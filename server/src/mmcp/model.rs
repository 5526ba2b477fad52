//! Models of the protocol. A loaded pack is one model, or one for each of its bodies.

use std::sync::Arc;

use serde::Serialize;
use serde_json::{Value, json};
use troupe_character::style::StyleTable;
use troupe_character::take::{Follower, Subject};
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::model::{Body, Capability, Rig};
use troupe_motion::{Quat, Vec3};

use super::limits::{
    MAX_BATCH, MAX_CONSTRAINTS, MAX_REFERENCE_FRAMES, MAX_SAMPLES, MAX_SECONDS, MAX_VALUES,
    RECOMMENDED_SECONDS, TEMPERATURES,
};
use super::options::Planner;
use super::schema::{Joint, Skeleton, coordinates, units};
use super::skeleton::Axes;
use troupe_live::packs::{LoadedPack, PackTable};
use troupe_live::skeleton::{can_wear, is_on_two_legs};
use troupe_live::wire::MAX_PROMPT_CHARS;
use troupe_service::inbetween::fitting;

/// The protocol version of this server.
pub const VERSION: &str = "1.4";

/// A pack or one of its bodies, as a model of the protocol.
#[derive(Debug, Clone)]
pub struct Model {
    /// The pack's name, or `PACK/BODY`.
    pub id: String,
    /// The pack that makes the motion.
    pub loaded: Arc<LoadedPack>,
    /// Index of the body in the pack. 0 for a pack with one skeleton.
    pub place: usize,
}

/// All models. Those of the default pack come first.
pub fn models(table: &PackTable) -> Vec<Model> {
    let mut packs: Vec<&Arc<LoadedPack>> = table.all().collect();
    packs.sort_by_key(|loaded| !table.is_default(loaded));
    packs.into_iter().flat_map(of_pack).collect()
}

fn of_pack(loaded: &Arc<LoadedPack>) -> Vec<Model> {
    let model = |id: String, place| Model {
        id,
        loaded: loaded.clone(),
        place,
    };
    let name = loaded.pack.name();
    if loaded.pack.bodies.is_empty() {
        return vec![model(name.to_owned(), 0)];
    }
    let first = loaded.place_of("", "").unwrap_or(0);
    let bodies = loaded.pack.bodies.iter().enumerate();
    let mut bodies: Vec<Model> = bodies
        .map(|(place, body)| model(format!("{name}/{}", body.name), place))
        .collect();
    bodies.sort_by_key(|model| model.place != first);
    bodies
}

impl Model {
    /// The rig that the model animates.
    pub fn rig(&self) -> &Arc<Rig> {
        self.loaded.rig(self.place)
    }

    /// The body. None: the pack has one skeleton.
    pub fn body(&self) -> Option<&Arc<Body>> {
        self.loaded.pack.bodies.get(self.place)
    }

    /// The locomotion styles of the body.
    pub fn styles(&self) -> &Arc<StyleTable> {
        &self.loaded.styles[self.place]
    }

    fn can(&self, capability: Capability) -> bool {
        self.loaded.pack.manifest.capabilities.has(capability)
    }

    /// Whether the model makes motion from keyframe to keyframe, and walks in a style between them.
    pub fn walks(&self) -> bool {
        self.loaded.walks(self.place)
    }

    /// Whether the model follows paths.
    pub fn follows(&self) -> bool {
        self.can(Capability::Path) && self.body().is_some()
    }

    /// Whether the model acts out words.
    pub fn speaks(&self) -> bool {
        self.can(Capability::Text)
    }

    /// Whether the model imitates a reference motion: it describes the motion in words and acts
    /// those out.
    pub fn imitates(&self) -> bool {
        self.speaks() && self.can(Capability::Describe)
    }

    /// Whether motion of the model can be carried over to other bodies.
    pub fn can_be_worn(&self, table: &PackTable) -> bool {
        can_wear((&self.loaded, self.place), table)
    }

    /// Most frames of a reference motion.
    pub fn max_reference_frames(&self) -> usize {
        let language = self.loaded.pack.language();
        language.map_or(MAX_REFERENCE_FRAMES, |language| language.max_frames())
    }

    /// What a take of this model animates.
    pub fn subject(&self) -> Subject {
        let pack = &self.loaded.pack;
        let (rest, rest_height_m) = self.rest();
        let body = self.body().filter(|_| self.follows());
        Subject {
            rig: self.rig().clone(),
            rest,
            rest_height_m,
            follower: body.map(|body| Follower {
                body: body.clone(),
                words: pack.words.as_slice().into(),
                steps: pack.sampler().map_or(1, |steps| steps.default),
            }),
        }
    }

    /// The first words of a description that the model made itself, as many as fit into a prompt.
    pub fn fitting(&self, text: &str) -> String {
        fitting(&self.loaded.pack, text)
    }

    /// Types of segments that the model takes.
    pub fn segments(&self) -> Vec<&'static str> {
        let all = [
            ("text", self.speaks()),
            ("motion_reference", self.imitates()),
            ("unconditioned", self.walks() || self.follows()),
        ];
        names(&all)
    }

    /// Types of constraints that the model takes.
    pub fn constraints(&self) -> Vec<&'static str> {
        let moves = self.walks() || self.follows();
        let all = [
            ("root_path", moves),
            ("effector_target", self.walks()),
            ("pose_keyframe", self.walks()),
            ("ground_height", moves),
        ];
        names(&all)
    }

    /// Types of guidance that the model takes.
    pub fn guidance(&self) -> Vec<&'static str> {
        names(&[("nocfg", true), ("regular", self.follows())])
    }

    /// Names of the styles, as many as an option may list. The default style comes first, if any.
    pub fn style_names(&self) -> Vec<String> {
        if self.follows() {
            let words = self.body().map(|body| body.words.clone()).unwrap_or_default();
            return words.into_iter().take(MAX_VALUES).collect();
        }
        let default = self.styles().default_style().map(|style| style.name.clone());
        let others = self.styles().list().into_iter().map(|style| style.name.clone());
        let others = others.filter(|name| Some(name) != default.as_ref());
        default.iter().cloned().chain(others).take(MAX_VALUES).collect()
    }

    /// The rest pose: one local rotation per joint, and the height of the root, metres. The model
    /// stands and faces +Z.
    pub fn rest(&self) -> (Vec<Quat>, f32) {
        let skeleton = &self.rig().skeleton;
        if let Some(body) = self.body() {
            let mut local = vec![Quat::IDENTITY; body.joints()];
            local_from_world_rotations(skeleton, &body.neutral, &mut local);
            return (local, body.height_m);
        }
        match self.styles().default_style() {
            Some(style) => (style.idle().rotations.clone(), style.idle().height_m),
            None => (vec![Quat::IDENTITY; skeleton.joint_count()], 0.0),
        }
    }

    /// The axes of the joints on the wire.
    pub fn axes(&self) -> Axes {
        Axes::new(&self.rig().skeleton, &self.rest().0)
    }

    /// The skeleton at rest. On the wire all joints then have the world's axes, because some
    /// clients ignore the rotations of a rest pose.
    pub fn skeleton(&self) -> Skeleton {
        let (_, height_m) = self.rest();
        let axes = self.axes();
        let joints = &self.rig().skeleton.joints;
        let joint = |joint: &troupe_motion::Joint| Joint {
            name: joint.name.clone(),
            parent: joint.parent.map(|parent| joints[parent].name.clone()),
            rest_translation: match joint.parent {
                Some(parent) => axes.offset(parent, joint.offset_m),
                None => Vec3::Y * height_m,
            }
            .to_array()
            .map(f64::from),
            rest_rotation: [0.0, 0.0, 0.0, 1.0],
            display_name: None,
        };
        Skeleton {
            joints: joints.iter().map(joint).collect(),
            coordinate_system: coordinates(),
            units: units(),
        }
    }

    /// Names of the joints with contacts in an answer, at most eight.
    pub fn contact_joints(&self) -> Vec<String> {
        let skeleton = &self.rig().skeleton;
        let joints = skeleton.contacts.iter().flat_map(|contacts| &contacts.joints);
        joints
            .take(8)
            .map(|&joint| skeleton.joints[joint].name.clone())
            .collect()
    }

    /// Most frames of one call of the networks.
    pub fn window_frames(&self) -> usize {
        let dims = &self.rig().dims;
        dims.max_frames() - dims.context_frames
    }

    /// Options of this model, beside those of the protocol.
    fn options(&self, table: &PackTable) -> Vec<Value> {
        let names = self.style_names();
        let mut options = Vec::new();
        if !names.is_empty() {
            let default = (!self.follows()).then(|| names[0].clone());
            options.push(json!({
                "name": "style",
                "type": "enum",
                "title": "Style",
                "description": "How to move",
                "default": default,
                "values": names,
            }));
        }
        if self.walks() || self.speaks() {
            let [low, high] = TEMPERATURES;
            options.push(json!({
                "name": "temperature",
                "type": "number",
                "title": "Temperature",
                "description": "0 takes the most likely poses, more samples them",
                "default": 1.0,
                "minimum": low,
                "maximum": high,
            }));
        }
        if self.follows() && is_on_two_legs((&self.loaded, self.place), table) {
            options.push(json!({
                "name": "planner",
                "type": "enum",
                "title": "Planner",
                "description": "Who plans a path: another pack that walks (carried), this one (own), or whichever can (auto)",
                "default": Planner::NAMES[0],
                "values": Planner::NAMES,
            }));
        }
        options
    }

    /// The model's entry in the answer to `GET /capabilities`.
    fn describe(&self, table: &PackTable, max_request_bytes: usize) -> Spec {
        let moves = self.walks() || self.follows();
        Spec {
            id: self.id.clone(),
            fps: self.rig().fps,
            canonical_skeleton: self.skeleton(),
            supports_retargeting: self.can_be_worn(table),
            supports_joint_translation: false,
            supports_async: false,
            supports_segment_seed: true,
            supports_loop: moves,
            supports_keyframe_reduction: false,
            model_options: self.options(table),
            supports_motion_reference_mixed: self.imitates(),
            supports_batch: true,
            supports_trajectory: true,
            supported_constraints: self.constraints(),
            supported_segments: self.segments(),
            supported_guidance_types: self.guidance(),
            predicted_contact_joints: self.contact_joints(),
            native_clip_seconds: self.window_frames() as f32 / self.rig().fps,
            chunking: "stitched",
            recommended_max_duration_seconds: RECOMMENDED_SECONDS,
            limits: Limits {
                max_duration_seconds: MAX_SECONDS,
                max_num_samples: MAX_SAMPLES,
                max_constraints_per_request: MAX_CONSTRAINTS,
                max_prompt_length: MAX_PROMPT_CHARS,
                max_request_bytes,
                max_batch_size: MAX_BATCH,
                max_reference_frames: self.imitates().then(|| self.max_reference_frames()),
            },
        }
    }
}

fn names(all: &[(&'static str, bool)]) -> Vec<&'static str> {
    all.iter()
        .filter(|(_, has)| *has)
        .map(|(name, _)| *name)
        .collect()
}

/// The answer to `GET /capabilities`.
#[derive(Debug, Serialize)]
pub struct Capabilities {
    protocol_version: &'static str,
    rotation_format: &'static str,
    coordinate_system: String,
    units: String,
    response_formats: [&'static str; 1],
    models: Vec<Spec>,
}

impl Capabilities {
    /// The capabilities of all models of a table, for requests of at most `max_request_bytes`. A
    /// pack without any capability of the protocol is no model.
    pub fn of(table: &PackTable, max_request_bytes: usize) -> Self {
        let models = models(table).into_iter();
        let models = models.filter(|model| !model.segments().is_empty());
        Self {
            protocol_version: VERSION,
            rotation_format: "quaternion_xyzw",
            coordinate_system: coordinates(),
            units: units(),
            response_formats: ["gltf_2.0_json"],
            models: models
                .map(|model| model.describe(table, max_request_bytes))
                .collect(),
        }
    }
}

#[derive(Debug, Serialize)]
struct Spec {
    id: String,
    fps: f32,
    canonical_skeleton: Skeleton,
    supports_retargeting: bool,
    supports_joint_translation: bool,
    supports_async: bool,
    supports_segment_seed: bool,
    supports_loop: bool,
    supports_keyframe_reduction: bool,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    model_options: Vec<Value>,
    supports_motion_reference_mixed: bool,
    supports_batch: bool,
    supports_trajectory: bool,
    supported_constraints: Vec<&'static str>,
    supported_segments: Vec<&'static str>,
    supported_guidance_types: Vec<&'static str>,
    predicted_contact_joints: Vec<String>,
    native_clip_seconds: f32,
    chunking: &'static str,
    recommended_max_duration_seconds: f32,
    limits: Limits,
}

#[derive(Debug, Serialize)]
struct Limits {
    max_duration_seconds: f32,
    max_num_samples: usize,
    max_constraints_per_request: usize,
    max_prompt_length: usize,
    max_request_bytes: usize,
    max_batch_size: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_reference_frames: Option<usize>,
}
