//! Limbs with hinges: the counterpart of [`super::two_bone`] for robots.
//!
//! All hinges of a limb turn together, a little at a time, by damped least squares
//! (Levenberg-Marquardt), until the limb's end is at its goal or comes no nearer. A hinge at its
//! limit stays there while it would turn beyond. The same input gives the same pose.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::robot::{Mimic, Robot};
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

/// Most joints of a limb.
const MOST_JOINTS: usize = 24;
/// Most steps of a solution.
const STEPS: usize = 40;
/// Metres that count as much as a radian, if the goal has a rotation.
const METRES_PER_RAD: f32 = 0.1;
/// A smaller distance counts as met, metres. Radians are weighed by [`METRES_PER_RAD`].
const MET_M: f32 = 2e-6;
/// Least and first damping, metres a radian.
const DAMPING: (f32, f32) = (1e-3, 2e-2);
/// Beyond this damping nothing moves any more.
const STUCK: f32 = 10.0;
/// A step towards a rotation that brings less than this share of what is lacking is the last one:
/// the rotation is beyond the limits.
const LEAST_GAIN: f32 = 1e-3;
/// Largest turn of a hinge in a step, radians.
const MOST_STEP: f32 = 0.5;

/// The goal of a limb's end. At least one of its parts should be given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    /// World position, metres.
    pub(super) place: Option<Vec3>,
    /// World rotation.
    pub(super) rotation: Option<Quat>,
}

/// A number for each part of a goal: position, then rotation. Missing parts stay 0.
type Column = [f32; 6];

/// A joint of the limb.
#[derive(Clone, Copy, Debug, Default)]
struct LimbJoint {
    joint: usize,
    /// Index among the robot's hinges; none for a joint without a hinge.
    hinge: Option<usize>,
    /// Index of the part with the hinge that it follows; none for one that follows no hinge of the
    /// limb.
    follows: Option<(usize, Mimic)>,
}

/// How a joint of the limb is turned.
#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    angle: f32,
    /// World position of the joint, and its axis.
    place: Vec3,
    axis: Vec3,
}

/// The joints from `top` down to `end` in a pose.
struct Limb<'a> {
    skeleton: &'a Skeleton,
    robot: &'a Robot,
    parts: [LimbJoint; MOST_JOINTS],
    turned: [Turned; MOST_JOINTS],
    count: usize,
    /// Transform of the parent of the limb's first joint.
    base: (Vec3, Quat),
}

/// Turns the hinges from `top` down to `end` so that `end` comes to `goal`. Returns the remaining
/// distance to the position, metres (0 without one). Returns `None`, and changes nothing, if the
/// joints are not a limb or a value is not finite. Does not allocate.
pub(super) fn solve(
    (skeleton, robot): (&Skeleton, &Robot),
    root: Vec3,
    rotations: &mut [Quat],
    (top, end): (usize, usize),
    goal: &Goal,
) -> Option<f32> {
    let mut limb = Limb::of((skeleton, robot), root, rotations, (top, end))?;
    let given = goal.place.is_none_or(Vec3::is_finite) && goal.rotation.is_none_or(Quat::is_finite);
    if !(given && limb.base.0.is_finite() && limb.base.1.is_finite()) {
        return None;
    }
    let mut damping = DAMPING.1;
    let mut lacking = limb.lacking(goal, rotations);
    for _ in 0..STEPS {
        let cost = length(&lacking);
        if cost <= MET_M || damping > STUCK {
            break;
        }
        let before = limb.turned;
        limb.step(&lacking, goal, damping);
        let now = limb.lacking(goal, rotations);
        let gain = cost - length(&now);
        if gain > 0.0 {
            lacking = now;
            damping = (damping * 0.3).max(DAMPING.0);
            if goal.place.is_none() && gain < LEAST_GAIN * cost {
                break;
            }
        } else {
            limb.turned = before;
            damping *= 4.0;
        }
    }
    for (part, &Turned { angle, .. }) in limb.parts[..limb.count].iter().zip(&limb.turned) {
        if let Some(hinge) = part.hinge {
            let turned = robot.hinges()[hinge].rotation(angle);
            rotations[part.joint] = align_sign(turned, rotations[part.joint]);
            // Those on other limbs too.
            for mimic in robot.mimics().iter().filter(|mimic| mimic.hinge == hinge) {
                let turned = mimic.rotation(angle);
                rotations[mimic.joint] = align_sign(turned, rotations[mimic.joint]);
            }
        }
    }
    let [x, y, z, ..] = lacking;
    Some(Vec3::new(x, y, z).length())
}

impl<'a> Limb<'a> {
    fn of(
        (skeleton, robot): (&'a Skeleton, &'a Robot),
        root: Vec3,
        rotations: &[Quat],
        (top, end): (usize, usize),
    ) -> Option<Self> {
        let mut parts = [LimbJoint::default(); MOST_JOINTS];
        let mut turned = [Turned::default(); MOST_JOINTS];
        let mut count = 0;
        let mut at = Some(end);
        loop {
            let joint = at?;
            let hinge = robot.hinge_of(joint);
            let angle = hinge.map_or(0.0, |hinge| {
                let of = &robot.hinges()[hinge];
                of.limited(of.angle_of(rotations[joint]))
            });
            *parts.get_mut(count)? = LimbJoint {
                joint,
                hinge,
                follows: None,
            };
            turned[count].angle = angle;
            count += 1;
            if joint == top {
                break;
            }
            at = skeleton.joints[joint].parent;
        }
        parts[..count].reverse();
        turned[..count].reverse();
        for nth in 0..count {
            parts[nth].follows = robot.mimic_of(parts[nth].joint).and_then(|&mimic| {
                let of = parts[..nth]
                    .iter()
                    .position(|part| part.hinge == Some(mimic.hinge));
                Some((of?, mimic))
            });
        }
        let above = skeleton.joints[top].parent?;
        Some(Self {
            skeleton,
            robot,
            parts,
            turned,
            count,
            base: joint_transform(skeleton, root, rotations, above),
        })
    }

