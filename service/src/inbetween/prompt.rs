//! Requests to act out words: from a message to a task.

use troupe_character::keyframe::{Checked, KeyWriter};
use troupe_character::take::{Ending, top_speed_mps};
use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_motion::model::{AgentTask, Audio, PromptTask, Rig, Sound, Task};
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};
use troupe_proto::v1;

use super::prepare::check_keyframes;
use super::sampling::check_sampling;
use super::words::{check_prompt, most_past};
use troupe_live::wire::keyframe::{Role, check_reach};
use troupe_live::wire::units;

/// Most frames of a prompt's motion, and of a motion to describe.
pub const MAX_GENERATED_FRAMES: usize = 1024;

/// A request as a task that the pack accepts.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
    /// Fits the pack that the request was checked for.
    pub task: Task,
    /// Where the motion's segment lies in the world.
    pub frame: SegmentFrame,
    /// Where the motion ends, if the request says so.
    pub ending: Option<Ending>,
    /// Notes about what the model may not do well.
    pub notes: Vec<String>,
}

/// Checks the words to act out, the goal of `request`, and makes them a task for `pack`. `root` is
/// the request, for errors.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare_prompt(
    root: &Path<'_>,
    request: &v1::GenerateRequest,
    prompt: &v1::Prompt,
    pack: &Pack,
) -> Result<Prepared, FieldError> {
    let path = root.field("prompt");
    let sampling = check_sampling(root, request.sampling.as_ref())?;
    check_pack(&path, prompt, pack)?;
    let texts = Texts::check(&path, request, prompt)?;
    let frames = check_length(&path, prompt, &pack.rig)?;
    let audio = prompt.audio.as_ref();
    let audio = audio
        .map(|audio| check_audio(&path.field("audio"), audio))
        .transpose()?;
    let keys = Keys::check(root, request, prompt, pack)?;

    let frame = segment(keys.past.last());
    let ending = keys.ending(&path, prompt, frames, &pack.rig)?;
    let mut writer = KeyWriter::new(&pack.rig.skeleton, pack.rig.fps);
    let others = texts.others.into_iter().zip(&keys.others);
    let task = Task::Prompt(PromptTask {
        text: texts.first,
        context: writer.write(&frame, &keys.past),
        targets: match leads_to_place(prompt) {
            true => Vec::new(),
            false => writer.write(&frame, &keys.targets),
        },
        audio,
        others: others
            .map(|(text, past)| AgentTask {
                text,
                context: writer.write(&frame, past),
            })
            .collect(),
        frames,
        seed: request.seed,
        sampling,
        in_parts: true,
        flow_steps: prompt.flow_steps.unwrap_or(0),
    });
    let notes = check_prompt(pack, prompt, &task)?;
    Ok(Prepared {
        task,
        frame,
        ending,
        notes,
    })
}

/// Whether the target of a prompt is a place: one root, without a pose. Other targets are frames
/// behind a gap.
pub fn leads_to_place(prompt: &v1::Prompt) -> bool {
    match prompt.targets.as_slice() {
        [target] => target.root.is_some() && target.pose.is_none() && target.qpos.is_empty(),
        _ => false,
    }
}

/// The parts that each of a prompt's targets must have.
pub(crate) fn target_role(prompt: &v1::Prompt) -> Role {
    match leads_to_place(prompt) {
        true => Role::Target,
        false => Role::Context,
    }
}

/// The segment that starts at this keyframe. Without a keyframe: at the origin.
pub(super) fn segment(from: Option<&Checked>) -> SegmentFrame {
    let origin = GlobalRoot::new(Vec3::ZERO, 0.0);
    SegmentFrame::from_root(from.and_then(|key| key.root).unwrap_or(origin))
}

/// Checks what the pack can take. Packs without a language model take only words, packs without
/// audio no audio.
fn check_pack(path: &Path<'_>, prompt: &v1::Prompt, pack: &Pack) -> Result<(), FieldError> {
    let language = pack.language();
    let has_model = language.is_some();
    let has_audio = language.is_some_and(|language| language.audio_codes() > 0);
    let given = [
        ("targets", !prompt.targets.is_empty() && !has_model),
        ("others", !prompt.others.is_empty() && !has_model),
        (
            "flow_steps",
            prompt.flow_steps.is_some_and(|steps| steps > 0) && !has_model,
        ),
        ("audio", prompt.audio.is_some() && !has_audio),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((field, _)) => {
            let lacks = if has_model { "audio" } else { "language model" };
            let allowed = format!("none: the pack {} has no {lacks}", pack.name());
            Err(path.field(field).error("is given", allowed))
        }
    }
}

