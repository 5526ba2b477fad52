//! In-betweening tasks, built from clips or by hand, and their answers.

use std::ops::RangeInclusive;

use glam::{Quat, Vec3};
use troupe_motion::clip::Clip;
use troupe_motion::robot::Robot;
use troupe_motion::rotation::{from_wxyz, to_wxyz};
use troupe_proto::v1;

use crate::error::{AnswerError, RequestError};
use crate::pack::Pack;
use crate::root_key::RootKey;

/// Context frames before a gap.
pub const CONTEXT_FRAMES: usize = 4;

/// A keyframe constraint: any subset of root, velocity and pose, but at least one.
///
/// ```
/// use glam::Vec3;
/// use troupe_client::Key;
///
/// // Be two metres ahead, facing +X, in any pose.
/// let key = Key::default().root(Vec3::new(0.0, 0.93, 2.0), Some(std::f32::consts::FRAC_PI_2));
/// # assert_ne!(key, Key::default());
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Key {
    root: Option<v1::Root>,
    velocity: Option<v1::RootVelocity>,
    rotations: Option<Vec<f32>>,
    root_height: Option<f32>,
    qpos: Vec<f32>,
}

impl Key {
    /// The pose and root of one frame of a clip. The heading is that of the pose.
    ///
    /// # Errors
    /// [`RequestError::FrameOutside`].
    pub fn from_clip(clip: &Clip, frame: usize) -> Result<Self, RequestError> {
        check_frame(clip, "frame", frame)?;
        Ok(Self::at(clip, frame))
    }

    fn at(clip: &Clip, frame: usize) -> Self {
        let key = Self::default().root(clip.root_positions[frame], None);
        key.pose(clip.rotations_at(frame))
    }

    /// The keyframes of all frames of a clip, as by [`Self::from_clip`].
    pub fn all(clip: &Clip) -> Vec<Self> {
        (0..clip.frames()).map(|frame| Self::at(clip, frame)).collect()
    }

    /// Fixes the place of the root joint (world, metres) and its heading (radians about +Y).
    /// Without a heading that of the pose counts, and a pose must be given.
    #[must_use]
    pub fn root(mut self, position_m: Vec3, heading: Option<f32>) -> Self {
        self.root = Some(v1::Root {
            position: Some(vector(position_m)),
            heading,
        });
        self
    }

    /// Fixes the velocity of the root: metres per second along world X and Z, and radians per
    /// second about +Y.
    #[must_use]
    pub fn velocity(mut self, x_mps: f32, z_mps: f32, angular_rps: f32) -> Self {
        self.velocity = Some(v1::RootVelocity {
            x: x_mps,
            z: z_mps,
            angular: angular_rps,
            height: None,
        });
        self
    }

    /// Fixes the pose: one rotation for each joint, the first in the world, the others relative to
    /// their parents.
    #[must_use]
    pub fn pose(mut self, rotations: &[Quat]) -> Self {
        self.rotations = Some(rotations.iter().copied().flat_map(to_wxyz).collect());
        self
    }

    /// Fixes the root joint's height above the ground in metres, which a keyframe without a root
    /// needs.
    #[must_use]
    pub fn root_height(mut self, height_m: f32) -> Self {
        self.root_height = Some(height_m);
        self
    }

    /// Fixes root and pose of a robot by MuJoCo's `qpos`, instead of both. For packs with a robot
    /// ([`troupe_motion::robot`]).
    #[must_use]
    pub fn qpos(mut self, qpos: &[f32]) -> Self {
        self.qpos = qpos.to_vec();
        self
    }

    /// The keyframe on the wire.
    pub fn to_message(&self) -> v1::Keyframe {
        let root_height = self.root_height;
        v1::Keyframe {
            root: self.root,
            velocity: self.velocity.map(|velocity| v1::RootVelocity {
                height: root_height,
                ..velocity
            }),
            pose: self.rotations.clone().map(|rotations| v1::Pose {
                rotations,
                root_height,
            }),
            qpos: self.qpos.clone(),
        }
    }
}