    /// Places the joints by their angles. Returns what the end lacks to its goal.
    fn lacking(&mut self, goal: &Goal, rotations: &[Quat]) -> Column {
        let (mut place, mut rotation) = self.base;
        for nth in 0..self.count {
            let LimbJoint {
                joint,
                hinge,
                follows,
            } = self.parts[nth];
            place += rotation * self.skeleton.joints[joint].offset_m;
            let (axis, turned) = match (hinge, follows) {
                (Some(hinge), _) => {
                    let of = &self.robot.hinges()[hinge];
                    (of.rest * of.axis, of.rotation(self.turned[nth].angle))
                }
                (None, Some((of, mimic))) => (mimic.rest * mimic.axis, mimic.rotation(self.turned[of].angle)),
                (None, None) => (Vec3::ZERO, rotations[joint]),
            };
            let part = &mut self.turned[nth];
            (part.place, part.axis) = (place, rotation * axis);
            rotation *= turned;
        }
        let far = goal.place.map_or(Vec3::ZERO, |goal| goal - place);
        let turn = goal.rotation.map_or(Vec3::ZERO, |goal| {
            let turn = align_sign(goal * rotation.conjugate(), Quat::IDENTITY).normalize();
            turn.to_scaled_axis() * METRES_PER_RAD
        });
        [far.x, far.y, far.z, turn.x, turn.y, turn.z]
    }

    /// The end's movement for a radian of a joint.
    fn column(&self, part: &Turned, goal: &Goal) -> Column {
        let end = self.turned[self.count - 1].place;
        let moves = match goal.place {
            Some(_) => part.axis.cross(end - part.place),
            None => Vec3::ZERO,
        };
        let turns = match goal.rotation {
            Some(_) => part.axis * METRES_PER_RAD,
            None => Vec3::ZERO,
        };
        [moves.x, moves.y, moves.z, turns.x, turns.y, turns.z]
    }

    /// Turns all hinges a step towards the goal.
    fn step(&mut self, lacking: &Column, goal: &Goal, damping: f32) {
        let mut columns = [[0.0; 6]; MOST_JOINTS];
        let parts = || self.parts[..self.count].iter().zip(&self.turned);
        for (column, (part, turned)) in columns.iter_mut().zip(parts()) {
            if part.hinge.is_some() {
                *column = self.column(turned, goal);
            }
        }
        for (part, turned) in parts() {
            if let Some((of, mimic)) = part.follows {
                let along = self.column(turned, goal);
                for (number, along) in columns[of].iter_mut().zip(along) {
                    *number += mimic.multiplier * along;
                }
            }
        }
        let mut turns = [0.0_f32; MOST_JOINTS];
        // A hinge that would leave its limits is left out, and the others make up for it.
        for _ in 0..3 {
            let Some(weights) = weights(&columns[..self.count], lacking, damping) else {
                return;
            };
            let mut all_free = true;
            for nth in 0..self.count {
                turns[nth] = dot(&columns[nth], &weights);
                if self.is_held(nth, turns[nth]) {
                    columns[nth] = [0.0; 6];
                    turns[nth] = 0.0;
                    all_free = false;
                }
            }
            if all_free {
                break;
            }
        }
        let most = turns.iter().fold(0.0_f32, |most, turn| most.max(turn.abs()));
        let share = (MOST_STEP / most.max(MOST_STEP)).min(1.0);
        let parts = self.parts[..self.count].iter().zip(&mut self.turned);
        for ((part, turned), turn) in parts.zip(turns) {
            if let Some(hinge) = part.hinge {
                turned.angle = self.robot.hinges()[hinge].limited(turned.angle + turn * share);
            }
        }
    }

    /// Whether a hinge is at a limit and would turn beyond.
    fn is_held(&self, nth: usize, turn: f32) -> bool {
        let part = &self.parts[nth];
        part.hinge.is_some_and(|hinge| {
            let of = &self.robot.hinges()[hinge];
            let angle = self.turned[nth].angle;
            (turn < 0.0 && angle <= of.lower_rad) || (turn > 0.0 && angle >= of.upper_rad)
        })
    }
}

fn dot(a: &Column, b: &Column) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(of: &Column) -> f32 {
    dot(of, of).sqrt()
}

/// `(J Jᵀ + damping²)⁻¹ lacking`, with the columns of J, by Cholesky's decomposition. `None` if
/// rounding makes that impossible.
fn weights(columns: &[Column], lacking: &Column, damping: f32) -> Option<Column> {
    let mut l = [[0.0_f32; 6]; 6];
    for row in 0..6 {
        for col in 0..=row {
            let of_columns: f32 = columns.iter().map(|column| column[row] * column[col]).sum();
            let before: f32 = (0..col).map(|k| l[row][k] * l[col][k]).sum();
            l[row][col] = if row == col {
                let square = of_columns + damping * damping - before;
                if square <= 0.0 {
                    return None;
                }
                square.sqrt()
            } else {
                (of_columns - before) / l[col][col]
            };
        }
    }
    let mut x = *lacking;
    for row in 0..6 {
        let before: f32 = (0..row).map(|k| l[row][k] * x[k]).sum();
        x[row] = (x[row] - before) / l[row][row];
    }
    for row in (0..6).rev() {
        let behind: f32 = (row + 1..6).map(|k| l[k][row] * x[k]).sum();
        x[row] = (x[row] - behind) / l[row][row];
    }
    Some(x)
}
