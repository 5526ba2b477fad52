//! The skeleton with hinges of a description: hinges in the order of a walk through the tree, as
//! MuJoCo has them; toes and hands found in the shapes.

use glam::{DQuat, DVec3, Vec3};

use super::{DescribedJoint, Description, DescriptionError, Kind, Shape};
use crate::conventions::Convention;
use crate::robot::{HingeDoc, MimicDoc, RobotDoc, RobotError};
use crate::rotation::to_wxyz;
use crate::skeleton::{Joint, Skeleton};

/// Points this near to the extreme one belong to the sole, to its front edge, to the end of a hand,
/// metres.
const LAYER_M: f64 = 0.01;
/// A fixed link nearer to its limb's last hinge is no hand, metres.
const MIN_HAND_M: f64 = 0.01;
/// Speed of hinges whose description gives none, rad/s.
const UNLIMITED_RAD_PER_S: f64 = 1000.0;
/// Limbs that end this near to the lowest one are legs, by the height of the robot.
const LEG_BY_HEIGHT: f64 = 0.15;

/// Options for making a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildOptions {
    /// The last hinges of the legs, left before right, in pairs (`--legs`). Empty: the limbs named
    /// left and right that end lowest.
    pub legs: Vec<String>,
    /// More joints without hinges: name, the joint that carries it, and its place in the link of
    /// that joint, ROS axes, metres (`--end-effector`). They replace those that are found.
    pub end_effectors: Vec<(String, String, [f64; 3])>,
}

/// A robot made of a description.
#[derive(Clone, Debug, PartialEq)]
pub struct Built {
    /// The skeleton with its hinges, native axes. It has no contact joints yet: their heights come
    /// from motion.
    pub skeleton: Skeleton,
    /// Joints that touch the ground.
    pub contacts: Vec<String>,
}

/// Makes the robot of a description. Fixed links become part of the link that carries them; names
/// lose `_joint`.
///
/// # Errors
/// [`DescriptionError`], with the joint and the option that decides.
pub fn build(description: &Description, options: &BuildOptions) -> Result<Built, DescriptionError> {
    let tree = Tree::of(description)?;
    let legs = tree.legs(options)?;
    let mut ends: Vec<End> = tree.ends(&legs, options)?;
    for (name, carrier, place) in &options.end_effectors {
        let joint = tree.names.iter().position(|of| of == carrier);
        let joint = joint.ok_or_else(|| {
            let names = tree.names.join(", ");
            DescriptionError::Body(format!(
                "--end-effector {name}: no joint {carrier:?}; the robot has {names}"
            ))
        })?;
        ends.push(End {
            name: name.clone(),
            joint,
            place: DVec3::from(*place),
            touches: false,
        });
    }
    let contacts = tree.contacts(&legs, &ends);
    let body = |error: String| DescriptionError::Body(error);
    let joint = |(name, parent, place): (&String, Option<usize>, DVec3)| Joint {
        name: name.clone(),
        parent,
        offset_m: native(place),
    };
    let own = (0..tree.names.len()).map(|nth| (&tree.names[nth], tree.parents[nth], tree.places[nth]));
    let ends = ends.iter().map(|end| (&end.name, Some(end.joint), end.place));
    let joints = own.chain(ends).map(joint).collect();
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, None).map_err(|e| body(e.to_string()))?;
    let skeleton = skeleton
        .with_robot(&tree.doc(&description.name))
        .map_err(|e: RobotError| body(e.to_string()))?;
    Ok(Built { skeleton, contacts })
}

fn native(place: DVec3) -> Vec3 {
    Convention::Ros.position_to_native(place.as_vec3())
}

/// A joint without a hinge at a limb's end.
struct End {
    name: String,
    joint: usize,
    place: DVec3,
    touches: bool,
}

/// The joints that turn, depth first, in ROS axes.
struct Tree<'a> {
    description: &'a Description,
    names: Vec<String>,
    parents: Vec<Option<usize>>,
    places: Vec<DVec3>,
    links: Vec<usize>,
    /// For each joint but the root, its description and its rotation at angle 0.
    turning: Vec<Option<(&'a DescribedJoint, DQuat)>>,
    /// In the world at angle 0.
    zero: Vec<(DVec3, DQuat)>,
}