/// Length of the segment, from the first context frame to the last target keyframe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SegmentLength {
    /// This number of frames.
    Frames(u32),
    /// The model chooses it.
    Predicted,
    /// The model chooses it from these token counts (four frames each).
    PredictedFrom(Vec<u32>),
}

/// A gap of one character: four context frames, target keyframes, and how to fill the frames
/// between.
#[derive(Debug, Clone, PartialEq)]
pub struct InBetween {
    character: v1::Character,
    /// Rate and joints of the clip that the gap comes from.
    source: Option<(f32, usize)>,
}

impl InBetween {
    /// A gap between four context frames and one to four target keyframes. The model chooses its
    /// length.
    pub fn new(context: [Key; CONTEXT_FRAMES], targets: impl IntoIterator<Item = Key>) -> Self {
        let character = v1::Character {
            context: context.iter().map(Key::to_message).collect(),
            targets: targets.into_iter().map(|key| key.to_message()).collect(),
            ..Default::default()
        };
        Self {
            character,
            source: None,
        }
    }

    /// The gap of a clip between `from`, the last context frame, and `to`, the target keyframe.
    /// Length, poses and roots at both ends are the clip's. The clip must be on the pack's skeleton
    /// and at its rate.
    ///
    /// # Errors
    /// [`RequestError::ContextCut`], [`RequestError::FrameOutside`] and [`RequestError::Order`].
    pub fn from_clip(clip: &Clip, from: usize, to: usize) -> Result<Self, RequestError> {
        Self::from_clip_range(clip, from, to..=to)
    }

    /// As [`Self::from_clip`], with several consecutive target keyframes.
    ///
    /// # Errors
    /// As [`Self::from_clip`].
    pub fn from_clip_range(
        clip: &Clip,
        from: usize,
        targets: RangeInclusive<usize>,
    ) -> Result<Self, RequestError> {
        let least = CONTEXT_FRAMES - 1;
        let (to, last) = (*targets.start(), *targets.end());
        check_frame(clip, "from", from)?;
        check_frame(clip, "to", to)?;
        check_frame(clip, "the last target frame", last)?;
        if from < least {
            return Err(RequestError::ContextCut { from, least });
        }
        if to <= from || last < to {
            return Err(RequestError::Order { from, to });
        }
        let start = from - least;
        let keys = |frames: RangeInclusive<usize>| {
            frames
                .map(|f| Key::from_clip(clip, f).map(|key| key.to_message()))
                .collect::<Result<Vec<_>, _>>()
        };
        let character = v1::Character {
            context: keys(start..=from)?,
            targets: keys(targets)?,
            frame_count: u32::try_from(last - start + 1).ok(),
            ..Default::default()
        };
        Ok(Self {
            character,
            source: Some((clip.fps, clip.skeleton.joint_count())),
        })
    }

    /// Sets a name that comes back with the answer, at most 128 bytes.
    #[must_use]
    pub fn id(mut self, id: impl Into<String>) -> Self {
        self.character.id = id.into();
        self
    }

    /// Sets the length of the segment.
    #[must_use]
    pub fn length(mut self, length: SegmentLength) -> Self {
        let (frames, tokens) = match length {
            SegmentLength::Frames(frames) => (Some(frames), Vec::new()),
            SegmentLength::Predicted => (None, Vec::new()),
            SegmentLength::PredictedFrom(tokens) => (None, tokens),
        };
        self.character.frame_count = frames;
        self.character.allowed_token_counts = tokens;
        self
    }

