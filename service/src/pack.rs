//! The public description of a pack.

use troupe_character::object::Definition;
use troupe_character::skill::Skills;
use troupe_engine::pack::{Language, Pack};
use troupe_live::wire::{joint_message, robot_message, vector_message};
use troupe_motion::Skeleton;
use troupe_motion::model::Body;
use troupe_proto::v1;

/// The public description of a pack. `engine` runs it, and `skills` are those of its characters.
pub(crate) fn describe(pack: &Pack, skills: &Skills, is_default: bool, engine: &str) -> v1::Pack {
    let manifest = &pack.manifest;
    let (skeleton, dims) = (&pack.rig.skeleton, &pack.rig.dims);
    let contacts = skeleton.contacts.as_ref();
    v1::Pack {
        name: manifest.name.clone(),
        version: manifest.version.clone(),
        licence: manifest.licence.clone(),
        credits: manifest.credits.clone(),
        fps: manifest.fps,
        joints: skeleton.joints.iter().map(joint_message).collect(),
        left_axis: Some(vector_message(skeleton.left_axis)),
        ground_y: skeleton.ground_y_m,
        contact_joints: contact_joints(skeleton),
        contact_rules: contacts.map(|contacts| v1::ContactRules {
            max_height: contacts.max_height_m.clone(),
            max_speed: contacts.max_speed_mps,
            clearance: contacts.clearance_m.clone(),
        }),
        context_frames: dims.context_frames as u32,
        max_targets: dims.max_targets as u32,
        min_frames: dims.min_frames() as u32,
        max_frames: dims.max_frames() as u32,
        frames_per_token: dims.frames_per_token as u32,
        heads: dims.heads as u32,
        codes: dims.codes as u32,
        content_hash: manifest.content_hash.clone(),
        is_default,
        parameters: manifest.parameters,
        figures_json: manifest.figures_json(),
        engine: engine.to_owned(),
        family: manifest.family.clone(),
        capabilities: manifest
            .capabilities
            .list()
            .map(|able| able.name().to_owned())
            .collect(),
        robot: (skeleton.robot.as_ref()).map(|robot| robot_message(robot, skeleton)),
        bodies: default_first(pack).map(describe_body).collect(),
        words: pack.words.clone(),
        sampler_steps: pack.sampler().map_or(0, |steps| steps.default),
        diffusion_steps: pack.sampler().map_or(0, |steps| steps.max),
        language: pack.language().map(describe_language),
        skills: skills.iter().map(|skill| describe_skill(skill)).collect(),
    }
}

fn describe_skill(skill: &Definition) -> v1::PackSkill {
    v1::PackSkill {
        name: skill.name.clone(),
        description: skill.description.clone(),
        variants: (skill.variants.iter())
            .map(|variant| variant.name.clone())
            .collect(),
        held: skill.is_held(),
    }
}

fn describe_language(language: Language<'_>) -> v1::Language {
    let usual = language.sampling();
    v1::Language {
        tasks: language.tasks().map(str::to_owned).collect(),
        max_prompt_pieces: language.max_prompt_pieces() as u32,
        max_agents: language.max_agents() as u32,
        audio_codes: language.audio_codes() as u32,
        flow_steps: language.flow_steps() as u32,
        sampling: Some(v1::Sampling {
            temperature: usual.temperature,
            top_k: usual.top_k,
            top_p: usual.top_p,
            repetition: usual.repetition,
        }),
    }
}

/// The pack's bodies. The default body comes first.
fn default_first(pack: &Pack) -> impl Iterator<Item = &Body> {
    let first = pack.body("").map(|body| &**body);
    let others = pack.bodies.iter().map(|body| &**body);
    let others = others.filter(move |body| first.is_none_or(|first| first.name != body.name));
    first.into_iter().chain(others)
}

