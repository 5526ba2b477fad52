//! People in the dialects of many programs: their truth, and the file that a program would write.

use std::sync::Arc;

use glam::{DQuat, DVec3, Quat, Vec3};

use crate::bvh::{BvhFile, BvhJoint, Channel, EulerOrder, write};
use crate::clip::Clip;
use crate::read::{RestPose, Up};
use crate::skeleton::{Joint, Skeleton};

/// Names of the joints, with `*` for the side.
const MIXAMO: Words = Words {
    hips: "mixamorig:Hips",
    spine: "mixamorig:Spine",
    head: "mixamorig:Head",
    leg: [
        "mixamorig:*UpLeg",
        "mixamorig:*Leg",
        "mixamorig:*Foot",
        "mixamorig:*ToeBase",
    ],
    arm: [
        "mixamorig:*Shoulder",
        "mixamorig:*Arm",
        "mixamorig:*ForeArm",
        "mixamorig:*Hand",
    ],
    sides: ["Left", "Right"],
};
const SMPL: Words = Words {
    hips: "pelvis",
    spine: "spine",
    head: "head",
    leg: ["*_hip", "*_knee", "*_ankle", "*_foot"],
    arm: ["*_collar", "*_shoulder", "*_elbow", "*_wrist"],
    sides: ["left", "right"],
};
const BANDAI: Words = Words {
    hips: "Hips",
    spine: "Chest",
    head: "Head",
    leg: ["UpperLeg_*", "LowerLeg_*", "Foot_*", "Toes_*"],
    arm: ["Shoulder_*", "UpperArm_*", "LowerArm_*", "Hand_*"],
    sides: ["L", "R"],
};
const DOTS: Words = Words {
    hips: "hips",
    spine: "spine.00",
    head: "head",
    leg: ["thigh.*", "shin.*", "foot.*", "toe.*"],
    arm: ["shoulder.*", "upper_arm.*", "forearm.*", "hand.*"],
    sides: ["L", "R"],
};

