//! A G1 that walks: its hinges and limits, two gaits, and an engine whose poses no hinge can make.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Deserialize;
use troupe_engine::pack::Pack;
use troupe_engine::{DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, Stages, TokenInput};
use troupe_motion::fk::world_transforms;
use troupe_motion::robot::{Robot, RobotDoc};
use troupe_motion::rotation::{six_d, to_wxyz};
use troupe_motion::{Quat, Skeleton, Vec3};
use troupe_proto::v1;
use troupe_server::server::PackSource;

use super::{Gate, StraightLine, TestServer};

/// Name of the pack.
pub const G1: &str = "g1";
/// Numbers of its `qpos`.
pub const QPOS: usize = 36;
/// Number of joints, the root among them.
pub const JOINTS: usize = 34;
/// Height of its root as it stands, metres.
pub const STAND_M: f32 = 0.78;

/// The two tables of its `pack.toml`.
#[derive(Deserialize)]
struct Tables {
    skeleton: Skeleton,
    robot: RobotDoc,
}

/// The G1's pack, whose styles are in `folder`.
pub fn pack(folder: &Path) -> Pack {
    let tables: Tables = toml::from_str(include_str!("../../../motion/src/robot/g1.toml")).unwrap();
    let mut manifest = super::pack(G1).manifest;
    manifest.skeleton = tables.skeleton;
    manifest.robot = Some(tables.robot);
    Pack::from_manifest(manifest, folder).unwrap()
}

/// The robot of the G1's skeleton.
pub fn robot(skeleton: &Skeleton) -> &Robot {
    skeleton.robot.as_ref().unwrap()
}

/// Angles of a leg's pitch joints on both sides, `swing` radians apart, and bent elbows.
fn angles(skeleton: &Skeleton, swing: f32) -> Vec<f32> {
    let robot = robot(skeleton);
    let mut angles = vec![0.0; robot.hinges().len()];
    for (side, swing) in [("left", swing), ("right", -swing)] {
        let mut set = |name: &str, angle: f32| {
            let joint = skeleton.joint_index(&format!("{side}_{name}")).unwrap();
            angles[robot.hinge_of(joint).unwrap()] = angle;
        };
        set("hip_pitch", -0.2 - swing);
        set("knee", 0.4);
        set("ankle_pitch", -0.2 + swing);
        set("elbow", 0.9);
    }
    angles
}

/// The G1 as it stands, at a place on the ground, facing +Z: its `qpos`.
pub fn standing(skeleton: &Skeleton, x: f32, z: f32) -> Vec<f32> {
    let mut qpos = vec![0.0; QPOS];
    let angles = angles(skeleton, 0.0);
    robot(skeleton).write_qpos(Vec3::new(x, STAND_M, z), Quat::IDENTITY, &angles, &mut qpos);
    qpos
}

/// A style that stands and walks.
fn style(skeleton: &Skeleton) -> v1::Style {
    let gait = |name: &str, forward: f32, period_frames: f32, swings: &[f32]| {
        let key = |&swing: &f32| {
            let mut rotations = vec![Quat::IDENTITY; JOINTS];
            robot(skeleton).pose(Quat::IDENTITY, &angles(skeleton, swing), &mut rotations);
            v1::GaitKey {
                rotations: rotations.into_iter().flat_map(to_wxyz).collect(),
                height: STAND_M,
                forward,
                ..v1::GaitKey::default()
            }
        };
        v1::Gait {
            name: name.into(),
            forward,
            period_frames,
            keys: swings.iter().map(key).collect(),
            ..v1::Gait::default()
        }
    };
    let swings: Vec<f32> = (0..8)
        .map(|key| 0.3 * (std::f32::consts::TAU * key as f32 / 8.0).cos())
        .collect();
    v1::Style {
        name: "normal".into(),
        default_speed: 0.8,
        replan_interval_frames: 9,
        gaits: vec![gait("idle", 0.0, 0.0, &[0.0]), gait("walk", 0.8, 30.0, &swings)],
        ..v1::Style::default()
    }
}

/// A folder of its own with the G1's styles, removed when it is dropped.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("troupe-g1-{test}-{}", std::process::id()));
        std::fs::create_dir_all(path.join("styles")).unwrap();
        let style = style(&pack(&path).rig.skeleton);
        std::fs::write(
            path.join("styles/normal.json"),
            serde_json::to_string(&style).unwrap(),
        )
        .unwrap();
        Self(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Goes straight as [`StraightLine`] does, but every joint of the G1 turns a little to all sides,
/// and its knees the wrong way.
struct Wobble {
    line: StraightLine,
    skeleton: Arc<Skeleton>,
}

impl Stages for Wobble {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.line.root(rows, input, output)
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        self.line.pose(rows, input, output)
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        self.line.decoder(rows, input, output)?;
        let mut local = vec![Quat::IDENTITY; JOINTS];
        let mut world = local.clone();
        let mut places = vec![Vec3::ZERO; JOINTS];
        for row in 0..rows {
            // One foot is down, then the other; each plan goes on where the one before it, nine
            // frames ago, was.
            let contacts = output.contacts.row_mut(row).as_chunks_mut::<4>().0;
            for (frame, down) in contacts.iter_mut().enumerate() {
                let left = if (4..8).contains(&(frame % 9)) { 0.0 } else { 1.0 };
                *down = [left, left, 1.0 - left, 1.0 - left];
            }
            let frames = output.rotations.row_mut(row).chunks_exact_mut(JOINTS * 6);
            for (frame, out) in frames.enumerate() {
                let mut bent = angles(&self.skeleton, 0.0);
                // The knee of one leg, and only now and then.
                bent[3] = if frame % 16 >= 8 { -0.4 } else { 0.4 };
                robot(&self.skeleton).pose(Quat::IDENTITY, &bent, &mut local);
                for (joint, rotation) in local.iter_mut().enumerate().skip(1) {
                    let wave = |shift: f32| 0.05 * (0.4 * frame as f32 + joint as f32 + shift).sin();
                    *rotation *= Quat::from_scaled_axis(Vec3::new(wave(0.0), wave(2.0), wave(4.0)));
                }
                world_transforms(&self.skeleton, Vec3::ZERO, &local, &mut places, &mut world);
                for (numbers, &rotation) in out.chunks_exact_mut(6).zip(&world) {
                    numbers.copy_from_slice(&six_d(rotation));
                }
            }
        }
        Ok(())
    }
}

/// A ready server with the test packs and the G1.
pub async fn start(folder: &Folder) -> TestServer {
    let path = folder.path().to_owned();
    let more = move |workers| {
        let pack = pack(&path);
        let skeleton = Arc::clone(&pack.rig.skeleton);
        let stages = move |pack: &Pack| {
            let line = StraightLine {
                dims: pack.rig.dims,
                gate: Gate::default(),
            };
            let skeleton = Arc::clone(&skeleton);
            Ok(Box::new(Wobble { line, skeleton }) as Box<dyn Stages>)
        };
        vec![PackSource::of_stages(pack, workers, Box::new(stages), None)]
    };
    let mut server = TestServer::start_also(|_| {}, Duration::ZERO, more).await;
    server.handle.ready().await.unwrap();
    server
}
