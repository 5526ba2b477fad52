//! Keyframes in the world: they follow an object's transform, and turn about its pivot if their
//! flag ω is set.

use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::{Definition, Keyframe, Point};
use crate::scene::Transform;

/// The place in the world that keyframes are relative to.
///
/// It follows an object's position and heading, not its tilt: a character stands upright in front
/// of a leaning thing. It maps a keyframe to the world and back by a rigid motion about the
/// vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The pivot in the world, metres.
    pub pivot: Vec3,
    /// The pivot in the keyframes' frame of reference, metres.
    pub local_pivot_m: Vec3,
    /// Heading of the keyframes' frame of reference in the world, radians.
    pub heading: f32,
    /// The side that the character comes from, radians from the object's +Z. Keyframes with ω turn
    /// by it.
    pub side: f32,
    /// Height of what the character stands on, metres.
    pub ground_y: f32,
}

/// A keyframe in the world.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorldKeyframe {
    /// The root's place over the ground: x and z, metres.
    pub place: Option<[f32; 2]>,
    /// The heading, radians in (-π, π].
    pub heading: Option<f32>,
    /// Height of the root joint, metres.
    pub height: Option<f32>,
    /// The pose: the first rotation in the world, others relative to their parents.
    pub rotations: Option<Vec<Quat>>,
    /// Places of single joints.
    pub points: Vec<WorldPoint>,
}

/// A joint's place in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldPoint {
    /// Index of the joint in the skeleton.
    pub joint: usize,
    /// World position, metres.
    pub position: Vec3,
}

impl WorldKeyframe {
    /// The whole root; none if a part of it is missing.
    pub fn root(&self) -> Option<GlobalRoot> {
        let [x, z] = self.place?;
        Some(GlobalRoot::new(Vec3::new(x, self.height?, z), self.heading?))
    }

    /// The root, with missing parts taken from `other`.
    pub fn root_or(&self, other: GlobalRoot) -> GlobalRoot {
        let [x, z] = self.place.unwrap_or([other.position.x, other.position.z]);
        GlobalRoot::new(
            Vec3::new(x, self.height.unwrap_or(other.position.y), z),
            self.heading.unwrap_or(other.heading),
        )
    }
}

impl Definition {
    /// The pivot of an object at `object`, in the world.
    pub fn pivot(&self, object: Transform) -> Vec3 {
        object.point(self.pivot_m)
    }

    /// The side of an object at `object` on which `place` is, as seen from its pivot: radians about
    /// +Y from the object's +Z, in (-π, π]. At the pivot itself: 0.
    pub fn side_of(&self, object: Transform, place: Vec3) -> f32 {
        let away = place - self.pivot(object);
        if away.x.hypot(away.z) < 1e-4 {
            return 0.0;
        }
        wrap_angle(away.x.atan2(away.z) - object.heading())
    }

    /// The anchor of sets whose origin is the object at `object`, for a character that comes from
    /// `side` and stands at height `ground_y`.
    pub fn anchor(&self, object: Transform, side: f32, ground_y: f32) -> Anchor {
        Anchor {
            pivot: self.pivot(object),
            local_pivot_m: self.pivot_m,
            heading: object.heading(),
            side,
            ground_y,
        }
    }
}

impl Anchor {
    /// The anchor of sets whose origin is the character: the point under its root at height
    /// `ground_y`, and its heading.
    pub fn of_character(root: GlobalRoot, ground_y: f32) -> Self {
        Self {
            pivot: Vec3::new(root.position.x, ground_y, root.position.z),
            local_pivot_m: Vec3::ZERO,
            heading: root.heading,
            side: 0.0,
            ground_y,
        }
    }

    /// The angle by which a keyframe is turned into the world, radians. `pivot` is its flag ω.
    fn turn(&self, pivot: bool) -> f32 {
        self.heading + if pivot { self.side } else { 0.0 }
    }

    /// A point of a keyframe in the world.
    pub fn point(&self, pivot: bool, local: Vec3) -> Vec3 {
        self.pivot + yaw(self.turn(pivot)) * (local - self.local_pivot_m)
    }

    /// A point of the world in the keyframes' frame of reference: the inverse of [`Anchor::point`].
    pub fn local_point(&self, pivot: bool, world: Vec3) -> Vec3 {
        self.local_pivot_m + yaw(-self.turn(pivot)) * (world - self.pivot)
    }

    /// Where a character starts that comes from the anchor's side: `distance_m` from the pivot,
    /// facing it.
    pub fn start(&self, distance_m: f32) -> GlobalRoot {
        let heading = self.turn(true);
        let place = self.pivot + yaw(heading) * Vec3::Z * distance_m;
        GlobalRoot::new(
            Vec3::new(place.x, self.ground_y, place.z),
            wrap_angle(heading + std::f32::consts::PI),
        )
    }

    /// The height in the world at which a keyframe's heights begin, metres.
    fn base_y(&self, from_ground: bool) -> f32 {
        match from_ground {
            true => self.ground_y,
            false => self.pivot.y - self.local_pivot_m.y,
        }
    }

    /// A keyframe in the world.
    pub fn keyframe(&self, key: &Keyframe) -> WorldKeyframe {
        let base = self.base_y(key.from_ground);
        let heading = key
            .heading
            .map(|heading| wrap_angle(heading + self.turn(key.pivot)));
        let place = key.place_m.map(|[x, z]| {
            let place = self.point(key.pivot, Vec3::new(x, 0.0, z));
            [place.x, place.z]
        });
        let rotations = key.rotations.as_ref().map(|local| {
            let mut rotations = local.clone();
            if let (Some(pelvis), Some(heading)) = (rotations.first_mut(), heading) {
                *pelvis = (yaw(heading) * *pelvis).normalize();
            }
            rotations
        });
        let to_world = |point: &Point| {
            let place = self.point(key.pivot, point.position_m);
            WorldPoint {
                joint: point.joint,
                position: Vec3::new(place.x, base + point.position_m.y, place.z),
            }
        };
        WorldKeyframe {
            place,
            heading,
            height: key.height_m.map(|height| base + height),
            rotations,
            points: key.points.iter().map(to_world).collect(),
        }
    }

    /// The keyframe that [`Anchor::keyframe`] turns into `world`, for making one from a motion.
    /// `pivot` and `from_ground` are its flags.
    pub fn local_keyframe(&self, world: &WorldKeyframe, pivot: bool, from_ground: bool) -> Keyframe {
        let base = self.base_y(from_ground);
        let rotations = world.rotations.as_ref().map(|rotations| {
            let mut local = rotations.clone();
            if let (Some(pelvis), Some(heading)) = (local.first_mut(), world.heading) {
                *pelvis = (yaw(-heading) * *pelvis).normalize();
            }
            local
        });
        let to_local = |point: &WorldPoint| {
            let place = self.local_point(pivot, point.position);
            Point {
                joint: point.joint,
                position_m: Vec3::new(place.x, point.position.y - base, place.z),
            }
        };
        Keyframe {
            pivot,
            place_m: world.place.map(|[x, z]| {
                let place = self.local_point(pivot, Vec3::new(x, 0.0, z));
                [place.x, place.z]
            }),
            heading: world
                .heading
                .map(|heading| wrap_angle(heading - self.turn(pivot))),
            height_m: world.height.map(|height| height - base),
            pose_scale: None,
            from_ground,
            rotations,
            points: world.points.iter().map(to_local).collect(),
        }
    }
}
