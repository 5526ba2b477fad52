//! Checks requests.

use std::sync::Arc;

use serde_json::Value;
use troupe_character::take::{Clock, Look, Note, Prompt, Take, TakeSegment};

use super::asked::Asked;
use super::carried::{Asking, Carried, carried};
use super::constraints::{self, Scope};
use super::fault::{Code, Fault};
use super::limits::{FPS, MAX_SECONDS, MAX_SEGMENTS};
use super::model::Model;
use super::onto::onto;
use super::options::{Planner, TEMPERATURE, check_options, look, seed};
use super::schema::{ENGLISH, MotionReference, Request, Text, Unconditioned, check_version, read, take_type};
use super::skeleton::Joints;
use super::{reference, skeleton};
use troupe_base::echo::cut;
use troupe_live::session::Space;
use troupe_live::skeleton::Worn;
use troupe_live::wire::MAX_PROMPT_CHARS;
use troupe_service::inbetween::check_words;

/// Types of segments in the protocol.
const SEGMENTS: [&str; 5] = [
    "text",
    "unconditioned",
    "pose",
    "motion_reference",
    "video_reference",
];
/// Default number of frames for the transition into a segment of words.
const TRANSITION_FRAMES: i64 = 5;

/// One decoded segment.
enum Segment {
    Text(Text),
    Unconditioned(Unconditioned),
    Motion(MotionReference),
}

/// Checks a request for one of `models`, which are those of `space`. A skeleton of the caller's own
/// takes milliseconds.
///
/// # Errors
/// [`Fault`] for the first value that is not accepted.
pub fn check(value: Value, models: &[Model], space: &Space) -> Result<Asked, Fault> {
    if let Some(version) = value.get("protocol_version").and_then(Value::as_str)
        && super::schema::major(version).is_some()
    {
        check_version(version)?;
    }
    if let Some(model) = named(&value, models) {
        check_types(&value, model)?;
    }
    let mut request: Request = read(value, "")?;
    check_version(&request.protocol_version)?;
    let segments = read_segments(std::mem::take(&mut request.segments))?;
    let constraints = constraints::read_all(std::mem::take(&mut request.constraints))?;
    let model = models.iter().find(|model| model.id == request.model);
    let model = model.ok_or_else(|| unknown(&request.model, models))?;
    let mut joints = skeleton::check(&request.skeleton, model, space)?;
    let lengths = lengths(&segments, request.duration_frames, constraints.is_empty())?;
    let clock = clock(&request, model, &lengths)?;
    let options = request.options.unwrap_or_default();
    check_options(&options, model, segments.len())?;
    let scope = Scope {
        model,
        joints: &joints,
        clock,
    };
    let wanted = constraints::check(&constraints, &scope)?;
    let mut notes = Vec::new();
    if clock.resamples() {
        notes.push(Note::info(
            "resampled",
            format!(
                "made at {} frames a second and resampled to {}: constraints are met at the nearest frame of the model",
                clock.native_fps, clock.fps
            ),
        ));
    }
    let mut look = look(&options, model, &mut notes)?;
    let planner = Planner::of(&options)?;
    let path = Asking {
        model,
        joints: &joints,
        wanted: &wanted,
        word: look.word.as_deref(),
    };
    let carried = carried(planner, &path, space, &mut notes)?;
    let native = |frame: usize| clock.native(frame).round() as usize;
    let of = (model, &joints, space);
    let parts = parts(&segments, &lengths, (&clock, of), &mut notes)?;
    let (by, worn) = planned_by(carried, model, &mut joints, &mut look);
    let (wanted, onto) = match worn {
        None => (wanted, None),
        Some(worn) => {
            let (guide, onto) = onto(&worn, wanted, &joints.still);
            (guide, Some(onto))
        }
    };
    let take = Take {
        subject: by.subject(),
        segments: parts,
        wanted,
        seed: seed(options.seed, &mut notes),
        frames: clock.native_frames(),
        clock,
        hold_feet: options.post_processing.unwrap_or(true),
        transition: native(options.transition_frames.unwrap_or(TRANSITION_FRAMES) as usize),
        is_loop: options.is_loop.unwrap_or(false),
        look,
        past: None,
        in_parts: false,
        onto,
    };
    Ok(Asked {
        model: model.clone(),
        by: by.loaded,
        joints: Arc::new(joints),
        take: Arc::new(take),
        samples: options.num_samples.unwrap_or(1) as usize,
        notes,
    })
}

