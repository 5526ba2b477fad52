//! From a request to tasks for the model.

use troupe_character::keyframe::{Checked, Given, KeyWriter};
use troupe_character::{FieldError, Path, Size};
use troupe_motion::SegmentFrame;
use troupe_motion::model::{Dims, KeyframeTask, Rig};
use troupe_proto::v1;

use super::root::{Around, GivenRoot, check_root};
use super::{MAX_ID_BYTES, MAX_POSE_STEPS};
use troupe_live::wire::keyframe::{self, Role};
use troupe_live::wire::{MAX_TEMPERATURE, units};

/// Limits of a request that the server sets, in addition to those of the pack.
#[derive(Debug, Clone, Copy)]
pub struct RequestLimits {
    /// Most characters of a request.
    pub max_characters: usize,
}

/// Everything that turns a character's raw motion into its answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The character's id.
    pub id: String,
    /// Where the segment lies in the world.
    pub frame: SegmentFrame,
    /// Frames of the segment. None: the model chooses.
    pub frames: Option<usize>,
    /// Most frames that the model may choose.
    pub most_frames: usize,
    /// Whether an answer that is not feasible is an error.
    pub strict: bool,
    /// The size of the caller's body, for errors.
    pub size: Size,
    /// The context keyframes.
    pub context: Vec<Given>,
    /// The target keyframes. The last one is the segment's last frame.
    pub targets: Vec<Given>,
    /// Roots that replace the predicted ones, if the request gives any.
    pub root: Option<GivenRoot>,
    /// Whether standing feet are held still.
    pub hold_feet: bool,
    /// What to return besides frames.
    pub extras: ExtraOutputs,
}

/// Optional columns of an answer, besides roots, rotations and contacts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExtraOutputs {
    /// The output of each stage.
    pub intermediates: bool,
    /// World joint positions.
    pub positions: bool,
    /// World rotations in 6D form.
    pub six_d: bool,
    /// A robot's `qpos`.
    pub qpos: bool,
}

/// Checks a request for the pack of `rig`, and makes it the input of the stages. `root` is the
/// request, for errors.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare(
    root: &Path<'_>,
    request: &v1::InBetweenRequest,
    rig: &Rig,
    limits: RequestLimits,
) -> Result<(Vec<KeyframeTask>, Vec<Plan>), FieldError> {
    let count = request.characters.len();
    if count == 0 || count > limits.max_characters {
        let message = if count == 0 {
            "is empty".to_owned()
        } else {
            format!("has {count} characters")
        };
        return Err(root
            .field("characters")
            .error(message, format!("1 to {}", limits.max_characters)));
    }
    let mut writer = KeyWriter::new(&rig.skeleton, rig.fps);
    let mut items = Vec::with_capacity(count);
    let mut plans = Vec::with_capacity(count);
    for (index, character) in request.characters.iter().enumerate() {
        let (item, plan) =
            prepare_character(&root.element("characters", index), character, rig, &mut writer)?;
        items.push(item);
        plans.push(plan);
    }
    Ok((items, plans))
}

fn prepare_character(
    path: &Path<'_>,
    character: &v1::Character,
    rig: &Rig,
    writer: &mut KeyWriter<'_>,
) -> Result<(KeyframeTask, Plan), FieldError> {
    check_options(path, character, &rig.dims)?;
    check_qpos_wanted(path, character, rig)?;
    check_strict(path, character, rig)?;
    let frames = check_frame_count(path, character, &rig.dims)?;
    let allowed_counts = check_counts(path, character, &rig.dims, frames)?;
    let context = check_keyframes(path, "context", &character.context, Role::Context, rig)?;
    let targets = check_keyframes(path, "targets", &character.targets, Role::Target, rig)?;
    let Some(anchor) = context.last().and_then(|key| key.root) else {
        return Err(path
            .field("context")
            .error("has no root", "a root in every context keyframe"));
    };
    for (name, keys) in [("context", &context), ("targets", &targets)] {
        for (index, key) in keys.iter().enumerate() {
            keyframe::check_reach(&path.element(name, index), key, anchor.position)?;
        }
    }

    let frame = SegmentFrame::from_root(anchor);
    let around = Around {
        context: &context,
        targets: &targets,
        frames,
    };
    let root = check_root(path, &character.root, &around, &frame, rig)?;
    let most_tokens = rig.dims.min_tokens + allowed_counts.iter().rposition(|&may| may).unwrap_or_default();
    let item = KeyframeTask {
        context: writer.write(&frame, &context),
        targets: writer.write(&frame, &targets),
        frames,
        allowed_counts,
        seed: character.seed,
        temperature: character.temperature,
        pose_steps: character.pose_steps.unwrap_or(1),
        root_guide: None,
        root_override: root.as_ref().map(|given| given.over.clone()),
        gap_poses: Vec::new(),
    };
    let plan = Plan {
        id: character.id.clone(),
        frame,
        frames,
        most_frames: most_tokens * rig.dims.frames_per_token,
        strict: character.strict,
        size: path.size(),
        context: context.iter().map(|key| key.given(&frame)).collect(),
        targets: targets.iter().map(|key| key.given(&frame)).collect(),
        root,
        hold_feet: character.hold_feet.unwrap_or(true),
        extras: ExtraOutputs {
            intermediates: character.return_intermediates,
            positions: character.return_positions,
            six_d: character.return_six_d,
            qpos: character.return_qpos,
        },
    };
    Ok((item, plan))
}