struct Words {
    hips: &'static str,
    spine: &'static str,
    head: &'static str,
    leg: [&'static str; 4],
    arm: [&'static str; 4],
    sides: [&'static str; 2],
}

/// A body to make.
#[derive(Clone, Debug)]
pub(crate) struct Person {
    /// Which names: 0 to 3.
    pub(crate) words: usize,
    /// Height of a grown person by this factor of 1.72 m.
    pub(crate) size: f32,
    /// Joints from hips to head, 1 to 4.
    pub(crate) spine: usize,
    pub(crate) rest: RestPose,
}

impl Person {
    /// The skeleton at rest, bones in world axes.
    pub(crate) fn skeleton(&self) -> Arc<Skeleton> {
        let words = [&MIXAMO, &SMPL, &BANDAI, &DOTS][self.words % 4];
        let mut joints = Vec::new();
        let mut add = |name: String, parent: Option<usize>, offset: [f32; 3]| {
            joints.push(Joint {
                name,
                parent,
                offset_m: Vec3::from(offset) * self.size,
            });
            joints.len() - 1
        };
        let hips = add(words.hips.to_owned(), None, [0.0; 3]);
        let mut chest = hips;
        for nth in 0..self.spine {
            let name = format!("{}{}", words.spine, ["", "1", "2", "3"][nth]);
            chest = add(name, Some(chest), [0.0, 0.47 / self.spine as f32, 0.01]);
        }
        add(words.head.to_owned(), Some(chest), [0.0, 0.1, 0.0]);
        let down = match self.rest {
            RestPose::T | RestPose::None => 0.0_f32,
            RestPose::A => 45.0,
            RestPose::Standing => 85.0,
        };
        let (sin, cos) = down.to_radians().sin_cos();
        for (side, x) in words.sides.into_iter().zip([1.0, -1.0]) {
            let name = |word: &str| word.replace('*', side);
            let leg = [
                [0.09 * x, -0.05, 0.0],
                [0.0, -0.42, 0.0],
                [0.0, -0.4, 0.0],
                [0.0, -0.06, 0.13],
            ];
            let mut at = hips;
            for (word, offset) in words.leg.into_iter().zip(leg) {
                at = add(name(word), Some(at), offset);
            }
            let along = |length: f32| [length * cos * x, -length * sin, 0.0];
            let arm = [
                [0.05 * x, -0.05, 0.0],
                [0.12 * x, 0.0, 0.0],
                along(0.28),
                along(0.25),
            ];
            let mut at = chest;
            for (word, offset) in words.arm.into_iter().zip(arm) {
                at = add(name(word), Some(at), offset);
            }
        }
        Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap())
    }

    /// A walk on a curve, with swings of all joints by numbers from 0 to 1.
    pub(crate) fn walk(&self, frames: usize, fps: f32, numbers: &[f32]) -> Clip {
        let skeleton = self.skeleton();
        let number = |nth: usize| numbers[nth % numbers.len()];
        let mut roots = Vec::new();
        let mut rotations = Vec::new();
        for frame in 0..frames {
            let t = frame as f32 / fps;
            let heading = 6.0 * number(0) + t * (number(1) - 0.5);
            let swing = |nth: usize| (3.0 * t * (1.0 + number(nth)) + 6.0 * number(nth + 1)).sin();
            let (sin, cos) = heading.sin_cos();
            roots.push(Vec3::new(
                9.0 * number(2) + 1.2 * t * sin,
                0.94 * self.size + 0.02 * swing(3),
                9.0 * number(3) + 1.2 * t * cos,
            ));
            rotations.push(Quat::from_rotation_y(heading) * Quat::from_rotation_x(0.1 * swing(4)));
            for joint in 1..skeleton.joint_count() {
                let axis = Vec3::new(number(joint) - 0.5, number(joint + 7) - 0.5, 0.3);
                rotations.push(Quat::from_scaled_axis(axis * swing(joint)));
            }
        }
        Clip::new(skeleton, fps, roots, rotations).unwrap()
    }
}

/// How a program writes BVH.
#[derive(Clone, Debug)]
pub(crate) struct Dialect {
    pub(super) order: EulerOrder,
    pub(super) unit_m: f64,
    pub(super) up: Up,
    /// Whether bones stand in the file's axes at rest too, or the world alone.
    pub(super) turns_bones: bool,
    /// Turns of the joints' own axes, one a joint in turn; empty: none.
    pub(super) frames: Vec<DQuat>,
    /// 0: UTF-8, 1: with a mark, 2: UTF-16.
    pub(super) encoding: usize,
    pub(super) line_end: &'static str,
}

impl Dialect {
    pub(crate) fn plain() -> Self {
        Self {
            order: EulerOrder::ZXY,
            unit_m: 0.01,
            up: Up::Y,
            turns_bones: true,
            frames: Vec::new(),
            encoding: 0,
            line_end: "\n",
        }
    }

    /// The turn of a joint's own axes.
    pub(super) fn frame(&self, joint: usize) -> DQuat {
        match self.frames.len() {
            0 => DQuat::IDENTITY,
            count => self.frames[joint % count],
        }
    }

    /// From Troupe's axes to the file's.
    fn turn(&self) -> DQuat {
        match self.up {
            Up::Y => DQuat::IDENTITY,
            // Any axis across would do; the reader turns about X.
            Up::MinusY => DQuat::from_rotation_x(std::f64::consts::PI),
            up => DQuat::from_rotation_arc(DVec3::Y, up.direction()),
        }
    }

    pub(super) fn file(&self, clip: &Clip) -> BvhFile {
        let turn = self.turn();
        let bones = if self.turns_bones { turn } else { DQuat::IDENTITY };
        let joints = &clip.skeleton.joints;
        let turns = self.order.axes().map(|axis| Channel::ALL[3 + axis]);
        let moves = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
        let made = joints.iter().enumerate().map(|(nth, joint)| BvhJoint {
            name: joint.name.clone(),
            parent: joint.parent,
            offset: match joint.parent {
                None => DVec3::ZERO,
                Some(parent) => {
                    self.frame(parent).conjugate() * (bones * joint.offset_m.as_dvec3()) / self.unit_m
                }
            },
            channels: if nth == 0 {
                [moves, turns].concat()
            } else {
                turns.to_vec()
            },
            end_sites: Vec::new(),
        });
        let mut values = Vec::new();
        for (frame, root) in clip.root_positions.iter().enumerate() {
            values.extend((turn * root.as_dvec3() / self.unit_m).to_array());
            for (nth, (joint, rotation)) in joints.iter().zip(clip.rotations_at(frame)).enumerate() {
                let rotation = rotation.as_dquat();
                let above = joint.parent.map_or(DQuat::IDENTITY, |parent| self.frame(parent));
                let world = if joint.parent.is_none() { turn } else { bones };
                let rotation = world * rotation * bones.conjugate();
                let rotation = above.conjugate() * rotation * self.frame(nth);
                values.extend(self.order.angles(rotation).map(f64::to_degrees));
            }
        }
        BvhFile::new(made.collect(), 1.0 / f64::from(clip.fps), values).unwrap()
    }

    pub(crate) fn bytes(&self, clip: &Clip) -> Vec<u8> {
        encoded(
            &write(&self.file(clip)).replace('\n', self.line_end),
            self.encoding,
        )
    }
}

pub(super) fn encoded(text: &str, encoding: usize) -> Vec<u8> {
    match encoding {
        0 => text.as_bytes().to_vec(),
        1 => [b"\xef\xbb\xbf", text.as_bytes()].concat(),
        _ => {
            let units = text.encode_utf16().flat_map(u16::to_le_bytes);
            [0xff, 0xfe].into_iter().chain(units).collect()
        }
    }
}
