//! Makes the tasks of the accuracy check with the pack itself. Keyframes are frames of its own
//! decoder, so the check needs no data and tests the networks where they work.

use troupe_motion::model::{Dims, KeyTensors, KeyframeTask, Motion};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::{GlobalRoot, LocalRoot, SegmentFrame, Skeleton};

use super::{Joints, global_roots};
use crate::pack::Pack;
use crate::{DecoderOutput, EngineError, Pipeline, Stages};

/// Number of tasks in a batch.
pub const PROBE_BATCH: usize = 16;
/// Walking speeds of the tasks, in turns, m/s.
const SPEEDS_MPS: [f32; 4] = [0.0, 0.8, 1.4, 2.5];
/// Directions of the tasks, in turns, radians.
const TURNS: [f32; 4] = [0.0, 0.8, -0.8, 1.6];
/// Number of rounds in which motion is made from keyframes of earlier motion before the tasks are
/// taken from it.
const ROUNDS: usize = 2;

/// Tasks, with the stages that made them.
pub struct Probe {
    /// The tasks; those of a batch have one segment length.
    pub batches: Vec<Vec<KeyframeTask>>,
    /// The reference engine.
    pub reference: Box<dyn Stages>,
}

/// Batches of [`PROBE_BATCH`] tasks: one of the longest segments, one of medium and one of short
/// ones.
///
/// The first round has only roots as keyframes, without poses. The next take four frames of that
/// motion as the context, and a later one as the target.
///
/// Returns the stages together with the tasks.
///
/// # Errors
/// [`EngineError`] if a stage of the reference fails, or gives values out of the contract.
pub fn probe(pack: &Pack, reference: Box<dyn Stages>) -> Result<Probe, EngineError> {
    let dims = pack.rig.dims;
    let middle = (dims.min_tokens + dims.max_tokens) / 2;
    let short = (dims.min_tokens + 2).min(middle);
    let mut pipeline = Pipeline::new(dims, reference, PROBE_BATCH);
    let fps = pack.manifest.fps;
    let batches = [dims.max_tokens, middle, short]
        .into_iter()
        .map(|tokens| {
            // The rest must fit into this motion: a segment with its context and target.
            let mut items: Vec<KeyframeTask> = (0..PROBE_BATCH)
                .map(|index| walk(&dims, fps, dims.max_tokens, index))
                .collect();
            for round in 1..=ROUNDS {
                let (answers, _) = pipeline.run(&items)?;
                let motions = answers.into_iter().collect::<Result<Vec<Motion>, _>>()?;
                let tokens = if round == ROUNDS { tokens } else { dims.max_tokens };
                items = motions
                    .iter()
                    .enumerate()
                    .map(|(index, motion)| from_motion(&pack.rig.skeleton, &dims, fps, motion, tokens, index))
                    .collect();
            }
            Ok(items)
        })
        .collect::<Result<_, EngineError>>()?;
    Ok(Probe {
        batches,
        reference: pipeline.into_stages(),
    })
}

/// A task with roots only.
fn walk(dims: &Dims, fps: f32, tokens: usize, index: usize) -> KeyframeTask {
    let frames = tokens * dims.frames_per_token;
    let speed = SPEEDS_MPS[index % SPEEDS_MPS.len()];
    let turn = TURNS[(index / SPEEDS_MPS.len()) % TURNS.len()];
    let height = 0.9;
    let context = (0..dims.context_frames)
        .map(|frame| {
            let z = speed * (frame as f32 - (dims.context_frames as f32 - 1.0)) / fps;
            KeyTensors {
                local_root: Some([0.0, speed, 0.0, height]),
                global_root: Some([0.0, height, z, 1.0, 0.0]),
                pose: None,
            }
        })
        .collect();
    let way = speed * (frames - dims.context_frames) as f32 / fps;
    let (sin, cos) = turn.sin_cos();
    let (half_sin, half_cos) = (turn / 2.0).sin_cos();
    let target = KeyTensors {
        local_root: Some([speed * sin, speed * cos, 0.0, height]),
        global_root: Some([way * half_sin, height, way * half_cos, cos, sin]),
        pose: None,
    };
    task(dims, vec![target], context, tokens, index, 1.0)
}

fn task(
    dims: &Dims,
    targets: Vec<KeyTensors>,
    context: Vec<KeyTensors>,
    tokens: usize,
    seed: usize,
    temperature: f32,
) -> KeyframeTask {
    KeyframeTask {
        context,
        targets,
        frames: Some(tokens * dims.frames_per_token),
        allowed_counts: (dims.min_tokens..=dims.max_tokens)
            .map(|count| count == tokens)
            .collect(),
        seed: seed as u64,
        temperature,
        pose_steps: 1,
        root_guide: None,
        root_override: None,
        gap_poses: Vec::new(),
    }
}

/// A task of `tokens` tokens whose keyframes are frames of `motion`. The first frames are the
/// context. The target is a segment's length later, or the motion's last frame.
fn from_motion(
    skeleton: &Skeleton,
    dims: &Dims,
    fps: f32,
    motion: &Motion,
    tokens: usize,
    index: usize,
) -> KeyframeTask {
    let last = motion.frames() - 1;
    let target = (tokens * dims.frames_per_token - 1).min(last);
    let mut output = DecoderOutput::new(dims, 1);
    output.set_length(dims, motion.frames() / dims.frames_per_token);
    output.rotations.row_mut(0).copy_from_slice(&motion.rotations);
    output.global_root.row_mut(0).copy_from_slice(&motion.root);
    let mut joints = Joints::new(skeleton);
    // The heading of a keyframe is that of its pelvis, as in requests.
    let mut roots: Vec<GlobalRoot> = global_roots(&motion.root).collect();
    for (frame, root) in roots.iter_mut().enumerate() {
        joints.place(skeleton, dims, &output, 0, frame);
        root.heading = heading_of(joints.rotations[0], skeleton.left_axis);
    }
    let frame = SegmentFrame::from_root(roots[dims.context_frames - 1]);
    let mut key = |at: usize| {
        joints.place(skeleton, dims, &output, 0, at);
        let mut pose = vec![0.0; dims.pose()];
        troupe_motion::features::pose_features_from_world(
            roots[at].position,
            &joints.positions,
            &joints.rotations,
            &mut pose,
        );
        frame.rotate_pose_features_to_segment(&mut pose);
        // The first frame has no frame before, and takes the second's velocity.
        let now = at.max(1);
        let step = (roots[now].position - roots[now - 1].position) * fps;
        let local = LocalRoot {
            vx: step.x,
            vz: step.z,
            omega: wrap_angle(roots[now].heading - roots[now - 1].heading) * fps,
            height: roots[at].position.y,
        };
        KeyTensors {
            local_root: Some(frame.to_segment_local_root(local).to_array()),
            global_root: Some(frame.to_segment_root(roots[at]).to_array()),
            pose: Some(pose.into()),
        }
    };
    let context = (0..dims.context_frames).map(&mut key).collect();
    let targets = vec![key(target)];
    task(dims, targets, context, tokens, index, 0.0)
}