impl<'a> Tree<'a> {
    fn of(description: &'a Description) -> Result<Self, DescriptionError> {
        let mut root = description.root;
        let mut on = description.on(root);
        if let (Some(only), None) = (on.next(), on.next())
            && only.kind == Kind::Floating
        {
            root = only.child;
        }
        let mut tree = Self {
            description,
            names: vec![description.links[root].name.clone()],
            parents: vec![None],
            places: vec![DVec3::ZERO],
            links: vec![root],
            turning: vec![None],
            zero: vec![(DVec3::ZERO, DQuat::IDENTITY)],
        };
        // A stack of joints to walk: the last comes first, so that a limb is walked to its end.
        let mut open = Vec::new();
        push(&mut open, description, (root, 0, DVec3::ZERO, DQuat::IDENTITY));
        while let Some((joint, carrier, place, turn)) = open.pop() {
            let (at, rest) = (place + turn * joint.place, turn * joint.turn);
            let next = match joint.kind {
                Kind::Fixed => (joint.child, carrier, at, rest),
                Kind::Hinge => {
                    let index = tree.add(joint, carrier, at, rest);
                    (joint.child, index, DVec3::ZERO, DQuat::IDENTITY)
                }
                Kind::Floating => {
                    let text = format!("joint {:?} floats; only the one on the root link may", joint.name);
                    return Err(DescriptionError::Body(text));
                }
            };
            push(&mut open, description, next);
        }
        match tree.names.len() {
            1 => Err(DescriptionError::Body("no joint turns".to_owned())),
            _ => Ok(tree),
        }
    }

    fn add(&mut self, joint: &'a DescribedJoint, carrier: usize, place: DVec3, rest: DQuat) -> usize {
        let name = joint.name.strip_suffix("_joint").unwrap_or(&joint.name);
        let (above, turned) = self.zero[carrier];
        self.names.push(name.to_owned());
        self.parents.push(Some(carrier));
        self.places.push(place);
        self.links.push(joint.child);
        self.turning.push(Some((joint, rest)));
        self.zero.push((above + turned * place, turned * rest));
        self.names.len() - 1
    }

    /// Pairs of the last hinges of limbs, left and right by name.
    fn limbs(&self) -> Vec<[usize; 2]> {
        let is_last = |joint: usize| !self.parents.contains(&Some(joint));
        (0..self.names.len())
            .filter(|&joint| is_last(joint))
            .filter_map(|left| {
                let names = mirrored(&self.names[left]);
                let right = self.names.iter().position(|name| names.contains(name))?;
                is_last(right).then_some([left, right])
            })
            .collect()
    }

    /// The last hinges of the legs, in pairs.
    fn legs(&self, options: &BuildOptions) -> Result<Vec<[usize; 2]>, DescriptionError> {
        if !options.legs.is_empty() {
            let find = |name: &String| {
                let bare = name.strip_suffix("_joint").unwrap_or(name);
                self.names.iter().position(|of| of == bare).ok_or_else(|| {
                    let names = self.names.join(", ");
                    DescriptionError::Body(format!("--legs: no joint {name:?}; the robot has {names}"))
                })
            };
            let joints = options.legs.iter().map(find).collect::<Result<Vec<_>, _>>()?;
            let (pairs, rest) = joints.as_chunks::<2>();
            return match rest {
                [] => Ok(pairs.to_vec()),
                _ => {
                    let text = format!(
                        "--legs names {} joints; allowed: left and right in pairs",
                        joints.len()
                    );
                    Err(DescriptionError::Body(text))
                }
            };
        }
        let limbs = self.limbs();
        let height = |joint: usize| self.zero[joint].0.z;
        let lowest = limbs
            .iter()
            .map(|pair| height(pair[0]))
            .fold(f64::INFINITY, f64::min);
        let highest = self.zero.iter().map(|at| at.0.z).fold(0.0, f64::max);
        let near = lowest + LEG_BY_HEIGHT * (highest - lowest);
        let legs: Vec<[usize; 2]> = limbs.into_iter().filter(|pair| height(pair[0]) <= near).collect();
        match legs.is_empty() {
            false => Ok(legs),
            true => {
                let last = (1..self.names.len()).filter(|&joint| !self.parents.contains(&Some(joint)));
                let last: Vec<&str> = last.map(|joint| &*self.names[joint]).collect();
                Err(DescriptionError::Body(format!(
                    "no limbs are named left and right; --legs LEFT,RIGHT names the last hinge of each leg, of: {}",
                    last.join(", ")
                )))
            }
        }
    }

