//! Turns motion into the network's rows, and back.
//!
//! Every frame is described relative to its path: `p` and `psi` are the path's point and heading,
//! `Y` the rotation about +Y, `N` the neutral pose. Row 0 is the root's offset from the path, as a
//! share of the body's size. Row j + 1 is the bend of joint j.

use troupe_motion::contacts::detect;
use troupe_motion::features::{FEATURES_PER_JOINT, world_rotations_from_features};
use troupe_motion::fk::WorldMotion;
use troupe_motion::model::{Body, GLOBAL_ROOT, KeyTensors, Motion};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::{from_six_d, six_d, yaw};
use troupe_motion::{Quat, Vec3};

use super::{PATH_FEATURES, ROW_CHANNELS};
use crate::pack::UniMoGenDoc;

/// The columns of an unrotated joint.
const IDENTITY: [f32; ROW_CHANNELS] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A point of a path: x and z (m), heading (rad).
pub(super) type PathPoint = [f32; 3];

/// The scales with which a pack writes motion into rows.
#[derive(Debug, Clone)]
pub(super) struct Coding {
    fps: f32,
    low: Vec3,
    high: Vec3,
    bend_gain: f32,
    max_turn_rad_per_s: f32,
}

impl Coding {
    pub(super) fn new(table: &UniMoGenDoc, fps: f32) -> Self {
        Self {
            fps,
            low: Vec3::from(table.root_low),
            high: Vec3::from(table.root_high),
            bend_gain: table.bend_gain,
            max_turn_rad_per_s: table.max_turn_rad_per_s,
        }
    }

    /// The network's description of a path, one a frame: velocity to the left and ahead in body
    /// sizes a second, turn rate in radians a second. Frame 0 has the values of frame 1.
    pub(super) fn path_features(&self, path: &[PathPoint], size_m: f32) -> Vec<[f32; PATH_FEATURES]> {
        let scale = self.fps / size_m;
        let most = self.max_turn_rad_per_s;
        let steps = path.windows(2).map(|pair| {
            let ([x, z, from], [to_x, to_z, to]) = (pair[0], pair[1]);
            let (step_x, step_z) = ((to_x - x) * scale, (to_z - z) * scale);
            let (sin, cos) = to.sin_cos();
            let turn = wrap_angle(to - from) * self.fps;
            [
                cos * step_x - sin * step_z,
                sin * step_x + cos * step_z,
                turn.clamp(-most, most),
            ]
        });
        let mut features = Vec::with_capacity(path.len());
        features.extend(steps);
        if let Some(&first) = features.first() {
            features.insert(0, first);
        }
        features
    }

    /// The rows of a keyframe, `[J + 1, 6]`. None if the keyframe lacks its root or its pose.
    pub(super) fn encode(&self, body: &Body, key: &KeyTensors, at: PathPoint) -> Option<Vec<f32>> {
        let (root, pose) = (key.global_root?, key.pose.as_deref()?);
        let [x, z, heading] = at;
        let back = yaw(-heading);
        let gap = Vec3::new(root[0] - x, root[1] - body.height_m, root[2] - z);
        let offset = back * gap / body.size_m;
        let place = (offset - self.low) / (self.high - self.low) * 2.0 - 1.0;
        let mut rows = Vec::with_capacity(body.row_count() * ROW_CHANNELS);
        rows.extend([place.x, place.y, place.z, 0.0, 0.0, 0.0]);
        let mut turned = vec![Quat::IDENTITY; body.joints()];
        world_rotations_from_features(&pose[..body.joints() * FEATURES_PER_JOINT], &mut turned);
        for (turned, neutral) in turned.iter_mut().zip(&body.neutral) {
            *turned *= neutral.conjugate();
        }
        for (joint, own) in body.rig.skeleton.joints.iter().zip(&turned) {
            let above = joint.parent.map_or(back, |parent| turned[parent].conjugate());
            let columns = six_d(above * *own);
            rows.extend(
                columns
                    .iter()
                    .zip(IDENTITY)
                    .map(|(column, still)| (column - still) * self.bend_gain),
            );
        }
        Some(rows)
    }

    /// The motion of rows `[J + 1, T, 6]` along a path of T frames. Feet that are low and slow are
    /// in contact.
    pub(super) fn decode(&self, body: &Body, rows: &[f32], path: &[PathPoint]) -> Motion {
        let (joints, frames) = (body.joints(), path.len());
        let skeleton = &body.rig.skeleton;
        let mut motion = Motion::default();
        let mut world = WorldMotion {
            joints,
            positions: Vec::with_capacity(frames * joints),
            rotations: Vec::with_capacity(frames * joints),
        };
        let mut turned = vec![Quat::IDENTITY; joints];
        for (frame, &[x, z, heading]) in path.iter().enumerate() {
            let row = |row: usize| {
                let start = (row * frames + frame) * ROW_CHANNELS;
                std::array::from_fn::<f32, ROW_CHANNELS, _>(|channel| rows[start + channel])
            };
            let [left, up, ahead, ..] = row(0);
            let share = (Vec3::new(left, up, ahead) + 1.0) / 2.0;
            let offset = yaw(heading) * ((share * (self.high - self.low) + self.low) * body.size_m);
            let root = offset + Vec3::new(x, body.height_m, z);
            let first = world.positions.len();
            for (index, joint) in skeleton.joints.iter().enumerate() {
                let columns = row(index + 1);
                let bend = from_six_d(std::array::from_fn(|n| columns[n] / self.bend_gain + IDENTITY[n]));
                let (above, place) = match joint.parent {
                    Some(parent) => {
                        let above = turned[parent];
                        (
                            above,
                            world.positions[first + parent] + above * body.bones_m[index],
                        )
                    }
                    None => (yaw(heading), root),
                };
                turned[index] = (above * bend).normalize();
                let rotation = turned[index] * body.neutral[index];
                motion.rotations.extend(six_d(rotation));
                world.positions.push(place);
                world.rotations.push(rotation);
            }
            let (sin, cos) = heading_of(world.rotations[first], skeleton.left_axis).sin_cos();
            let root: [f32; GLOBAL_ROOT] = [root.x, root.y, root.z, cos, sin];
            motion.root.extend(root);
        }
        if let Some(params) = &skeleton.contacts {
            let found = detect(&world, params, 0.0, self.fps);
            motion.contacts = found
                .into_iter()
                .map(|down| if down { 1.0 } else { 0.0 })
                .collect();
        }
        motion
    }
}
