//! A small walker and its style, shared by tests.

use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use troupe_motion::{ContactParams, Joint, Quat, Skeleton, Vec3};

use super::{Gait, Style, StyleCache, StyleKey};
use crate::testing::rig_of;
use troupe_motion::model::Rig;

/// A pelvis with a spine and two straight legs of 0.9 m; left is +X.
pub fn walker() -> Arc<Skeleton> {
    let joint = |name: &str, parent, offset: [f32; 3]| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::from(offset),
    };
    let joints = vec![
        joint("Hips", None, [0.0; 3]),
        joint("Spine", Some(0), [0.0, 0.4, 0.0]),
        joint("Leg_L", Some(0), [0.1, 0.0, 0.0]),
        joint("Foot_L", Some(2), [0.0, -0.9, 0.0]),
        joint("Leg_R", Some(0), [-0.1, 0.0, 0.0]),
        joint("Foot_R", Some(4), [0.0, -0.9, 0.0]),
    ];
    let contacts = ContactParams {
        joints: vec![3, 5],
        max_height_m: vec![0.12; 2],
        max_speed_mps: 0.4,
        clearance_m: vec![0.07; 2],
    };
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
}

/// A pack of that skeleton, without files.
pub fn walker_rig() -> Rig {
    rig_of("walkers", (*walker()).clone())
}

/// The parameters of a test gait.
#[derive(Clone, Copy)]
pub struct GaitShape {
    /// Unique in the style.
    pub name: &'static str,
    /// Speed to the left, m/s.
    pub left_mps: f32,
    /// Speed ahead, m/s.
    pub forward_mps: f32,
    /// Turning rate, rad/s.
    pub turn_rps: f32,
    /// Frames of a cycle.
    pub period_frames: f32,
    /// Number of keys.
    pub keys: usize,
    /// Share of the cycle between the left foot being foremost and the first key.
    pub start: f32,
    /// Largest angle of a leg, radians.
    pub swing: f32,
    /// Largest heading of the pelvis either way, radians.
    pub sway: f32,
    /// Height of the hips, metres.
    pub height_m: f32,
}

impl GaitShape {
    const WALK: Self = Self {
        name: "walk",
        left_mps: 0.0,
        forward_mps: 1.2,
        turn_rps: 0.0,
        period_frames: 32.0,
        keys: 16,
        start: 0.0,
        swing: 0.4,
        sway: 0.15,
        height_m: 0.95,
    };

    /// The gait: legs swing in the direction of travel, as cosines.
    pub fn gait(self) -> Gait {
        let direction = Vec3::new(self.left_mps, 0.0, self.forward_mps)
            .try_normalize()
            .unwrap_or(Vec3::Z);
        // The axis that turns a hanging leg to the direction.
        let axis = Vec3::new(-direction.z, 0.0, direction.x);
        let key = |index: usize| {
            let angle = TAU * (index as f32 / self.keys as f32 + self.start);
            let swing = |side: f32| Quat::from_axis_angle(axis, side * self.swing * angle.cos());
            let mut rotations = vec![Quat::IDENTITY; 6];
            rotations[2] = swing(1.0);
            rotations[4] = swing(-1.0);
            let per_second = if self.period_frames > 0.0 {
                TAU * 30.0 / self.period_frames
            } else {
                0.0
            };
            StyleKey {
                rotations,
                height_m: self.height_m - 0.05 * self.swing * (2.0 * angle).cos(),
                left_mps: self.left_mps,
                forward_mps: self.forward_mps + 0.1 * self.swing * (2.0 * angle).sin(),
                turn_rps: self.turn_rps + self.sway * per_second * angle.cos(),
            }
        };
        Gait {
            name: self.name.to_owned(),
            left_mps: self.left_mps,
            forward_mps: self.forward_mps,
            turn_rps: self.turn_rps,
            period_frames: self.period_frames,
            keys: (0..self.keys).map(key).collect(),
            built: false,
        }
    }
}

/// Stands, walks, runs, goes back and aside, and turns on the spot.
pub fn walker_style() -> Style {
    let walk = GaitShape::WALK;
    let shapes = [
        GaitShape {
            name: "idle",
            forward_mps: 0.0,
            period_frames: 0.0,
            keys: 1,
            swing: 0.0,
            sway: 0.0,
            height_m: 0.97,
            ..walk
        },
        walk,
        GaitShape {
            name: "run",
            forward_mps: 3.0,
            period_frames: 22.0,
            keys: 11,
            start: 0.25,
            swing: 0.7,
            height_m: 0.9,
            ..walk
        },
        GaitShape {
            name: "walk-back",
            forward_mps: -0.7,
            period_frames: 36.0,
            keys: 18,
            start: 0.6,
            swing: 0.25,
            ..walk
        },
        GaitShape {
            name: "walk-left",
            left_mps: 0.6,
            forward_mps: 0.6,
            period_frames: 30.0,
            swing: 0.3,
            ..walk
        },
        GaitShape {
            name: "walk-right",
            left_mps: -0.6,
            forward_mps: 0.6,
            period_frames: 30.0,
            swing: 0.3,
            ..walk
        },
        GaitShape {
            name: "turn-left",
            forward_mps: 0.0,
            turn_rps: 1.5,
            period_frames: 40.0,
            swing: 0.1,
            ..walk
        },
    ];
    Style {
        name: "walker".to_owned(),
        default_speed_mps: 1.2,
        replan_interval_frames: 9,
        allowed_token_counts: Vec::new(),
        is_static: false,
        root_ratio: 0.0,
        gaits: shapes.into_iter().map(GaitShape::gait).collect(),
        words: None,
        takes: Default::default(),
        built_in: false,
        cache: StyleCache::default(),
    }
}

/// A folder for one test, removed at its end.
pub struct TempFolder(PathBuf);

impl TempFolder {
    /// Creates a folder with `name` in its name.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("troupe-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// The folder's path, inside the system's folder for temporary files.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