    /// The same seed, task and pack give the same frames.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.character.seed = seed;
        self
    }

    /// Sets the temperature, 0 to 2. 0, the default, takes the most likely motion. Above 0 motion
    /// is sampled with the seed.
    #[must_use]
    pub fn temperature(mut self, temperature: f32) -> Self {
        self.character.temperature = temperature;
        self
    }

    /// Sets the passes of the pose module: 1, the default, to 10.
    #[must_use]
    pub fn pose_steps(mut self, steps: u32) -> Self {
        self.character.pose_steps = Some(steps);
        self
    }

    /// Asks for the output of each stage too.
    #[must_use]
    pub fn return_intermediates(mut self, yes: bool) -> Self {
        self.character.return_intermediates = yes;
        self
    }

    /// Asks for world joint positions too.
    #[must_use]
    pub fn return_positions(mut self, yes: bool) -> Self {
        self.character.return_positions = yes;
        self
    }

    /// Asks for a robot's `qpos` too.
    #[must_use]
    pub fn return_qpos(mut self, yes: bool) -> Self {
        self.character.return_qpos = yes;
        self
    }

    /// Sets whether standing feet are held still by bending the legs. The default is true.
    #[must_use]
    pub fn hold_feet(mut self, yes: bool) -> Self {
        self.character.hold_feet = Some(yes);
        self
    }

    /// Lets the server refuse the task if its answer would not be feasible, and say what would be.
    #[must_use]
    pub fn strict(mut self, yes: bool) -> Self {
        self.character.strict = yes;
        self
    }

    /// Fixes the root in some frames, in rising order, or in all. Between them, the predicted path
    /// is moved by a smooth curve. The pose tokens are still those of the predicted path. The
    /// segment's length must be given ([`SegmentLength::Frames`], or that of a clip).
    #[must_use]
    pub fn root(mut self, keys: impl IntoIterator<Item = RootKey>) -> Self {
        self.character.root = keys.into_iter().map(RootKey::to_message).collect();
        self
    }

    /// The task on the wire.
    ///
    /// # Errors
    /// [`RequestError::FrameRate`] and [`RequestError::Joints`] if the clip it was taken from
    /// does not fit the pack.
    pub fn to_message(&self, pack: &Pack) -> Result<v1::Character, RequestError> {
        if let Some((fps, joints)) = self.source {
            pack.check_clip(fps, joints)?;
        }
        Ok(self.character.clone())
    }
}

/// One character's answer.
#[derive(Debug, Clone)]
pub struct InBetweenAnswer {
    /// Name of the task.
    pub id: String,
    /// The whole segment, from the first context frame to the last target keyframe, on the pack's
    /// skeleton.
    pub clip: Clip,
    /// Frames x contact joints: probability that the joint is in contact with the ground.
    pub contacts: Vec<f32>,
    /// Frames x joints: world positions in metres. Empty if the task did not ask for them.
    pub positions: Vec<Vec3>,
    /// Frames x numbers of a robot's `qpos`. Empty if the task did not ask for them.
    pub qpos: Vec<f32>,
    /// One value per frame: how far the motion is from the poses that a robot's hinges allow,
    /// radians. Empty without a robot.
    pub hinge_residuals: Vec<f32>,
    /// One value per frame: number of a robot's hinges whose limits were exceeded. Empty without a
    /// robot.
    pub clamped_hinges: Vec<u32>,
    /// One value per frame: speed of a robot's hinge since the frame before, divided by its highest
    /// speed. The largest of all hinges; above 1 the hinge would have to be faster than it can.
    /// Empty without a robot.
    pub hinge_speed_ratios: Vec<f32>,
    /// One value per frame: index of the hinge with that ratio. Empty without a robot.
    pub fastest_hinges: Vec<u32>,
    /// One value per frame: largest acceleration of a robot's hinges, rad/s². Empty without a
    /// robot.
    pub hinge_accelerations: Vec<f32>,
    /// Output of each stage. None if the task did not ask for it.
    pub intermediates: Option<v1::Intermediates>,
    /// Whether the motion stays within the limits of the pack's data. None if the pack has no
    /// limits.
    pub feasibility: Option<v1::Feasibility>,
}

