//! Input of the benches: the example walk as a request, as output of the networks, and as frames of
//! a crowd.

mod waiting;

use std::path::Path;
use std::sync::Arc;

use troupe_character::Path as FieldPath;
use troupe_character::live::{CONTEXT_FRAMES, FrameOut, LivePlan, LiveShape, finish_live};
use troupe_character::primitives::PlanTargets;
use troupe_engine::pack::Pack;
use troupe_live::session::{BlockWriter, Form};
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::conventions::Convention;
use troupe_motion::fk::world_transforms;
use troupe_motion::model::{KeyframeTask, Motion, Trace};
use troupe_motion::rotation::{six_d, to_wxyz};
use troupe_motion::{Clip, GlobalRoot, Quat, SegmentFrame, Skeleton, Vec3};
use troupe_proto::v1;
use troupe_service::inbetween::{Plan, RequestLimits, finish, prepare};

pub use waiting::Waiting;

/// Frames of the segment.
const FRAMES: usize = 64;
/// Frames of a live plan: a second, the context and the look-ahead.
const LIVE_FRAMES: usize = 36;

/// One request on the default pack, and the later stages of serving it.
pub struct Work {
    pub pack: Pack,
    pub request: v1::InBetweenRequest,
    plan: Plan,
    free: Plan,
    raw: Motion,
    shape: LiveShape,
    frame: FrameOut,
}

impl Work {
    /// The first frames of the example walk.
    pub fn load() -> Self {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let pack = Pack::load(&top.join("models/human")).unwrap();
        let bytes = std::fs::read(top.join("examples/walk.bvh")).unwrap();
        let skeleton = Arc::new(pack.rig.skeleton.as_ref().clone());
        let file = bvh::parse_bytes(&bytes).unwrap();
        let clip = file.to_clip_on(&skeleton, &BvhOptions::default()).unwrap();

        let request = request(&clip);
        let (_, mut plans) = prepare(&FieldPath::root(), &request, &pack.rig, LIMITS).unwrap();
        let frame = SegmentFrame::from_root(clip.root_at(CONTEXT_FRAMES - 1));
        let plan = plans.remove(0);
        Self {
            free: Plan {
                hold_feet: false,
                ..plan.clone()
            },
            plan,
            raw: raw(&clip, &pack.rig.skeleton, &frame),
            shape: shape(&clip, frame),
            frame: FrameOut {
                frame: 0,
                root: clip.root_positions[0],
                rotations: clip.rotations_at(0).to_vec(),
                contacts: 3,
                ..FrameOut::default()
            },
            request,
            pack,
        }
    }

    /// Checks a request, and moves it into the segment frame.
    pub fn prepare(&self) -> (Vec<KeyframeTask>, Vec<Plan>) {
        prepare(&FieldPath::root(), &self.request, &self.pack.rig, LIMITS).unwrap()
    }

    /// Turns output of the networks into the answer to a request.
    pub fn finish(&self) -> v1::CharacterResult {
        finish(&self.raw, &self.plan, &self.pack.rig).unwrap()
    }

    /// [`finish`](Self::finish) without holding feet. With it, all four contact joints are held in
    /// all frames, which is the worst case.
    pub fn finish_free(&self) -> v1::CharacterResult {
        finish(&self.raw, &self.free, &self.pack.rig).unwrap()
    }

    /// Turns output of the networks into a live plan.
    pub fn finish_live(&self) -> LivePlan {
        finish_live(&self.raw, &self.shape, &self.pack.rig).unwrap()
    }

    /// Encodes one tick of a crowd.
    pub fn encode(&self, characters: usize, encoding: v1::Encoding) -> v1::FrameBlock {
        let form = Form {
            encoding,
            positions: false,
            six_d: false,
        };
        let mut writer = BlockWriter::new(&self.pack.rig.skeleton, form, characters, 1);
        for character in 0..characters {
            writer.name(character as u32);
            writer.write(
                (character, 0),
                &self.frame,
                Convention::Native,
                &self.pack.rig.skeleton,
            );
        }
        writer.finish(|_| true)
    }
}

const LIMITS: RequestLimits = RequestLimits { max_characters: 1 };

fn request(clip: &Clip) -> v1::InBetweenRequest {
    let key = |frame: usize| v1::Keyframe {
        root: Some(v1::Root {
            position: Some(position(clip.root_positions[frame])),
            heading: None,
        }),
        velocity: None,
        qpos: Vec::new(),
        pose: Some(v1::Pose {
            rotations: clip
                .rotations_at(frame)
                .iter()
                .copied()
                .flat_map(to_wxyz)
                .collect(),
            root_height: None,
        }),
    };
    v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![v1::Character {
            context: (0..CONTEXT_FRAMES).map(key).collect(),
            targets: vec![key(FRAMES - 1)],
            frame_count: Some(FRAMES as u32),
            ..v1::Character::default()
        }],
        skeleton: String::new(),
    }
}

fn position(place: Vec3) -> v1::Vec3 {
    v1::Vec3 {
        x: place.x,
        y: place.y,
        z: place.z,
    }
}

/// The clip in the form of the networks' output.
fn raw(clip: &Clip, skeleton: &Skeleton, frame: &SegmentFrame) -> Motion {
    let joints = skeleton.joint_count();
    let (mut places, mut world) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
    let mut rotations = Vec::with_capacity(FRAMES * joints * 6);
    let mut root = Vec::with_capacity(FRAMES * 5);
    for at in 0..FRAMES {
        let mut pose = clip.rotations_at(at).to_vec();
        pose[0] = frame.to_segment_rotation(pose[0]);
        world_transforms(skeleton, Vec3::ZERO, &pose, &mut places, &mut world);
        rotations.extend(world.iter().flat_map(|&rotation| six_d(rotation)));
        root.extend(frame.to_segment_root(clip.root_at(at)).to_array());
    }
    Motion {
        rotations,
        contacts: vec![0.7; FRAMES * 4],
        trace: Some(Box::new(Trace {
            num_tokens: FRAMES / 4,
            count_probs: vec![0.0; 14],
            root_r_g3: root.clone(),
            tokens: vec![1; FRAMES],
        })),
        root,
    }
}

fn shape(clip: &Clip, frame: SegmentFrame) -> LiveShape {
    LiveShape {
        frame,
        context_roots: std::array::from_fn(|at| clip.root_positions[at]),
        context_rotations: (0..CONTEXT_FRAMES)
            .flat_map(|at| clip.rotations_at(at))
            .copied()
            .collect(),
        targets: PlanTargets {
            targets: Vec::new(),
            gap_poses: Vec::new(),
            frames: Some(LIVE_FRAMES),
            allowed_token_counts: Vec::new(),
            guide: None,
            follow: None,
            path: None,
            unfinished: false,
            r_g1: GlobalRoot::new(Vec3::ZERO, 0.0),
            r_g2: Vec::new(),
            gaits: Vec::new(),
        },
    }
}