/// What the characters shall do, in words.
struct Texts {
    first: String,
    others: Vec<String>,
}

impl Texts {
    /// Checks the texts. Either all characters have one, or none has and the request gives other
    /// input.
    fn check(
        path: &Path<'_>,
        request: &v1::GenerateRequest,
        prompt: &v1::Prompt,
    ) -> Result<Self, FieldError> {
        let is_blank = |text: &str| text.trim().is_empty();
        let goes_without = !request.past.is_empty() || !prompt.targets.is_empty() || prompt.audio.is_some();
        let wordless = is_blank(&prompt.text) && prompt.others.iter().all(|other| is_blank(&other.text));
        if goes_without && wordless {
            return Ok(Self {
                first: String::new(),
                others: vec![String::new(); prompt.others.len()],
            });
        }
        let others = prompt.others.iter().enumerate();
        Ok(Self {
            first: check_text(path, &prompt.text)?,
            others: others
                .map(|(index, other)| check_text(&path.element("others", index), &other.text))
                .collect::<Result<_, _>>()?,
        })
    }
}

fn check_text(path: &Path<'_>, text: &str) -> Result<String, FieldError> {
    units::sentence(&path.field("text"), text)?;
    Ok(text.to_owned())
}

fn leads_to_frames(prompt: &v1::Prompt) -> bool {
    !prompt.targets.is_empty() && !leads_to_place(prompt)
}

/// The wanted number of frames, from a count or from seconds.
fn check_length(path: &Path<'_>, prompt: &v1::Prompt, rig: &Rig) -> Result<Option<usize>, FieldError> {
    match (prompt.frame_count, prompt.seconds) {
        (Some(_), Some(_)) => Err(path
            .field("seconds")
            .error("is given beside frame_count", "one of the two")),
        (Some(count), None) if (1..=MAX_GENERATED_FRAMES).contains(&(count as usize)) => {
            Ok(Some(count as usize))
        }
        (Some(count), None) => {
            let allowed = format!("1 to {MAX_GENERATED_FRAMES}");
            Err(path.field("frame_count").error(format!("is {count}"), allowed))
        }
        (None, Some(seconds)) => {
            let longest_s = MAX_GENERATED_FRAMES as f32 / rig.fps;
            // NaN is outside too.
            if !(seconds > 0.0 && seconds <= longest_s) {
                let allowed = format!("more than 0, and at most {longest_s:.1}");
                return Err(path.field("seconds").error(format!("is {seconds}"), allowed));
            }
            let unit = match leads_to_frames(prompt) {
                true => rig.dims.frames_per_token,
                false => 1,
            };
            let units = (seconds * rig.fps / unit as f32).round() as usize;
            Ok(Some(units.max(1) * unit))
        }
        (None, None) if leads_to_frames(prompt) => Err(path
            .field("frame_count")
            .error("is missing", "frame_count or seconds beside targets")),
        (None, None) => Ok(None),
    }
}

fn check_audio(path: &Path<'_>, audio: &v1::Audio) -> Result<Audio, FieldError> {
    let sound = match v1::Sound::try_from(audio.sound) {
        Ok(v1::Sound::Music) => Sound::Music,
        Ok(v1::Sound::Speech) => Sound::Speech,
        Err(_) => {
            let found = format!("is {}", audio.sound);
            return Err(path
                .field("sound")
                .error(found, "SOUND_MUSIC (0) or SOUND_SPEECH (1)"));
        }
    };
    match audio.codes.is_empty() {
        true => Err(path.field("codes").error("is empty", "one code or more")),
        false => Ok(Audio {
            sound,
            codes: audio.codes.clone(),
        }),
    }
}

/// The checked keyframes of a request.
struct Keys {
    past: Vec<Checked>,
    targets: Vec<Checked>,
    /// The past of each other character.
    others: Vec<Vec<Checked>>,
}

