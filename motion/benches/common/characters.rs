//! Pairs of bodies for the bench of retargeting.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::{Figure, Retargeter};
use troupe_motion::robot::RobotDoc;
use troupe_motion::skeleton::Joint;
use troupe_motion::{Clip, Quat, Skeleton, Vec3};

/// Joints of a finger, and fingers of a hand.
const FINGERS: (usize, usize) = (4, 5);

#[derive(Deserialize)]
struct Pack {
    skeleton: Skeleton,
    robot: RobotDoc,
}

/// A motion on its way to another body.
pub struct Carried {
    retargeter: Retargeter,
    clip: Clip,
    frame: usize,
    pose: Vec<Quat>,
}

impl Carried {
    /// Onto a character of 66 joints with fingers and twists, as games have them.
    pub fn to_character(clip: &Clip) -> Self {
        let skeleton = Arc::new(character());
        let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
        let target = Figure::new(skeleton, &rest, None, &PartsDoc::default()).unwrap();
        Self::new(clip, target)
    }

    /// Onto the G1.
    pub fn to_robot(clip: &Clip) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1/pack.toml");
        let pack: Pack = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        let robot = Arc::new(pack.skeleton.with_robot(&pack.robot).unwrap());
        Self::new(clip, Figure::of_robot(robot, &PartsDoc::default()).unwrap())
    }

    fn new(clip: &Clip, target: Figure) -> Self {
        let source = Figure::of_clip(clip, None, &PartsDoc::default()).unwrap();
        let pose = vec![Quat::IDENTITY; target.skeleton().joint_count()];
        Self {
            retargeter: Retargeter::new(source, target).unwrap(),
            clip: clip.clone(),
            frame: 0,
            pose,
        }
    }

    /// Carries the next frame over.
    pub fn next(&mut self) -> Vec3 {
        self.frame = (self.frame + 1) % self.clip.frames();
        let root = self.clip.root_positions[self.frame];
        self.retargeter
            .pose(root, self.clip.rotations_at(self.frame), &mut self.pose)
    }

    pub fn retargeter(&self) -> &Retargeter {
        &self.retargeter
    }
}

/// A body in a T-pose.
fn character() -> Skeleton {
    let mut joints: Vec<Joint> = Vec::new();
    let mut add = |name: String, parent: Option<usize>, offset: [f32; 3]| {
        joints.push(Joint {
            name,
            parent,
            offset_m: Vec3::from(offset),
        });
        joints.len() - 1
    };
    let root = add("root".to_owned(), None, [0.0; 3]);
    let pelvis = add("pelvis".to_owned(), Some(root), [0.0, 0.95, 0.0]);
    let mut chest = pelvis;
    for nth in 1..=3 {
        chest = add(format!("spine_0{nth}"), Some(chest), [0.0, 0.14, 0.0]);
    }
    let neck = add("neck_01".to_owned(), Some(chest), [0.0, 0.16, 0.0]);
    add("head".to_owned(), Some(neck), [0.0, 0.1, 0.0]);
    for (side, x) in [("l", 1.0), ("r", -1.0)] {
        let mut chain = |first: usize, bones: &[(&str, [f32; 3])]| {
            bones.iter().fold(first, |above, (name, offset)| {
                add(format!("{name}_{side}"), Some(above), *offset)
            })
        };
        let leg = [
            ("thigh", [0.09 * x, -0.04, 0.0]),
            ("calf", [0.0, -0.43, 0.0]),
            ("foot", [0.0, -0.4, 0.0]),
            ("ball", [0.0, -0.07, 0.14]),
        ];
        chain(pelvis, &leg);
        let arm = [
            ("clavicle", [0.03 * x, 0.13, 0.0]),
            ("upperarm", [0.14 * x, 0.0, 0.0]),
            ("lowerarm", [0.28 * x, 0.0, 0.0]),
            ("hand", [0.26 * x, 0.0, 0.0]),
        ];
        let hand = chain(chest, &arm);
        for finger in 0..FINGERS.1 {
            let mut above = hand;
            for joint in 0..FINGERS.0 {
                let across = if joint == 0 {
                    0.02 * (finger as f32 - 2.0)
                } else {
                    0.0
                };
                let name = format!("finger_{finger}_{joint}_{side}");
                above = add(name, Some(above), [0.03 * x, 0.0, across]);
            }
        }
    }
    for nth in 0..3 {
        add(format!("hair_{nth}"), Some(neck), [0.0, 0.2, -0.1]);
    }
    Skeleton::new(joints, Vec3::X, 0.0, None).unwrap()
}
