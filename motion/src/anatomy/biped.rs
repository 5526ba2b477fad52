//! Finds a two-legged body among joints, by names and by how they hang together.

use super::names::{Name, Side};
use crate::skeleton::Skeleton;

/// Joints of a two-legged body, as indices. Pairs are left, right.
#[derive(Clone, Debug, PartialEq)]
pub struct Biped {
    /// The joint that both legs hang on.
    pub pelvis: usize,
    /// The joint of each leg that turns the thigh.
    pub hips: [usize; 2],
    /// Ankles: the first joint of each foot.
    pub feet: [usize; 2],
    /// The head, or the neck if there is no head; the end of the spine.
    pub head: usize,
    /// The joints from the pelvis to the head, both included.
    pub spine: Vec<usize>,
    /// Each arm from the shoulder to the wrist, if both were found.
    pub arms: Option<[[usize; 3]; 2]>,
}

const FOOT: [&str; 2] = ["foot", "ankle"];
const HAND: [&str; 2] = ["hand", "wrist"];
/// Joints of a leg with the pelvis: a hip, a knee and an ankle.
const LEAST_LEG: usize = 4;
const ELBOW: [&str; 4] = ["elbow", "forearm", "radius", "fore"];

/// Parents and names of joints, an entry each.
pub struct Tree {
    /// The names, taken apart.
    pub names: Vec<Name>,
    /// Indices of the parents, smaller than the joint's own.
    pub parents: Vec<Option<usize>>,
}

impl Tree {
    /// The joints of a skeleton.
    pub fn of(skeleton: &Skeleton) -> Self {
        let joints = skeleton.joints.iter();
        Self {
            names: joints.clone().map(|joint| Name::of(&joint.name)).collect(),
            parents: joints.map(|joint| joint.parent).collect(),
        }
    }

    /// A joint and all above it.
    pub fn line(&self, joint: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(joint), |&joint| self.parents[joint])
    }

    /// For each joint, whether it is this one or hangs on it.
    pub fn below(&self, joint: usize) -> Vec<bool> {
        let mut below = vec![false; self.parents.len()];
        for other in joint..below.len() {
            below[other] = other == joint || self.parents[other].is_some_and(|parent| below[parent]);
        }
        below
    }

    /// For each joint, those that hang on it directly.
    pub fn children(&self) -> Vec<Vec<usize>> {
        let mut children = vec![Vec::new(); self.parents.len()];
        for (joint, parent) in self.parents.iter().enumerate() {
            if let Some(parent) = *parent {
                children[parent].push(joint);
            }
        }
        children
    }

    /// The joints from one above to one below, both included; none if it is not above.
    pub fn chain(&self, above: usize, below: usize) -> Option<Vec<usize>> {
        let mut chain: Vec<usize> = self.line(below).take_while(|&joint| joint != above).collect();
        let top = chain.last().map_or(Some(below), |&last| self.parents[last]);
        if top != Some(above) {
            return None;
        }
        chain.push(above);
        chain.reverse();
        Some(chain)
    }

    /// The joints that `is` names and no joint above them.
    fn topmost(&self, is: impl Fn(&Name) -> bool) -> Vec<usize> {
        // Whether one was found at each joint or above it.
        let mut has = vec![false; self.names.len()];
        let mut topmost = Vec::new();
        for (joint, name) in self.names.iter().enumerate() {
            has[joint] = self.parents[joint].is_some_and(|parent| has[parent]);
            if !has[joint] && !name.is_helper() && is(name) {
                has[joint] = true;
                topmost.push(joint);
            }
        }
        topmost
    }

    /// The only topmost joint of each side with one of some words.
    fn pair(&self, words: &[&str]) -> Option<[usize; 2]> {
        let [left, right] = Side::BOTH.map(|side| {
            let found = self.topmost(|name| name.side == Some(side) && name.has_any(words));
            match found[..] {
                [only] => Some(only),
                _ => None,
            }
        });
        Some([left?, right?])
    }

    /// The lowest joint above both.
    pub(super) fn meeting(&self, a: usize, b: usize) -> Option<usize> {
        let mut is_above = vec![false; self.parents.len()];
        self.line(a).for_each(|joint| is_above[joint] = true);
        self.line(b).find(|&joint| is_above[joint])
    }
}

impl Biped {
    /// The body of a file's joints; none if it has no two feet, or no head, by name.
    pub fn find(tree: &Tree) -> Option<Self> {
        let feet = tree.pair(&FOOT)?;
        let pelvis = tree.meeting(feet[0], feet[1])?;
        let [left, right] = feet.map(|foot| tree.chain(pelvis, foot));
        let legs = [left?, right?];
        if legs.iter().any(|leg| leg.len() < LEAST_LEG) {
            return None;
        }
        let hips = [hip(tree, &legs[0]), hip(tree, &legs[1])];
        let named = ["head", "neck"].iter().find_map(|word| {
            let found = tree.topmost(|name| name.side.is_none() && name.has(word));
            // Several necks follow each other; the topmost is one.
            found
                .into_iter()
                .find(|&joint| tree.chain(pelvis, joint).is_some())
        });
        let head = named.or_else(|| top_of_spine(tree))?;
        let spine = tree.chain(pelvis, head)?;
        let arms = tree.pair(&HAND).and_then(|[left, right]| {
            let chest = tree.meeting(left, right)?;
            Some([arm(tree, chest, left)?, arm(tree, chest, right)?])
        });
        Some(Self {
            pelvis,
            hips,
            feet,
            head,
            spine,
            arms,
        })
    }
}