impl InBetweenAnswer {
    /// Reads an answer, and checks the length of every array.
    ///
    /// # Errors
    /// [`AnswerError::Missing`], [`AnswerError::Length`] and [`AnswerError::Frames`].
    pub fn from_message(result: v1::CharacterResult, pack: &Pack) -> Result<Self, AnswerError> {
        let frames = result.frames.ok_or(AnswerError::Missing("frames"))?;
        let count = frames.frame_count as usize;
        let joints = pack.skeleton().joint_count();
        let contact_joints = pack.description().contact_joints.len();
        check_length("frames.root_positions", &frames.root_positions, count * 3)?;
        check_length("frames.rotations", &frames.rotations, count * joints * 4)?;
        check_length("frames.contacts", &frames.contacts, count * contact_joints)?;
        if !frames.positions.is_empty() {
            check_length("frames.positions", &frames.positions, count * joints * 3)?;
        }
        let of_robot = if pack.robot().is_some() { count } else { 0 };
        check_length("frames.hinge_residuals", &frames.hinge_residuals, of_robot)?;
        check_length("frames.clamped_hinges", &frames.clamped_hinges, of_robot)?;
        let [ratios, accelerations] = [&frames.hinge_speed_ratios, &frames.hinge_accelerations];
        check_length("frames.hinge_speed_ratios", ratios, of_robot)?;
        check_length("frames.fastest_hinges", &frames.fastest_hinges, of_robot)?;
        check_length("frames.hinge_accelerations", accelerations, of_robot)?;
        if !frames.qpos.is_empty() {
            let numbers = pack.robot().map_or(0, Robot::qpos_len);
            check_length("frames.qpos", &frames.qpos, count * numbers)?;
        }
        let rotations = frames.rotations.as_chunks::<4>().0;
        Ok(Self {
            id: result.id,
            clip: Clip::new(
                pack.skeleton().clone(),
                pack.fps(),
                vectors(&frames.root_positions),
                rotations.iter().copied().map(from_wxyz).collect(),
            )?,
            contacts: frames.contacts,
            positions: vectors(&frames.positions),
            qpos: frames.qpos,
            hinge_residuals: frames.hinge_residuals,
            clamped_hinges: frames.clamped_hinges,
            hinge_speed_ratios: frames.hinge_speed_ratios,
            fastest_hinges: frames.fastest_hinges,
            hinge_accelerations: frames.hinge_accelerations,
            intermediates: result.intermediates,
            feasibility: result.feasibility,
        })
    }
}

fn vector(v: Vec3) -> v1::Vec3 {
    v1::Vec3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

fn vectors(numbers: &[f32]) -> Vec<Vec3> {
    numbers
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&v| Vec3::from_array(v))
        .collect()
}

fn check_frame(clip: &Clip, what: &'static str, frame: usize) -> Result<(), RequestError> {
    match clip.frames() {
        0 => Err(RequestError::EmptyClip),
        frames if frame < frames => Ok(()),
        frames => Err(RequestError::FrameOutside {
            what,
            frame,
            last: frames - 1,
        }),
    }
}