/// The model that makes the motion, and the way from its body to that of the answer.
fn planned_by(
    carried: Option<Carried>,
    model: &Model,
    joints: &mut Joints,
    look: &mut Look,
) -> (Model, Option<Arc<Worn>>) {
    let Some(Carried { by, style, worn }) = carried else {
        return (model.clone(), joints.worn.clone());
    };
    *look = Look {
        style: Some(style),
        temperature: TEMPERATURE,
        ..Look::default()
    };
    if let Some(worn) = &worn {
        joints.contacts = skeleton::contacts(worn);
    }
    (by, worn)
}

/// The model that a request names. None: no model has this id.
fn named<'a>(value: &Value, models: &'a [Model]) -> Option<&'a Model> {
    let name = value.get("model")?.as_str()?;
    models.iter().find(|model| model.id == name)
}

fn unknown(name: &str, models: &[Model]) -> Fault {
    let ids: Vec<&str> = models.iter().map(|model| model.id.as_str()).collect();
    let fault = Fault::new(
        Code::UnknownModel,
        "model",
        format!("is {:?}", cut(name, 64)),
        ids.join(", "),
    );
    fault.with("available_models", ids)
}

/// Rejects segment types of the protocol that the model does not take, before the segments are
/// decoded.
fn check_types(value: &Value, model: &Model) -> Result<(), Fault> {
    let segments = value.get("segments").and_then(Value::as_array);
    let supported = model.segments();
    for (index, segment) in segments.into_iter().flatten().enumerate() {
        let Some(kind) = segment.get("type").and_then(Value::as_str) else {
            continue;
        };
        if SEGMENTS.contains(&kind) && !supported.contains(&kind) {
            let field = format!("segments[{index}].type");
            let fault = Fault::new(
                Code::UnsupportedSegment,
                field,
                format!("is {kind:?}"),
                supported.join(", "),
            );
            return Err(fault.with("supported_segments", supported));
        }
    }
    Ok(())
}

fn read_segments(values: Vec<Value>) -> Result<Vec<Segment>, Fault> {
    if values.len() > MAX_SEGMENTS {
        let found = format!("has {} entries", values.len());
        return Err(Fault::option(
            "segments",
            found,
            format!("at most {MAX_SEGMENTS}"),
        ));
    }
    let each = values.into_iter().enumerate();
    each.map(|(index, mut value)| {
        let place = format!("segments[{index}]");
        let kind = take_type(&mut value, &place)?;
        let segment = match kind.as_str() {
            "text" => Segment::Text(read(value, &place)?),
            "unconditioned" => Segment::Unconditioned(read(value, &place)?),
            "motion_reference" => Segment::Motion(read(value, &place)?),
            other => {
                let found = format!("is {:?}", cut(other, 64));
                let allowed = SEGMENTS.join(", ");
                return Err(Fault::schema(format!("{place}.type"), found, allowed));
            }
        };
        Ok(segment)
    })
    .collect()
}

impl Segment {
    fn duration(&self) -> i64 {
        match self {
            Self::Text(text) => text.duration_frames,
            Self::Unconditioned(free) => free.duration_frames,
            Self::Motion(like) => like.duration_frames,
        }
    }

    fn seed(&self) -> Option<u64> {
        let seed = match self {
            Self::Text(text) => text.seed,
            Self::Unconditioned(free) => free.seed,
            Self::Motion(like) => like.seed,
        };
        seed.map(|seed| seed as u64)
    }
}