/// The last joint above the arms that is of the spine by name: in Rigify's rigs neck and head are.
fn top_of_spine(tree: &Tree) -> Option<usize> {
    let [left, right] = tree.pair(&HAND)?;
    let chest = tree.meeting(left, right)?;
    let is_spine = |&joint: &usize| tree.names[joint].side.is_none() && tree.names[joint].has("spine");
    let above = (chest + 1..tree.names.len()).filter(is_spine);
    let chains = above.filter_map(|joint| Some((tree.chain(chest, joint)?.len(), joint)));
    chains.max().map(|(_, joint)| joint)
}

/// Whether a joint turns a bone: twist joints and ends do not.
fn is_bone(name: &Name) -> bool {
    !name.is_helper() && !name.has("end")
}

/// The joints of a limb that turn its bones. Twist joints do not count, nor further joints along a
/// bone, which have its name with a number: `thigh.L.001` below `thigh.L`.
fn bones(tree: &Tree, limb: &[usize]) -> Vec<usize> {
    let names = &tree.names;
    let mut all: Vec<usize> = limb.to_vec();
    all.retain(|&joint| is_bone(&names[joint]));
    let is_further = |nth: usize| {
        let same = |a: &Name, b: &Name| (a.side, &a.words) == (b.side, &b.words);
        let name = &names[all[nth]];
        name.is_numbered && nth > 0 && same(name, &names[all[nth - 1]])
    };
    let first: Vec<usize> = (0..all.len()).filter(|&nth| !is_further(nth)).collect();
    // In a rig that numbers all its joints they are the bones.
    match first.len() < 2 {
        true => all,
        false => first.into_iter().map(|nth| all[nth]).collect(),
    }
}

/// The joint that turns the thigh: that before the knee, which is before the foot.
fn hip(tree: &Tree, leg: &[usize]) -> usize {
    let joints = bones(tree, &leg[1..leg.len() - 1]);
    match joints[..] {
        [.., hip, _knee] => hip,
        // The knee is a helper by its name, or the hip is.
        [only] => only.min(leg[leg.len() - 3]),
        [] => leg[1],
    }
}