impl Keys {
    fn check(
        root: &Path<'_>,
        request: &v1::GenerateRequest,
        prompt: &v1::Prompt,
        pack: &Pack,
    ) -> Result<Self, FieldError> {
        let path = root.field("prompt");
        let counts = (pack.rig.dims.context_frames, most_past(pack));
        check_past(root, request.past.len(), counts)?;
        let rig = &pack.rig;
        let past = check_keyframes(root, "past", &request.past, Role::Context, rig)?;
        let anchor = past.last();
        let targets = check_keyframes(&path, "targets", &prompt.targets, target_role(prompt), rig)?;
        check_near(root, "past", &past, anchor)?;
        check_near(&path, "targets", &targets, anchor)?;
        let mut others = Vec::with_capacity(prompt.others.len());
        for (index, other) in prompt.others.iter().enumerate() {
            let path = path.element("others", index);
            same_count(&path.field("past"), other.past.len(), ("past", past.len()))?;
            let keys = check_keyframes(&path, "past", &other.past, Role::Context, rig)?;
            check_near(&path, "past", &keys, anchor)?;
            others.push(keys);
        }
        Ok(Self {
            past,
            targets,
            others,
        })
    }

    /// Where a motion of `frames` frames ends, if the request says so.
    fn ending(
        &self,
        path: &Path<'_>,
        prompt: &v1::Prompt,
        frames: Option<usize>,
        rig: &Rig,
    ) -> Result<Option<Ending>, FieldError> {
        let frame = segment(self.past.last());
        if !leads_to_place(prompt) {
            let is_gap = !self.targets.is_empty();
            return Ok(is_gap.then(|| Ending::between(frame, &self.past, &self.targets)));
        }
        let path = path.element("targets", 0);
        if !prompt.others.is_empty() {
            return Err(path.error("is given", "none beside other characters"));
        }
        if prompt.targets[0].velocity.is_some() {
            return Err(path
                .field("velocity")
                .error("is given", "a root alone, or root and pose"));
        }
        let Some(place) = self.targets.first().and_then(|key| key.root) else {
            return Ok(None);
        };
        if let Some(frames) = frames {
            let past = self.past.last().and_then(|key| key.root);
            check_speed(&path, place, (past, frames), rig)?;
        }
        Ok(Some(Ending::at(place, frame, &self.past)))
    }
}

/// Checks that a body gets to a place in `frames` frames, after `past` or from the origin.
fn check_speed(
    path: &Path<'_>,
    place: GlobalRoot,
    (past, frames): (Option<GlobalRoot>, usize),
    rig: &Rig,
) -> Result<(), FieldError> {
    let Some(top_mps) = top_speed_mps(rig) else {
        return Ok(());
    };
    // Without a past, the first frame is at the origin itself.
    let steps = frames - usize::from(past.is_none());
    let from = past.map_or(Vec3::ZERO, |root| root.position);
    let way_m = (place.position - from).with_y(0.0).length();
    let most_m = top_mps * steps as f32 / rig.fps;
    if way_m <= most_m {
        return Ok(());
    }
    let enough = (way_m / top_mps * rig.fps).ceil() as usize + 1;
    let path = path.field("root");
    Err(path.field("position").error(
        format!("is {:.2} m away", path.metres(way_m)),
        format!(
            "at most {:.2} m in {frames} frames; or frame_count {enough} or more",
            path.metres(most_m)
        ),
    ))
}

/// Checks that the keyframes `name` of the message at `path` are within reach of `anchor`. Without
/// an anchor: of the origin.
pub(super) fn check_near(
    path: &Path<'_>,
    name: &'static str,
    keys: &[Checked],
    anchor: Option<&Checked>,
) -> Result<(), FieldError> {
    let anchor = anchor.and_then(|key| key.root);
    let anchor = anchor.map_or(Vec3::ZERO, |root| root.position);
    for (index, key) in keys.iter().enumerate() {
        check_reach(&path.element(name, index), key, anchor)?;
    }
    Ok(())
}

/// Checks how many frames there are before the words.
pub(super) fn check_past(
    root: &Path<'_>,
    count: usize,
    (least, most): (usize, usize),
) -> Result<(), FieldError> {
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

/// Checks that another character has as many keyframes as the first, whose field is `first`.
pub(super) fn same_count(
    path: &Path<'_>,
    count: usize,
    (first, wanted): (&str, usize),
) -> Result<(), FieldError> {
    match count == wanted {
        true => Ok(()),
        false => Err(path.error(
            format!("has {count} keyframes"),
            format!("as many as {first}: {wanted}"),
        )),
    }
}
