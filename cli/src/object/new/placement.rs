//! Where things are in the clip, and how that is written.

use troupe_motion::clip::Clip;
use troupe_motion::fk::world_transforms;
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::{to_wxyz, yaw};
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};
use troupe_proto::docs::{KeyframeDoc, PointDoc};

/// One frame of the clip, in its world.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pose {
    pub(super) root: GlobalRoot,
    /// Joint 0 in the world, others relative to their parents.
    pub(super) rotations: Vec<Quat>,
    /// World positions of the joints, metres.
    pub(super) positions: Vec<Vec3>,
    /// World rotations of the joints.
    pub(super) turned: Vec<Quat>,
}

impl Pose {
    /// A frame of a clip, which is in it.
    pub(super) fn of(clip: &Clip, frame: usize) -> Self {
        let rotations = clip.rotations_at(frame).to_vec();
        Self::new(&clip.skeleton, clip.root_positions[frame], rotations)
    }

    pub(super) fn new(skeleton: &Skeleton, root: Vec3, rotations: Vec<Quat>) -> Self {
        let joints = skeleton.joint_count();
        let (mut positions, mut turned) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        world_transforms(skeleton, root, &rotations, &mut positions, &mut turned);
        Self {
            root: GlobalRoot::of_pose(root, rotations[0], skeleton.left_axis),
            rotations,
            positions,
            turned,
        }
    }

    /// Whether its root is at that of another pose, within metres over the ground and
    /// radians.
    pub(super) fn stays_at(&self, other: &Self, (metres, radians): (f32, f32)) -> bool {
        let way = self.root.position - other.root.position;
        let turn = wrap_angle(self.root.heading - other.root.heading);
        way.x.hypot(way.z) < metres && turn.abs() < radians
    }
}

/// The object in the clip's world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    /// Its origin, metres.
    pub(super) origin: Vec3,
    /// Which way its +Z faces, radians.
    pub(super) heading: f32,
}

impl Placement {
    /// An object `distance` metres before a character, its origin `height` metres over the ground:
    /// it faces the character. Behind the character it faces the way that the character does.
    pub(super) fn before(skeleton: &Skeleton, pose: &Pose, distance: f32, height: f32) -> Self {
        let place = pose.root.projected() + pose.root.forward() * distance;
        Self {
            origin: place + Vec3::Y * (skeleton.ground_y_m + height),
            heading: match distance < 0.0 {
                true => pose.root.heading,
                false => wrap_angle(pose.root.heading + std::f32::consts::PI),
            },
        }
    }

    /// A seat on the ground under the hips, which faces the way that the character does.
    pub(super) fn under(skeleton: &Skeleton, pose: &Pose) -> Self {
        Self {
            origin: pose.root.position.with_y(skeleton.ground_y_m),
            heading: pose.root.heading,
        }
    }

    /// An object whose middle, `middle` metres over its origin, is `grip` metres beyond a joint
    /// along its bone. It faces the character.
    pub(super) fn in_hand(skeleton: &Skeleton, pose: &Pose, joint: usize, grip: f32, middle: f32) -> Self {
        let at = pose.positions[joint] + pose.turned[joint] * bone(skeleton, joint) * grip;
        Self {
            origin: at - Vec3::Y * middle,
            heading: wrap_angle(pose.root.heading + std::f32::consts::PI),
        }
    }

    /// Its origin and rotation (w, x, y, z) in the frame of a joint.
    pub(super) fn in_joint(&self, pose: &Pose, joint: usize) -> ([f32; 3], [f32; 4]) {
        let undo = pose.turned[joint].conjugate();
        let position = undo * (self.origin - pose.positions[joint]);
        let rotation = (undo * yaw(self.heading)).normalize();
        (
            position.to_array().map(|v| rounded(v, 4)),
            to_wxyz(rotation).map(|v| rounded(v, 5)),
        )
    }
}

/// Which way a joint's bone points in its own frame: towards its first child, else on from its
/// parent.
fn bone(skeleton: &Skeleton, joint: usize) -> Vec3 {
    let child = skeleton.joints.iter().find(|other| other.parent == Some(joint));
    let along = child.map_or(skeleton.joints[joint].offset_m, |child| child.offset_m);
    along.normalize_or_zero()
}

/// What keyframes are given from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    /// The place; its height is the ground's.
    place: Vec3,
    /// Which way its +Z faces, radians.
    heading: f32,
}

impl View {
    pub(super) fn of_object(placement: &Placement, ground: f32) -> Self {
        Self {
            place: placement.origin.with_y(ground),
            heading: placement.heading,
        }
    }

    pub(super) fn of_character(pose: &Pose, ground: f32) -> Self {
        Self {
            place: pose.root.position.with_y(ground),
            heading: pose.root.heading,
        }
    }

    fn local(&self, world: Vec3) -> Vec3 {
        yaw(-self.heading) * (world - self.place)
    }

    /// A place over the ground: x and z, metres.
    pub(super) fn place(&self, world: Vec3) -> [f32; 2] {
        let local = self.local(world);
        [rounded(local.x, 4), rounded(local.z, 4)]
    }

    /// A heading (radians) in degrees, -180 excluded.
    pub(super) fn heading_deg(&self, heading: f32) -> f32 {
        let degrees = rounded(wrap_angle(heading - self.heading).to_degrees(), 2);
        if degrees <= -180.0 {
            degrees + 360.0
        } else {
            degrees
        }
    }

    /// Where a joint is; its height counts from `heights`.
    pub(super) fn point(&self, skeleton: &Skeleton, pose: &Pose, joint: usize, heights: f32) -> PointDoc {
        let world = pose.positions[joint];
        let local = self.local(world).with_y(world.y - heights);
        PointDoc {
            joint: skeleton.joints[joint].name.clone(),
            position_m: local.to_array().map(|v| rounded(v, 4)),
        }
    }
}

/// A whole pose as a keyframe.
pub(super) fn keyframe(pose: &Pose, view: &View, pivot: bool) -> KeyframeDoc {
    let mut rotations = pose.rotations.clone();
    rotations[0] = (yaw(-pose.root.heading) * rotations[0]).normalize();
    KeyframeDoc {
        pivot,
        place_m: Some(view.place(pose.root.position)),
        heading_deg: Some(view.heading_deg(pose.root.heading)),
        height_m: Some(rounded(view.local(pose.root.position).y, 4)),
        from_ground: true,
        rotations: Some(
            rotations
                .into_iter()
                .flat_map(to_wxyz)
                .map(|v| rounded(v, 5))
                .collect(),
        ),
        points: Vec::new(),
    }
}

/// A number as it is written: with so many digits, and no minus before a 0.
pub(super) fn rounded(value: f32, digits: i32) -> f32 {
    let scale = 10.0_f64.powi(digits);
    ((f64::from(value) * scale).round() / scale + 0.0) as f32
}