    /// Toes and hands that no option gives.
    fn ends(&self, legs: &[[usize; 2]], options: &BuildOptions) -> Result<Vec<End>, DescriptionError> {
        let given = |name: &str| options.end_effectors.iter().any(|end| end.0 == name);
        let arms: Vec<[usize; 2]> = self
            .limbs()
            .into_iter()
            .filter(|pair| !legs.contains(pair))
            .collect();
        let mut ends = Vec::new();
        for pair in legs {
            for (leaf, side) in pair.iter().zip(["left", "right"]) {
                let name = match legs.len() {
                    1 => format!("{side}_toe"),
                    _ => format!("{}_end", self.names[*leaf]),
                };
                if given(&name) {
                    continue;
                }
                let place = match legs.len() {
                    1 => self.toe(*leaf, &name)?,
                    _ => self.hand(*leaf, &name)?,
                };
                ends.push(End {
                    name,
                    joint: *leaf,
                    place,
                    touches: true,
                });
            }
        }
        for pair in &arms {
            for (leaf, side) in pair.iter().zip(["left", "right"]) {
                let name = match arms.len() {
                    1 => format!("{side}_hand"),
                    _ => format!("{}_end", self.names[*leaf]),
                };
                if !given(&name) {
                    ends.push(End {
                        place: self.hand(*leaf, &name)?,
                        name,
                        joint: *leaf,
                        touches: false,
                    });
                }
            }
        }
        Ok(ends)
    }

    /// The last hinges of two legs with their toes, or the ends of more legs.
    fn contacts(&self, legs: &[[usize; 2]], ends: &[End]) -> Vec<String> {
        let mut contacts = Vec::new();
        for leaf in legs.iter().flatten() {
            if legs.len() == 1 {
                contacts.push(self.names[*leaf].clone());
            }
            let on = ends
                .iter()
                .filter(|end| end.joint == *leaf && (end.touches || end.name.ends_with("_toe")));
            contacts.extend(on.map(|end| end.name.clone()));
        }
        contacts
    }

    /// Points on a link's shapes, or on the box of its inertia.
    fn points(&self, leaf: usize, name: &str, down: DVec3) -> Result<Vec<DVec3>, DescriptionError> {
        let link = &self.description.links[self.links[leaf]];
        let inertia: Vec<Shape> = link.inertia.iter().cloned().collect();
        let shapes = if link.shapes.is_empty() {
            &inertia
        } else {
            &link.shapes
        };
        match shapes.is_empty() {
            false => Ok(shapes.iter().flat_map(|shape| shape.surface(down)).collect()),
            true => Err(DescriptionError::Body(format!(
                "link {:?} has no collision shape that can be read and no inertia; --end-effector {name}={}:x,y,z",
                link.name, self.names[leaf]
            ))),
        }
    }

    /// The middle of the sole's front edge, in the leaf's frame: the sole is what is lowest at
    /// angle 0.
    fn toe(&self, leaf: usize, name: &str) -> Result<DVec3, DescriptionError> {
        let back = self.zero[leaf].1.conjugate();
        let (down, ahead) = (back * DVec3::NEG_Z, back * DVec3::X);
        let points = self.points(leaf, name, down)?;
        let sole = extreme(&points, down);
        let front = extreme(&sole, ahead);
        let across = down.cross(ahead);
        let most =
            |along: DVec3, of: &[DVec3]| of.iter().map(|p| p.dot(along)).fold(f64::NEG_INFINITY, f64::max);
        let middle = 0.5 * (most(across, &front) - most(-across, &front));
        Ok(most(ahead, &sole) * ahead + most(down, &points) * down + middle * across)
    }

