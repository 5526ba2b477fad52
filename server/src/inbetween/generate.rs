//! Requests to generate: from a message to a task, and from the parts of an answer to messages.

use std::sync::Arc;

use crate::wire::keyframe::Role;
use troupe_character::keyframe::KeyWriter;
use troupe_character::post::{
    NonFinite, check_finite, onto_hinges, parent_relative, roots, to_world_rotations,
};
use troupe_character::{FieldError, Path};
use troupe_motion::feasibility::Judge;
use troupe_motion::model::{DescribeTask, Motion, Output, PromptTask, Rig, SamplingTask, Task};
use troupe_motion::rotation::{align_sign, to_wxyz};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;

use super::feasible::message;
use super::prepare::{check_keyframes, check_temperature};

/// Most characters of a prompt.
pub const MAX_PROMPT_CHARS: usize = 1000;
/// Most frames that a prompt asks for, and that a motion to describe has.
pub const MAX_GENERATED_FRAMES: usize = 1024;

/// Checks a request and brings it into the form of a task. Gives the segment frame with it. More frames may go before than the pack's
/// context, up to `most_past`.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare_generate(
    request: &v1::GenerateRequest,
    rig: &Rig,
    most_past: usize,
) -> Result<(Task, SegmentFrame), FieldError> {
    let root = Path::root();
    check_temperature(&root, request.temperature)?;
    let mut writer = KeyWriter::new(&rig.skeleton, rig.fps);
    let (seed, temperature) = (request.seed, request.temperature);
    match &request.goal {
        None => Err(root.field("goal").error("is missing", "prompt, describe or path")),
        // Its motion is made window by window: see `PathPlan`.
        Some(Goal::Path(_)) => Err(root
            .field("path")
            .error("is no single task", "prompt or describe")),
        Some(Goal::Prompt(prompt)) => {
            let path = root.field("prompt");
            let text = check_text(&path, &prompt.text)?;
            let frames = check_frame_count(&path, prompt.frame_count)?;
            check_past(&root, request.past.len(), (rig.dims.context_frames, most_past))?;
            let past = check_keyframes(&root, "past", &request.past, Role::Context, rig)?;
            let origin = GlobalRoot::new(Vec3::ZERO, 0.0);
            let frame = SegmentFrame::from_root(past.last().and_then(|key| key.root).unwrap_or(origin));
            let task = PromptTask {
                text,
                context: writer.write(&frame, &past),
                frames,
                seed,
                sampling: SamplingTask::at(temperature),
                in_parts: true,
                ..PromptTask::default()
            };
            Ok((Task::Prompt(task), frame))
        }
        Some(Goal::Describe(describe)) => {
            let path = root.field("describe");
            let count = describe.frames.len();
            if !(2..=MAX_GENERATED_FRAMES).contains(&count) {
                let message = format!("has {count} keyframes");
                return Err(path
                    .field("frames")
                    .error(message, format!("2 to {MAX_GENERATED_FRAMES}")));
            }
            if !request.past.is_empty() {
                return Err(root.field("past").error("is given", "none beside describe"));
            }
            let keys = check_keyframes(&path, "frames", &describe.frames, Role::Context, rig)?;
            let origin = GlobalRoot::new(Vec3::ZERO, 0.0);
            let frame = SegmentFrame::from_root(keys.first().and_then(|key| key.root).unwrap_or(origin));
            let task = DescribeTask {
                frames: writer.write(&frame, &keys),
                seed,
                sampling: SamplingTask::at(temperature),
                ..DescribeTask::default()
            };
            Ok((Task::Describe(task), frame))
        }
    }
}

fn check_past(root: &Path<'_>, count: usize, (least, most): (usize, usize)) -> Result<(), FieldError> {
    if count == 0 || (least..=most).contains(&count) {
        return Ok(());
    }
    let allowed = match least < most {
        true => format!("none, or {least} to {most}"),
        false => format!("none, or exactly {least}"),
    };
    Err(root
        .field("past")
        .error(format!("has {count} keyframes"), allowed))
}

/// A path has no temperature: its motion follows from the seed.
///
/// # Errors
/// [`FieldError`] where one is given.
pub fn no_temperature(request: &v1::GenerateRequest) -> Result<(), FieldError> {
    match request.temperature {
        0.0 => Ok(()),
        found => {
            let path = Path::root();
            Err(path
                .field("temperature")
                .error(format!("is {found}"), "0 beside path"))
        }
    }
}