/// Shoulder, elbow and wrist.
fn arm(tree: &Tree, chest: usize, wrist: usize) -> Option<[usize; 3]> {
    let chain = tree.chain(chest, wrist)?;
    // A hand that carries the other is no end of an arm.
    let joints = bones(tree, chain.get(1..chain.len() - 1)?);
    let named = joints.iter().position(|&joint| {
        let name = &tree.names[joint];
        name.has_any(&ELBOW) || (name.has("lower") && name.has("arm"))
    });
    let elbow = named.or(joints.len().checked_sub(1))?;
    let shoulder = elbow.checked_sub(1)?;
    Some([joints[shoulder], joints[elbow], wrist])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(joints: &[(&str, Option<usize>)]) -> Tree {
        Tree {
            names: joints.iter().map(|joint| Name::of(joint.0)).collect(),
            parents: joints.iter().map(|joint| joint.1).collect(),
        }
    }

    /// A body in the words of a program.
    fn rig(words: [&'static str; 12]) -> Tree {
        let [
            hips,
            spine,
            neck,
            head,
            thigh,
            knee,
            foot,
            toe,
            clavicle,
            shoulder,
            elbow,
            hand,
        ] = words;
        let mut joints = vec![
            (hips.to_owned(), None),
            (spine.to_owned(), Some(0)),
            (neck.to_owned(), Some(1)),
            (head.to_owned(), Some(2)),
        ];
        for side in ["Left", "Right"] {
            for (nth, word) in [thigh, knee, foot, toe].into_iter().enumerate() {
                let parent = if nth == 0 { 0 } else { joints.len() - 1 };
                joints.push((word.replace('*', side), Some(parent)));
            }
            for (nth, word) in [clavicle, shoulder, elbow, hand].into_iter().enumerate() {
                let parent = if nth == 0 { 1 } else { joints.len() - 1 };
                joints.push((word.replace('*', side), Some(parent)));
            }
        }
        let joints: Vec<(&str, Option<usize>)> =
            joints.iter().map(|(name, parent)| (&**name, *parent)).collect();
        tree(&joints)
    }

    #[test]
    fn bodies_of_many_programs_are_found() {
        for words in [
            [
                "mixamorig:Hips",
                "Spine",
                "Neck",
                "Head",
                "*UpLeg",
                "*Leg",
                "*Foot",
                "*ToeBase",
                "*Shoulder",
                "*Arm",
                "*ForeArm",
                "*Hand",
            ],
            [
                "pelvis",
                "spine1",
                "neck",
                "head",
                "*_hip",
                "*_knee",
                "*_ankle",
                "*_foot",
                "*_collar",
                "*_shoulder",
                "*_elbow",
                "*_wrist",
            ],
            [
                "Hips",
                "Chest",
                "Neck1",
                "Head",
                "*Leg",
                "*Shin",
                "*Foot",
                "*ToeBase",
                "*Shoulder",
                "*Arm",
                "*ForeArm",
                "*Hand",
            ],
            [
                "Hips",
                "Spine",
                "Neck",
                "Head",
                "UpperLeg_*",
                "LowerLeg_*",
                "Foot_*",
                "Toes_*",
                "Shoulder_*",
                "UpperArm_*",
                "LowerArm_*",
                "Hand_*",
            ],
        ] {
            let body = Biped::find(&rig(words)).unwrap_or_else(|| panic!("{words:?}"));
            assert_eq!(
                (body.pelvis, body.hips, body.feet, body.head),
                (0, [4, 12], [6, 14], 3),
                "{words:?}"
            );
            assert_eq!(body.spine, [0, 1, 2, 3]);
            assert_eq!(body.arms, Some([[9, 10, 11], [17, 18, 19]]));
        }
    }

    #[test]
    fn the_head_of_a_rig_without_one_is_the_top_of_its_spine() {
        let mut joints = vec![("DEF-spine", None)];
        let spine = ["001", "002", "003", "004", "005", "006"].map(|n| format!("DEF-spine.{n}"));
        for (nth, name) in spine.iter().enumerate() {
            joints.push((name, Some(nth)));
        }
        let sides = ["L", "R"].map(|side| {
            [
                "thigh",
                "shin",
                "foot",
                "toe",
                "shoulder",
                "upper_arm",
                "forearm",
                "hand",
            ]
            .map(|part| format!("DEF-{part}.{side}"))
        });
        for names in &sides {
            for (nth, name) in names.iter().enumerate() {
                let parent = match nth {
                    0 => 0,
                    4 => 3,
                    _ => joints.len() - 1,
                };
                joints.push((name, Some(parent)));
            }
        }
        let body = Biped::find(&tree(&joints)).unwrap();
        assert_eq!((body.head, body.spine.len()), (6, 7));
        assert_eq!(body.arms, Some([[12, 13, 14], [20, 21, 22]]));
    }

    #[test]
    fn further_joints_along_a_bone_are_no_bones() {
        let mut joints = vec![
            ("hips".to_owned(), None),
            ("spine".to_owned(), Some(0)),
            ("head".to_owned(), Some(1)),
        ];
        for side in ["L", "R"] {
            for (chain, top) in [
                (
                    &[
                        "thigh",
                        "thigh.001",
                        "shin",
                        "shin.001",
                        "shin.002",
                        "foot",
                        "toe",
                    ][..],
                    0,
                ),
                (
                    &[
                        "shoulder",
                        "upper_arm",
                        "upper_arm.001",
                        "forearm",
                        "forearm.001",
                        "hand",
                    ],
                    1,
                ),
            ] {
                for (nth, part) in chain.iter().enumerate() {
                    let (part, number) = part.split_at(part.find('.').unwrap_or(part.len()));
                    let parent = if nth == 0 { top } else { joints.len() - 1 };
                    joints.push((format!("{part}.{side}{number}"), Some(parent)));
                }
            }
        }
        let joints: Vec<(&str, Option<usize>)> =
            joints.iter().map(|(name, parent)| (&**name, *parent)).collect();
        let body = Biped::find(&tree(&joints)).unwrap();
        assert_eq!((body.hips, body.feet), ([3, 16], [8, 21]));
        assert_eq!(body.arms, Some([[11, 13, 15], [24, 26, 28]]));
    }

    #[test]
    fn a_hip_with_the_name_of_a_helper_is_a_hip() {
        let mut joints = vec![("Hips", None), ("Spine", Some(0)), ("Head", Some(1))];
        for side in [
            ["LeftLegCtrl", "LeftLeg", "LeftFoot"],
            ["RightLegCtrl", "RightLeg", "RightFoot"],
        ] {
            for (nth, name) in side.into_iter().enumerate() {
                let parent = if nth == 0 { 0 } else { joints.len() - 1 };
                joints.push((name, Some(parent)));
            }
        }
        let body = Biped::find(&tree(&joints)).unwrap();
        assert_eq!((body.hips, body.feet), ([3, 6], [5, 8]));
    }

    #[test]
    fn other_bodies_are_none() {
        let four = tree(&[
            ("root", None),
            ("head", Some(0)),
            ("front_foot_l", Some(0)),
            ("back_foot_l", Some(0)),
            ("front_foot_r", Some(0)),
            ("back_foot_r", Some(0)),
        ]);
        assert_eq!(Biped::find(&four), None);
        assert_eq!(Biped::find(&tree(&[("a", None), ("b", Some(0))])), None);
        assert_eq!(Biped::find(&tree(&[])), None);
    }
}