fn check_length<T>(field: &'static str, numbers: &[T], expected: usize) -> Result<(), AnswerError> {
    if numbers.len() == expected {
        return Ok(());
    }
    Err(AnswerError::Length {
        field,
        got: numbers.len(),
        expected,
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::pack::tests::message;

    fn pack() -> Pack {
        Pack::try_from(message()).unwrap()
    }

    /// A clip whose root height is the number of the frame.
    fn clip(frames: usize) -> Clip {
        let roots = (0..frames).map(|f| Vec3::Y * f as f32).collect();
        Clip::new(
            pack().skeleton().clone(),
            30.0,
            roots,
            vec![Quat::IDENTITY; frames * 2],
        )
        .unwrap()
    }

    #[test]
    fn a_gap_takes_its_keyframes_from_the_clip() {
        let gap = InBetween::from_clip_range(&clip(60), 10, 30..=31)
            .unwrap()
            .seed(7)
            .to_message(&pack())
            .unwrap();
        let heights = |keys: &[v1::Keyframe]| {
            keys.iter()
                .map(|k| k.root.unwrap().position.unwrap().y)
                .collect::<Vec<_>>()
        };
        assert_eq!(heights(&gap.context), [7.0, 8.0, 9.0, 10.0]);
        assert_eq!(heights(&gap.targets), [30.0, 31.0]);
        assert_eq!((gap.frame_count, gap.seed), (Some(25), 7));
        assert_eq!(
            gap.context[0].pose.as_ref().unwrap().rotations,
            [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        );
    }

    #[test]
    fn given_roots_are_on_the_wire() {
        let gap = InBetween::from_clip(&clip(60), 10, 30).unwrap().root([
            RootKey::new(8).ground(Vec2::new(0.5, 1.0)),
            RootKey::new(12).height(0.9).heading(-0.2),
        ]);
        let roots = gap.to_message(&pack()).unwrap().root;
        let all = roots
            .iter()
            .map(|root| (root.frame, root.x, root.z, root.height, root.heading));
        assert_eq!(
            all.collect::<Vec<_>>(),
            [
                (8, Some(0.5), Some(1.0), None, None),
                (12, None, None, Some(0.9), Some(-0.2))
            ]
        );
    }

    #[test]
    fn frames_outside_the_clip_are_named() {
        let clip = clip(60);
        for (from, to, wanted) in [
            (2, 30, "must be 3 or more"),
            (60, 70, "from 60"),
            (20, 60, "to 60"),
            (20, 20, "after from"),
        ] {
            let error = InBetween::from_clip(&clip, from, to).unwrap_err().to_string();
            assert!(error.contains(wanted), "{from} {to}: {error}");
        }
    }

    #[test]
    fn a_clip_of_another_rate_is_refused() {
        let gap = InBetween::from_clip(
            &Clip {
                fps: 60.0,
                ..clip(60)
            },
            10,
            30,
        )
        .unwrap();
        let error = gap.to_message(&pack()).unwrap_err();
        assert_eq!(
            error,
            RequestError::FrameRate {
                clip: 60.0,
                pack: 30.0
            }
        );
    }

    #[test]
    fn a_height_goes_to_what_has_no_root() {
        let key = Key::default()
            .velocity(1.0, 2.0, 0.5)
            .root_height(0.9)
            .to_message();
        assert_eq!(key.velocity.unwrap().height, Some(0.9));
        assert!(key.pose.is_none() && key.root.is_none());
        let key = Key::default()
            .root_height(0.9)
            .pose(&[Quat::IDENTITY])
            .to_message();
        assert_eq!(key.pose.unwrap().root_height, Some(0.9));
    }

    #[test]
    fn the_length_replaces_the_clips_own() {
        let gap = InBetween::from_clip(&clip(60), 10, 30).unwrap();
        let message = |length| gap.clone().length(length).to_message(&pack()).unwrap();
        assert_eq!(message(SegmentLength::Frames(33)).frame_count, Some(33));
        assert_eq!(message(SegmentLength::Predicted).frame_count, None);
        let some = message(SegmentLength::PredictedFrom(vec![4, 5]));
        assert_eq!((some.frame_count, some.allowed_token_counts), (None, vec![4, 5]));
    }

    #[test]
    fn answers_of_the_wrong_length_are_refused() {
        let frames = v1::Frames {
            frame_count: 2,
            root_positions: vec![0.0, 0.9, 0.0, 0.0, 0.9, 0.1],
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(4),
            contacts: vec![1.0, 0.5],
            ..v1::Frames::default()
        };
        let read = |frames| {
            let result = v1::CharacterResult {
                id: "a".to_owned(),
                frames,
                intermediates: None,
                feasibility: None,
            };
            InBetweenAnswer::from_message(result, &pack())
        };
        let answer = read(Some(frames.clone())).unwrap();
        assert_eq!((answer.clip.frames(), answer.clip.root_positions[1].z), (2, 0.1));
        assert_eq!(answer.clip.rotations[3], Quat::IDENTITY);

        assert_eq!(read(None).unwrap_err(), AnswerError::Missing("frames"));
        let broken: [fn(&mut v1::Frames); 8] = [
            |f| f.frame_count = 3,
            |f| f.rotations.truncate(15),
            |f| f.contacts.push(0.0),
            |f| f.positions.push(0.0),
            |f| f.qpos.push(0.0),
            |f| f.clamped_hinges.push(0),
            |f| f.hinge_speed_ratios.push(0.5),
            |f| f.root_positions[0] = f32::NAN,
        ];
        for (nth, break_it) in broken.iter().enumerate() {
            let mut frames = frames.clone();
            break_it(&mut frames);
            assert!(read(Some(frames)).is_err(), "{nth}");
        }
    }
}