    /// The farthest link fixed to the last one; without any, the far end of that link's shape.
    fn hand(&self, leaf: usize, name: &str) -> Result<DVec3, DescriptionError> {
        let mut open = vec![(self.links[leaf], DVec3::ZERO, DQuat::IDENTITY)];
        let mut farthest = DVec3::ZERO;
        while let Some((link, place, turn)) = open.pop() {
            for joint in self.description.on(link) {
                let at = place + turn * joint.place;
                if at.length() > farthest.length().max(MIN_HAND_M) {
                    farthest = at;
                }
                open.push((joint.child, at, turn * joint.turn));
            }
        }
        if farthest != DVec3::ZERO {
            return Ok(farthest);
        }
        let points = self.points(leaf, name, DVec3::NEG_Z)?;
        let ends = points
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| {
                (low.min(*point), high.max(*point))
            });
        let middle = 0.5 * (ends.0 + ends.1);
        let along = middle.abs().max_position();
        let mut axis = DVec3::ZERO;
        axis[along] = middle[along].signum();
        let end = extreme(&points, axis);
        Ok(end.iter().sum::<DVec3>() / end.len() as f64)
    }

    /// The hinges, and the joints that follow them.
    fn doc(&self, name: &str) -> RobotDoc {
        let mut doc = RobotDoc {
            name: name.to_owned(),
            hinges: Vec::new(),
            mimics: Vec::new(),
        };
        for (of, turning) in self.names.iter().zip(&self.turning) {
            let Some((joint, rest)) = turning else {
                continue;
            };
            let axis = Convention::Ros.direction_to_native(joint.axis.as_vec3());
            let rest = to_wxyz(Convention::Ros.rotation_to_native(rest.as_quat()));
            match &joint.follows {
                None => doc.hinges.push(HingeDoc {
                    joint: of.clone(),
                    axis,
                    rest,
                    lower_rad: joint.lower_rad as f32,
                    upper_rad: joint.upper_rad as f32,
                    max_speed_rad_per_s: match joint.max_speed_rad_per_s {
                        speed if speed > 0.0 => speed as f32,
                        _ => UNLIMITED_RAD_PER_S as f32,
                    },
                    max_acceleration_rad_per_s2: None,
                }),
                Some(follows) => doc.mimics.push(MimicDoc {
                    joint: of.clone(),
                    follows: follows
                        .joint
                        .strip_suffix("_joint")
                        .unwrap_or(&follows.joint)
                        .to_owned(),
                    multiplier: follows.multiplier as f32,
                    offset_rad: follows.offset_rad as f32,
                    axis,
                    rest,
                }),
            }
        }
        doc
    }
}

/// A joint to walk: with the joint that carries it, and the place and rotation of its link in that.
type Step<'a> = (&'a DescribedJoint, usize, DVec3, DQuat);

/// Pushes the joints on a link, the first on top.
fn push<'a>(
    open: &mut Vec<Step<'a>>,
    description: &'a Description,
    (link, carrier, place, turn): (usize, usize, DVec3, DQuat),
) {
    let from = open.len();
    open.extend(description.on(link).map(|joint| (joint, carrier, place, turn)));
    open[from..].reverse();
}

/// The points nearest to the farthest one along a direction.
fn extreme(points: &[DVec3], along: DVec3) -> Vec<DVec3> {
    let most = points
        .iter()
        .map(|point| point.dot(along))
        .fold(f64::NEG_INFINITY, f64::max);
    let near = points.iter().filter(|point| point.dot(along) > most - LAYER_M);
    near.copied().collect()
}

/// Names of a left joint's counterpart on the right: `left_knee`, `leg_l6`, `FL_calf`, `LF_KFE`.
fn mirrored(name: &str) -> Vec<String> {
    const SIDES: [(&str, &str); 12] = [
        ("left", "right"),
        ("Left", "Right"),
        ("LEFT", "RIGHT"),
        ("l", "r"),
        ("L", "R"),
        ("FL", "FR"),
        ("RL", "RR"),
        ("HL", "HR"),
        ("LF", "RF"),
        ("LH", "RH"),
        ("fl", "fr"),
        ("rl", "rr"),
    ];
    let mut found = Vec::new();
    for (left, right) in SIDES {
        for (at, _) in name.match_indices(left) {
            let before = name[..at].chars().next_back();
            let after = name[at + left.len()..].chars().next();
            let is_word = !before.is_some_and(char::is_alphabetic) && !after.is_some_and(char::is_alphabetic);
            // A whole word needs no gap: leftKnee.
            if is_word || (left.len() > 2 && !before.is_some_and(char::is_lowercase)) {
                found.push(format!("{}{right}{}", &name[..at], &name[at + left.len()..]));
            }
        }
    }
    found
}