/// Checks how many keyframes a character has.
pub(super) fn check_keyframe_counts(
    path: &Path<'_>,
    character: &v1::Character,
    dims: &Dims,
) -> Result<(), FieldError> {
    let keyframes = [
        (
            "context",
            character.context.len(),
            dims.context_frames,
            dims.context_frames,
        ),
        ("targets", character.targets.len(), 1, dims.max_targets),
    ];
    for (name, count, low, high) in keyframes {
        if !(low..=high).contains(&count) {
            let allowed = if low == high {
                format!("exactly {low}")
            } else {
                format!("{low} to {high}")
            };
            return Err(path.field(name).error(format!("has {count} keyframes"), allowed));
        }
    }
    Ok(())
}

fn check_options(path: &Path<'_>, character: &v1::Character, dims: &Dims) -> Result<(), FieldError> {
    if character.id.len() > MAX_ID_BYTES {
        let message = format!("has {} bytes", character.id.len());
        return Err(path
            .field("id")
            .error(message, format!("at most {MAX_ID_BYTES} bytes")));
    }
    check_keyframe_counts(path, character, dims)?;
    units::within(
        &path.field("temperature"),
        character.temperature,
        0.0,
        MAX_TEMPERATURE,
    )?;
    match character.pose_steps {
        Some(steps) if !(1..=MAX_POSE_STEPS).contains(&steps) => {
            let allowed = format!("1 to {MAX_POSE_STEPS}");
            Err(path.field("pose_steps").error(format!("is {steps}"), allowed))
        }
        _ => Ok(()),
    }
}

fn check_qpos_wanted(path: &Path<'_>, character: &v1::Character, rig: &Rig) -> Result<(), FieldError> {
    match character.return_qpos && rig.skeleton.robot.is_none() {
        true => Err(path.field("return_qpos").error(
            format!("is true, but pack {} has no robot", rig.name()),
            "false; true for packs with a robot",
        )),
        false => Ok(()),
    }
}

fn check_strict(path: &Path<'_>, character: &v1::Character, rig: &Rig) -> Result<(), FieldError> {
    match character.strict && rig.limits.is_none() {
        true => Err(path.field("strict").error(
            format!("is true, but pack {} has no limits", rig.name()),
            "false; true for packs with limits",
        )),
        false => Ok(()),
    }
}

fn check_frame_count(
    path: &Path<'_>,
    character: &v1::Character,
    dims: &Dims,
) -> Result<Option<usize>, FieldError> {
    let Some(frames) = character.frame_count else {
        return Ok(None);
    };
    let path = path.field("frame_count");
    let (low, high) = (dims.min_frames(), dims.max_frames());
    let frames = frames as usize;
    if !(low..=high).contains(&frames) {
        let message = format!(
            "is {frames}: frame_count counts the {} context frames, the gap and the targets",
            dims.context_frames
        );
        return Err(path.error(message, format!("{low} to {high}")));
    }
    let keyframes = dims.context_frames + character.targets.len();
    if frames < keyframes {
        let message = format!("is {frames}, too few for the context and target keyframes");
        return Err(path.error(message, format!("{keyframes} to {high}")));
    }
    Ok(Some(frames))
}

/// Checks the range of token counts for the root stage.
fn check_counts(
    path: &Path<'_>,
    character: &v1::Character,
    dims: &Dims,
    frames: Option<usize>,
) -> Result<Vec<bool>, FieldError> {
    let given = &character.allowed_token_counts;
    let list = path.field("allowed_token_counts");
    // The keyframes alone may need more than the fewest tokens.
    let keyframes = dims.context_frames + character.targets.len();
    let low = dims.min_tokens.max(dims.tokens_for(keyframes));
    let high = dims.max_tokens;
    let mut allowed = vec![false; dims.counts()];
    match frames {
        Some(_) if !given.is_empty() => {
            return Err(list.error("cannot be combined with frame_count", "only one of the two"));
        }
        Some(frames) => allowed[dims.tokens_for(frames) - dims.min_tokens] = true,
        None if given.is_empty() => allowed[low - dims.min_tokens..].fill(true),
        None => {
            for (index, &count) in given.iter().enumerate() {
                let tokens = count as usize;
                if !(low..=high).contains(&tokens) {
                    return Err(path
                        .element("allowed_token_counts", index)
                        .error(format!("is {count}"), format!("{low} to {high}")));
                }
                allowed[tokens - dims.min_tokens] = true;
            }
        }
    }
    Ok(allowed)
}

pub(super) fn check_keyframes(
    path: &Path<'_>,
    name: &'static str,
    keys: &[v1::Keyframe],
    role: Role,
    rig: &Rig,
) -> Result<Vec<Checked>, FieldError> {
    keys.iter()
        .enumerate()
        .map(|(index, key)| keyframe::check(&path.element(name, index), key, role, &rig.skeleton))
        .collect()
}

#[cfg(test)]
#[path = "prepare_tests.rs"]
pub(crate) mod tests;
