//! Input of the benches: the example walk on the default pack's skeleton.

#[allow(dead_code, reason = "one of the benches uses it")]
pub mod characters;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::codec::{
    BYTES_PER_ROOT, BYTES_PER_ROTATION, read_roots, read_rotations, write_roots, write_rotations,
};
use troupe_motion::features::pose_features;
use troupe_motion::fk::{local_from_world_rotations, world_transforms};
use troupe_motion::interpolate::blend;
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::rotation::{from_six_ds, six_d};
use troupe_motion::{Clip, Quat, Skeleton, Vec3};

/// Frames of the longest segment.
const FRAMES: usize = 64;
/// Frames over which a pin fades, as on the server.
const REACH: usize = 8;

#[derive(Deserialize)]
struct Manifest {
    skeleton: Skeleton,
}

/// One segment, with memory for every result.
pub struct Segment {
    pub clip: Clip,
    pub six_d: Vec<[f32; 6]>,
    pub packed: Vec<u8>,
    pub packed_roots: Vec<u8>,
    pub bytes: Vec<u8>,
    pub rotations: Vec<Quat>,
    pub roots: Vec<Vec3>,
    pub positions: Vec<Vec3>,
    pub world: Vec<Quat>,
    pub features: Vec<f32>,
}

impl Segment {
    /// The first 64 frames of the example walk.
    pub fn load() -> Self {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let read = |path: PathBuf| std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let manifest = String::from_utf8(read(top.join("models/human/pack.toml"))).unwrap();
        let skeleton = Arc::new(toml::from_str::<Manifest>(&manifest).unwrap().skeleton);
        let file = bvh::parse_bytes(&read(top.join("examples/walk.bvh"))).unwrap();
        let clip = file.to_clip_on(&skeleton, &BvhOptions::default()).unwrap();
        let clip = clip.slice(0..FRAMES).unwrap();

        let joints = skeleton.joint_count();
        let (mut packed, mut packed_roots) = (Vec::new(), Vec::new());
        write_rotations(&clip.rotations, &mut packed);
        write_roots(&clip.root_positions, &mut packed_roots);
        Self {
            six_d: clip.rotations.iter().map(|&q| six_d(q)).collect(),
            bytes: Vec::with_capacity(FRAMES * (joints * BYTES_PER_ROTATION + BYTES_PER_ROOT)),
            rotations: clip.rotations.clone(),
            roots: Vec::with_capacity(FRAMES),
            positions: vec![Vec3::ZERO; joints],
            world: vec![Quat::IDENTITY; joints],
            features: vec![0.0; joints * 9],
            packed,
            packed_roots,
            clip,
        }
    }

    /// Encodes every rotation and root into the compact form.
    pub fn encode(&mut self) -> usize {
        self.bytes.clear();
        write_rotations(&self.clip.rotations, &mut self.bytes);
        write_roots(&self.clip.root_positions, &mut self.bytes);
        self.bytes.len()
    }

    /// Decodes every rotation and root from the compact form.
    pub fn decode(&mut self) -> usize {
        self.rotations.clear();
        self.roots.clear();
        read_rotations(&self.packed, &mut self.rotations);
        read_roots(&self.packed_roots, &mut self.roots);
        self.rotations.len() + self.roots.len()
    }

    /// World positions and rotations of every frame.
    pub fn kinematics(&mut self) -> Vec3 {
        let skeleton = &self.clip.skeleton;
        for (frame, &root) in self.clip.root_positions.iter().enumerate() {
            let pose = self.clip.rotations_at(frame);
            world_transforms(skeleton, root, pose, &mut self.positions, &mut self.world);
        }
        self.positions[0]
    }

    /// Parent-relative rotations of every frame from 6D world rotations, which the decoder gives.
    pub fn parent_relative(&mut self) -> Quat {
        let joints = self.clip.skeleton.joint_count();
        for (frame, six_d) in self.six_d.chunks_exact(joints).enumerate() {
            from_six_ds(six_d.as_flattened(), &mut self.world);
            let out = &mut self.rotations[frame * joints..(frame + 1) * joints];
            local_from_world_rotations(&self.clip.skeleton, &self.world, out);
        }
        self.rotations[0]
    }

    /// Pose features of every frame.
    pub fn features(&mut self) -> f32 {
        for (frame, &root) in self.clip.root_positions.iter().enumerate() {
            let pose = self.clip.rotations_at(frame);
            pose_features(&self.clip.skeleton, root, pose, &mut self.features);
        }
        self.features[0]
    }

    /// Interpolates between all consecutive frames, like a stream at 60 Hz.
    pub fn interpolate(&mut self) -> Vec3 {
        let mut last = Vec3::ZERO;
        for frame in 1..self.clip.frames() {
            let from = (
                self.clip.root_positions[frame - 1],
                self.clip.rotations_at(frame - 1),
            );
            let to = (self.clip.root_positions[frame], self.clip.rotations_at(frame));
            last = blend(from, to, 0.5, &mut self.world);
        }
        last
    }

    /// Pins context and target poses.
    pub fn pin(&mut self) -> Quat {
        let joints = self.clip.skeleton.joint_count();
        self.rotations.copy_from_slice(&self.clip.rotations);
        let frames = [0, 1, 2, 3, FRAMES - 1];
        let pins = frames.map(|frame| PosePin {
            frame,
            rotations: self.clip.rotations_at(frame),
        });
        pin_poses(&mut self.rotations, joints, &pins, REACH);
        self.rotations[0]
    }
}
