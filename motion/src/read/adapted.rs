//! A file's joints in Troupe's axes, with names that a skeleton can have.

use glam::{DQuat, DVec3};

use super::report::Up;
use crate::convert::{Source, Transform};

/// Angle of a quarter turn, radians.
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// How a file's axes become Troupe's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// They are Troupe's.
    Not,
    /// The world turns, and the bones keep their own axes: the skeleton stands upright at rest, or
    /// it does not stand at all.
    World(DQuat),
    /// World and bones turn: the skeleton stands along the file's up axis at rest.
    All(DQuat),
}

impl Turn {
    /// For an up axis. `resting` is the axis that the skeleton stands along at rest.
    pub(super) fn of(up: Up, resting: Option<Up>) -> Self {
        let turn = match up {
            Up::Y => return Self::Not,
            Up::X => DQuat::from_rotation_z(QUARTER),
            Up::MinusX => DQuat::from_rotation_z(-QUARTER),
            Up::Z => DQuat::from_rotation_x(-QUARTER),
            Up::MinusZ => DQuat::from_rotation_x(QUARTER),
            Up::MinusY => DQuat::from_rotation_x(2.0 * QUARTER),
        };
        match resting == Some(up) {
            true => Self::All(turn),
            false => Self::World(turn),
        }
    }
}

/// A source in Troupe's axes, in the file's units.
pub(super) struct Adapted<'a> {
    pub(super) source: &'a dyn Source,
    pub(super) names: &'a [String],
    pub(super) turn: Turn,
}

impl Adapted<'_> {
    fn turn(&self, transforms: &mut [Transform]) {
        match self.turn {
            Turn::Not => {}
            Turn::World(turn) => {
                for (joint, at) in transforms.iter_mut().enumerate() {
                    if self.source.parent(joint).is_none() {
                        *at = Transform {
                            place: turn * at.place,
                            turn: turn * at.turn,
                        };
                    }
                }
            }
            Turn::All(turn) => {
                for at in transforms {
                    *at = Transform {
                        place: turn * at.place,
                        turn: turn * at.turn * turn.conjugate(),
                    };
                }
            }
        }
    }
}

impl Source for Adapted<'_> {
    fn joint_count(&self) -> usize {
        self.source.joint_count()
    }

    fn name(&self, joint: usize) -> &str {
        &self.names[joint]
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.source.parent(joint)
    }

    fn node(&self, joint: usize) -> Option<usize> {
        self.source.node(joint)
    }

    fn moves(&self, joint: usize) -> bool {
        self.source.moves(joint)
    }

    fn ever_moves(&self, joint: usize) -> bool {
        self.source.ever_moves(joint)
    }

    fn is_joint(&self, joint: usize) -> bool {
        self.source.is_joint(joint)
    }

    fn frames(&self) -> usize {
        self.source.frames()
    }

    fn fps(&self) -> f32 {
        self.source.fps()
    }

    fn rest(&self, out: &mut [Transform]) {
        self.source.rest(out);
        self.turn(out);
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        self.source.locals(frame, out);
        self.turn(out);
    }
}

/// Motion in arrays, as NumPy archives have it.
pub(super) struct Arrays {
    pub(super) names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
    /// Places in the parents; that of the root is not used.
    pub(super) offsets: Vec<DVec3>,
    /// World places of the root, one a frame.
    pub(super) roots: Vec<DVec3>,
    /// `frames * joints` rotations, each relative to its parent.
    pub(super) rotations: Vec<DQuat>,
    pub(super) fps: f32,
}

impl Source for Arrays {
    fn joint_count(&self) -> usize {
        self.names.len()
    }

    fn name(&self, joint: usize) -> &str {
        &self.names[joint]
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.parents[joint]
    }

    fn moves(&self, joint: usize) -> bool {
        joint == 0
    }

    fn is_joint(&self, _: usize) -> bool {
        true
    }

    fn frames(&self) -> usize {
        self.roots.len()
    }

    fn fps(&self) -> f32 {
        self.fps
    }

    fn rest(&self, out: &mut [Transform]) {
        for (local, &place) in out.iter_mut().zip(&self.offsets) {
            *local = Transform {
                place,
                turn: DQuat::IDENTITY,
            };
        }
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let joints = self.names.len();
        let turns = &self.rotations[frame * joints..(frame + 1) * joints];
        for ((local, &place), &turn) in out.iter_mut().zip(&self.offsets).zip(turns) {
            *local = Transform { place, turn };
        }
        out[0].place = self.roots[frame];
    }
}