/// Frames of each part of the motion.
fn lengths(segments: &[Segment], duration: Option<i64>, is_unconstrained: bool) -> Result<Vec<usize>, Fault> {
    let positive = |field: String, frames: i64| match usize::try_from(frames) {
        Ok(frames) if frames > 0 => Ok(frames),
        _ => Err(Fault::schema(field, format!("is {frames}"), "1 or more")),
    };
    if let Some(frames) = duration {
        let frames = positive("duration_frames".to_owned(), frames)?;
        return match segments.is_empty() {
            true if is_unconstrained => Err(nothing()),
            true => Ok(vec![frames]),
            false => Err(Fault::schema(
                "duration_frames",
                "is given beside segments",
                "only one of the two",
            )),
        };
    }
    if segments.is_empty() {
        return Err(match is_unconstrained {
            true => nothing(),
            false => Fault::schema("duration_frames", "is missing", "1 or more without segments"),
        });
    }
    let each = segments.iter().enumerate();
    each.map(|(index, segment)| positive(format!("segments[{index}].duration_frames"), segment.duration()))
        .collect()
}

fn nothing() -> Fault {
    Fault::schema("segments", "is empty, and so are constraints", "one of the two")
}

fn clock(request: &Request, model: &Model, lengths: &[usize]) -> Result<Clock, Fault> {
    let native_fps = model.rig().fps;
    let fps = match &request.timing {
        None => f64::from(native_fps),
        Some(timing) if (FPS[0]..=FPS[1]).contains(&timing.fps) => timing.fps,
        Some(timing) => {
            let allowed = format!("{} to {}", FPS[0], FPS[1]);
            return Err(Fault::schema("timing.fps", format!("is {}", timing.fps), allowed));
        }
    };
    // Whole numbers in a range that cannot overflow: each is compared with the longest motion.
    let most = (f64::from(MAX_SECONDS) * fps).floor() as usize;
    let frames = lengths.iter().try_fold(0_usize, |sum, &frames| {
        sum.checked_add(frames).filter(|sum| *sum <= most)
    });
    let Some(frames) = frames else {
        let field = match request.duration_frames {
            Some(_) => "duration_frames",
            None => "segments",
        };
        let allowed = format!("at most {most} frames, {MAX_SECONDS} s");
        return Err(
            Fault::option(field, "is too long", allowed).with("max_duration_seconds", f64::from(MAX_SECONDS))
        );
    };
    Ok(Clock {
        native_fps,
        fps: fps as f32,
        frames,
    })
}

fn parts(
    segments: &[Segment],
    lengths: &[usize],
    (clock, of): (&Clock, (&Model, &Joints, &Space)),
    notes: &mut Vec<Note>,
) -> Result<Vec<TakeSegment>, Fault> {
    let whole = clock.native_frames();
    let mut parts = Vec::with_capacity(lengths.len());
    let mut end = 0;
    for (index, &frames) in lengths.iter().enumerate() {
        end += frames;
        let prompt = match segments.get(index) {
            Some(Segment::Text(text)) => Prompt::Words(words(index, text, of.0, notes)?),
            Some(Segment::Motion(like)) => {
                let place = format!("segments[{index}]");
                Prompt::Like(reference::check(&place, like, of)?)
            }
            Some(Segment::Unconditioned(_)) | None => Prompt::Free,
        };
        parts.push(TakeSegment {
            end: match index + 1 == lengths.len() {
                true => whole,
                false => (clock.native(end).round() as usize).min(whole),
            },
            seed: segments.get(index).and_then(Segment::seed),
            prompt,
        });
    }
    Ok(parts)
}

fn words(index: usize, text: &Text, model: &Model, notes: &mut Vec<Note>) -> Result<String, Fault> {
    let field = format!("segments[{index}].prompt");
    let count = text.prompt.chars().count();
    if text.prompt.trim().is_empty() {
        let allowed = format!("1 to {MAX_PROMPT_CHARS} characters");
        return Err(Fault::schema(field, "is empty", allowed));
    }
    if count > MAX_PROMPT_CHARS {
        let allowed = format!("at most {MAX_PROMPT_CHARS}");
        return Err(Fault::option(field, format!("has {count} characters"), allowed));
    }
    if let Some(other) = text.language.as_deref().filter(|other| *other != ENGLISH) {
        let field = format!("segments[{index}].language");
        return Err(Fault::option(field, format!("is {:?}", cut(other, 32)), ENGLISH));
    }
    let unknown = check_words(&model.loaded.pack, &text.prompt)
        .map_err(|error| Fault::option(field, error.message, error.allowed))?;
    notes.extend(
        unknown
            .into_iter()
            .map(|message| Note::warning("unknown_words", message)),
    );
    Ok(text.prompt.clone())
}