fn check_text(path: &Path<'_>, text: &str) -> Result<String, FieldError> {
    let path = path.field("text");
    let allowed = format!("1 to {MAX_PROMPT_CHARS} characters");
    if text.trim().is_empty() {
        return Err(path.error("is empty", allowed));
    }
    let count = text.chars().count();
    match count > MAX_PROMPT_CHARS {
        true => Err(path.error(format!("has {count} characters"), allowed)),
        false => Ok(text.to_owned()),
    }
}

fn check_frame_count(path: &Path<'_>, count: Option<u32>) -> Result<Option<usize>, FieldError> {
    let Some(count) = count else { return Ok(None) };
    match (1..=MAX_GENERATED_FRAMES).contains(&(count as usize)) {
        true => Ok(Some(count as usize)),
        false => Err(path
            .field("frame_count")
            .error(format!("is {count}"), format!("1 to {MAX_GENERATED_FRAMES}"))),
    }
}

/// Turns the parts of an answer into messages, one after another.
#[derive(Debug)]
pub struct PartWriter {
    rig: Arc<Rig>,
    frame: SegmentFrame,
    /// The pose before the next part.
    last: Vec<Quat>,
    /// Of frames along a path, who judges them where the body has limits.
    judge: Option<Judge>,
    /// Frames that were written.
    written: usize,
}

impl PartWriter {
    /// For an answer whose segment lies at `frame`.
    pub fn new(rig: Arc<Rig>, frame: SegmentFrame) -> Self {
        Self {
            rig,
            frame,
            last: Vec::new(),
            judge: None,
            written: 0,
        }
    }

    /// The same, with a judge of its frames.
    #[must_use]
    pub fn judged_by(self, judge: Option<Judge>) -> Self {
        Self { judge, ..self }
    }

    /// The message of the next part.
    ///
    /// # Errors
    /// [`NonFinite`] where the model gave numbers that are not finite.
    pub fn write(&mut self, output: Output, is_last: bool) -> Result<v1::GenerateResponse, NonFinite> {
        let part = match output {
            Output::Text(text) => Part::Text(text),
            Output::Motion(motion) => Part::Frames(self.frames(&motion)?),
            // A request has one character, and asks for no audio.
            Output::Motions(motions) => Part::Frames(match motions.first() {
                Some(motion) => self.frames(motion)?,
                None => v1::Frames::default(),
            }),
            Output::Audio(codes) => Part::Text(format!("{codes:?}")),
        };
        let found = self.judge.as_mut().map(Judge::part);
        Ok(v1::GenerateResponse {
            part: Some(part),
            is_last,
            notes: Vec::new(),
            feasibility: found.as_ref().map(message),
        })
    }

    /// The next part lies at `frame`.
    pub fn move_to(&mut self, frame: SegmentFrame) {
        self.frame = frame;
    }

    fn frames(&mut self, motion: &Motion) -> Result<v1::Frames, NonFinite> {
        check_finite(motion)?;
        let (rig, count) = (&self.rig, motion.frames());
        let joints = rig.dims.joints;
        let mut rotations = parent_relative(motion, count, &rig.dims, &rig.skeleton);
        to_world_rotations(&self.frame, joints, &mut rotations);
        // Each part keeps to the hemispheres of the one before, as frames inside a part do.
        for index in 0..rotations.len() {
            let before = match index.checked_sub(joints) {
                Some(before) => Some(rotations[before]),
                None => self.last.get(index).copied(),
            };
            if let Some(before) = before {
                rotations[index] = align_sign(rotations[index], before);
            }
        }
        let positions: Vec<Vec3> = roots(&motion.root)
            .map(|root| self.frame.to_world_position(root.position))
            .collect();
        let hinges = rig.skeleton.robot.as_ref();
        let hinges = hinges.map(|robot| onto_hinges(robot, &positions, &mut rotations, true));
        let hinges = hinges.unwrap_or_default();
        if let Some(judge) = &mut self.judge {
            for (root, pose) in positions.iter().zip(rotations.chunks_exact(joints)) {
                judge.push(self.written, Some(*root), Some((root.y, pose)));
                self.written += 1;
            }
        }
        self.last = rotations[rotations.len().saturating_sub(joints)..].to_vec();
        Ok(v1::Frames {
            frame_count: count as u32,
            root_positions: positions.iter().flat_map(Vec3::to_array).collect(),
            rotations: rotations.iter().copied().flat_map(to_wxyz).collect(),
            contacts: motion
                .contacts
                .iter()
                .map(|contact| contact.clamp(0.0, 1.0))
                .collect(),
            qpos: hinges.qpos,
            hinge_residuals: hinges.residuals,
            clamped_hinges: hinges.clamped,
            ..v1::Frames::default()
        })
    }
}
