//! A target with hinges: its limbs turn as far as they can.

use glam::Quat;

use super::figure::Figure;
use crate::ik::turn_hinges;
use crate::robot::{Fitted, Robot};

/// The hinges of a robot in groups, from the trunk outwards.
#[derive(Clone, Debug)]
pub(super) struct Hinges {
    /// First and last joint of each group. The last has the wanted rotation.
    groups: Vec<(usize, usize)>,
    fitted: Fitted,
    /// Whether a pose was made, from which the next one goes on.
    is_warm: bool,
}

impl Hinges {
    /// The groups of a robot; none for other bodies.
    pub(super) fn of(figure: &Figure) -> Option<Self> {
        figure.skeleton.robot.as_ref()?;
        let parts = &figure.parts;
        let mut groups = Vec::new();
        if let [_, first, ..] = parts.trunk[..] {
            groups.push((first, parts.trunk[parts.trunk.len() - 1]));
        }
        let limbs = parts.legs.iter().chain(parts.arms.iter().flatten());
        for limb in limbs {
            groups.push((limb.top, limb.upper[0]));
            groups.push((limb.lower[0], limb.lower[0]));
            // What turns the hand or foot: wrists and ankles.
            let wrist = limb.lower.get(1).copied().unwrap_or(limb.end);
            groups.push((wrist, limb.end));
        }
        Some(Self {
            groups,
            fitted: Fitted::default(),
            is_warm: false,
        })
    }

    /// Turns the hinges of a pose towards wanted rotations in the world, one a joint.
    pub(super) fn turn(&mut self, figure: &Figure, robot: &Robot, wanted: &[Quat], out: &mut [Quat]) {
        if !self.is_warm {
            self.fitted.angles.clear();
            self.fitted.angles.resize(robot.hinges().len(), 0.0);
            robot.pose(wanted[0], &self.fitted.angles, out);
            self.is_warm = true;
        }
        out[0] = wanted[0];
        for &group in &self.groups {
            turn_hinges((&figure.skeleton, robot), out, group, wanted[group.1]);
        }
    }

    /// Brings a pose onto the hinges, and what follows them.
    pub(super) fn fit(&mut self, robot: &Robot, out: &mut [Quat]) {
        robot.fit(out, &mut self.fitted);
    }

    pub(super) fn reset(&mut self) {
        self.is_warm = false;
    }
}