fn describe_body(body: &Body) -> v1::PackBody {
    let skeleton = &body.rig.skeleton;
    v1::PackBody {
        name: body.name.clone(),
        joints: skeleton.joints.iter().map(joint_message).collect(),
        contact_joints: contact_joints(skeleton),
        left_axis: Some(vector_message(skeleton.left_axis)),
        robot: (skeleton.robot.as_ref()).map(|robot| robot_message(robot, skeleton)),
        height: body.height_m,
        words: body.words.clone(),
    }
}

fn contact_joints(skeleton: &Skeleton) -> Vec<String> {
    let joints = skeleton.contacts.iter().flat_map(|contacts| &contacts.joints);
    joints.map(|&joint| skeleton.joints[joint].name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use troupe_engine::pack::Manifest;

    use super::*;

    const MANIFEST: &str = r#"
format = 1
name = "toy"
version = "1.0.0"
licence = "Apache-2.0"
credits = ["Somebody"]
fps = 30.0
frames_per_token = 4
min_tokens = 3
max_tokens = 16
heads = 4
codes = 256
context_frames = 4
max_targets = 4
parameters = 12
content_hash = "sha256:0000000000000000000000000000000000000000000000000000000000000000"

[training]
steps = 10

[skeleton]
left_axis = [1.0, 0.0, 0.0]
[[skeleton.joints]]
name = "Hips"
parent = ""
offset_m = [0.0, 0.9, 0.0]
[[skeleton.joints]]
name = "Foot"
parent = "Hips"
offset_m = [0.0, -0.85, 0.0]
[skeleton.contacts]
joints = ["Foot"]
max_height_m = [0.1]
max_speed_mps = 0.3
clearance_m = [0.05]
"#;

    const ROBOT: &str = r#"
[robot]
name = "hopper"
[[robot.hinges]]
joint = "Foot"
axis = [1.0, 0.0, 0.0]
rest = [1.0, 0.0, 0.0, 0.0]
lower_rad = -0.5
upper_rad = 1.5
max_speed_rad_per_s = 9.0
"#;

    const FOLLOWER: &str = r#"
[[robot.mimics]]
joint = "Toe"
follows = "Foot"
multiplier = -0.5
offset_rad = 0.1
axis = [1.0, 0.0, 0.0]
rest = [1.0, 0.0, 0.0, 0.0]
[[skeleton.joints]]
name = "Toe"
parent = "Foot"
offset_m = [0.0, 0.0, 0.1]
"#;

    fn described(text: &str, is_default: bool) -> v1::Pack {
        let pack = Pack::from_manifest(Manifest::parse(text).unwrap(), Path::new("toy")).unwrap();
        describe(&pack, &Skills::default(), is_default, "cpu")
    }

    #[test]
    fn a_pack_describes_itself() {
        let public = described(MANIFEST, true);
        assert_eq!(
            (public.name.as_str(), public.max_frames, public.is_default),
            ("toy", 64, true)
        );
        assert_eq!(public.joints[0].parent, -1);
        assert_eq!(
            (public.joints[1].parent, public.contact_joints),
            (0, vec!["Foot".to_owned()])
        );
        assert_eq!(
            public.figures_json,
            r#"{"evaluation":{},"training":{"steps":10}}"#
        );
        assert_eq!(public.robot, None);
    }

    #[test]
    fn a_robot_tells_its_hinges() {
        let public = described(&format!("{MANIFEST}{ROBOT}"), false).robot.unwrap();
        assert_eq!((public.name.as_str(), public.qpos_size), ("hopper", 8));
        assert_eq!(
            (public.hinges[0].joint.as_str(), public.hinges[0].max_speed),
            ("Foot", 9.0)
        );
        assert!(public.mimics.is_empty());
        let public = described(&format!("{MANIFEST}{ROBOT}{FOLLOWER}"), false)
            .robot
            .unwrap();
        let toe = &public.mimics[0];
        assert_eq!((toe.joint.as_str(), toe.follows.as_str()), ("Toe", "Foot"));
        assert_eq!((toe.multiplier, toe.offset), (-0.5, 0.1));
    }
}
