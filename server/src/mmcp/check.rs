//! Checks requests.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;
use troupe_character::take::{Clock, Look, Note, Prompt, Take, TakeSegment};

use super::asked::Asked;
use super::constraints::{self, Scope};
use super::fault::{Code, Fault};
use super::limits::{
    FPS, GUIDANCE, MAX_SAMPLES, MAX_SECONDS, MAX_SEGMENTS, MAX_TRANSITION_FRAMES, STEPS, TEMPERATURES,
};
use super::model::Model;
use super::onto::onto;
use super::schema::{
    ENGLISH, Guidance, MotionReference, Options, Request, Text, Unconditioned, check_version, read, take_type,
};
use super::skeleton::Joints;
use super::{reference, skeleton};
use troupe_base::echo::cut;
use troupe_live::session::Space;
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
/// Temperature of a request that sets none.
const TEMPERATURE: f32 = 1.0;
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
    let joints = skeleton::check(&request.skeleton, model, space)?;
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
    let look = look(&options, model, &mut notes)?;
    let native = |frame: usize| clock.native(frame).round() as usize;
    let of = (model, &joints, space);
    let parts = parts(&segments, &lengths, (&clock, of), &mut notes)?;
    let (wanted, onto) = match &joints.worn {
        None => (wanted, None),
        Some(worn) => {
            let (guide, onto) = onto(worn, wanted, &joints.still);
            (guide, Some(onto))
        }
    };
    let take = Take {
        subject: model.subject(),
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
        joints: Arc::new(joints),
        take: Arc::new(take),
        samples: options.num_samples.unwrap_or(1) as usize,
        notes,
    })
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

fn check_options(options: &Options, model: &Model, segments: usize) -> Result<(), Fault> {
    let within = |name: &str, value: Option<i64>, low: i64, high: i64| match value {
        Some(value) if !(low..=high).contains(&value) => Err(Fault::schema(
            format!("options.{name}"),
            format!("is {value}"),
            format!("{low} to {high}"),
        )),
        _ => Ok(()),
    };
    within("diffusion_steps", options.diffusion_steps, STEPS[0], STEPS[1])?;
    within("num_samples", options.num_samples, 1, MAX_SAMPLES as i64)?;
    within(
        "transition_frames",
        options.transition_frames,
        0,
        MAX_TRANSITION_FRAMES,
    )?;
    if options.keyframe_budget.is_some() {
        let allowed = "none: every frame is keyed (supports_keyframe_reduction is false)";
        return Err(Fault::option("options.keyframe_budget", "is given", allowed));
    }
    if options.is_loop == Some(true) {
        if !(model.walks() || model.follows()) {
            let allowed = "false: supports_loop is false";
            return Err(Fault::option("options.loop", "is true", allowed));
        }
        if segments != 1 {
            let found = format!("is true, and there are {segments} segments");
            return Err(Fault::option("options.loop", found, "exactly one segment"));
        }
    }
    match &options.guidance {
        Some(guidance) => check_guidance(guidance, model),
        None => Ok(()),
    }
}

fn check_guidance(guidance: &Guidance, model: &Model) -> Result<(), Fault> {
    let weights = match guidance.kind.as_str() {
        "nocfg" => 0,
        "regular" => 1,
        "separated" => 2,
        other => {
            let found = format!("is {:?}", cut(other, 32));
            return Err(Fault::schema(
                "options.guidance.type",
                found,
                "nocfg, regular, separated",
            ));
        }
    };
    if guidance.weight.len() != weights {
        let found = format!("has {} entries", guidance.weight.len());
        return Err(Fault::schema(
            "options.guidance.weight",
            found,
            format!("exactly {weights}"),
        ));
    }
    if !takes(guidance, model) {
        return Ok(());
    }
    let [low, high] = GUIDANCE;
    match guidance
        .weight
        .iter()
        .find(|weight| !(low..=high).contains(*weight))
    {
        Some(weight) => Err(Fault::option(
            "options.guidance.weight",
            format!("has {weight}"),
            format!("{low} to {high}"),
        )),
        None => Ok(()),
    }
}

/// Whether the model takes this type of guidance. Other types are left out with a note, because the
/// protocol's own Blender client sends text guidance to every model.
fn takes(guidance: &Guidance, model: &Model) -> bool {
    model.guidance().contains(&guidance.kind.as_str())
}

/// How to move: the style and the sampler's options.
fn look(options: &Options, model: &Model, notes: &mut Vec<Note>) -> Result<Look, Fault> {
    let mut look = Look {
        temperature: TEMPERATURE,
        ..Look::default()
    };
    let empty = BTreeMap::new();
    let own = options.model_options.as_ref().unwrap_or(&empty);
    let names = model.style_names();
    let mut known = Vec::new();
    known.extend((!names.is_empty()).then_some("style"));
    known.extend((model.walks() || model.speaks()).then_some("temperature"));
    if let Some(name) = own.keys().find(|name| !known.contains(&name.as_str())) {
        let allowed = match known.is_empty() {
            true => "none: the model has no options".to_owned(),
            false => known.join(", "),
        };
        let field = format!("options.model_options.{}", cut(name, 64));
        return Err(Fault::option(field, "is not an option of the model", allowed).with("options", known));
    }
    if let Some(value) = own.get("temperature") {
        look.temperature = temperature(value)?;
    }
    look.guidance = guidance(options, model, notes);
    let style = own
        .get("style")
        .map(|value| style_name(value, &names))
        .transpose()?;
    if model.follows() {
        look.word = style;
        steps(options, model, &mut look, notes);
    } else {
        look.style = match style {
            Some(name) => model.styles().get(&name),
            None => model.styles().default_style(),
        };
    }
    Ok(look)
}

fn style_name(value: &Value, names: &[String]) -> Result<String, Fault> {
    let found = value
        .as_str()
        .filter(|name| names.iter().any(|other| other == name));
    found.map(str::to_owned).ok_or_else(|| {
        let field = "options.model_options.style";
        Fault::option(
            field,
            format!("is {}", cut(&value.to_string(), 64)),
            names.join(", "),
        )
    })
}

fn temperature(value: &Value) -> Result<f32, Fault> {
    let [low, high] = TEMPERATURES;
    let number = value.as_f64().map(|number| number as f32);
    number
        .filter(|number| (low..=high).contains(number))
        .ok_or_else(|| {
            let field = "options.model_options.temperature";
            Fault::option(
                field,
                format!("is {}", cut(&value.to_string(), 64)),
                format!("{low} to {high}"),
            )
        })
}

/// Sets the steps of the sampler.
fn steps(options: &Options, model: &Model, look: &mut Look, notes: &mut Vec<Note>) {
    let most = model
        .loaded
        .pack
        .sampler()
        .map_or(1, |steps| i64::from(steps.max));
    look.steps = options.diffusion_steps.map(|steps| {
        if steps > most {
            let message = format!("the model has {most} diffusion steps: {steps} were asked for");
            notes.push(Note::info("diffusion_steps", message));
        }
        steps.min(most) as u32
    });
}

/// Weight of the style.
fn guidance(options: &Options, model: &Model, notes: &mut Vec<Note>) -> Option<f32> {
    let guidance = options.guidance.as_ref()?;
    if takes(guidance, model) {
        return guidance.weight.first().map(|weight| *weight as f32);
    }
    let supported = model.guidance().join(", ");
    let message = format!("{:?} is left out: the model takes {supported}", guidance.kind);
    notes.push(Note::info("guidance", message));
    None
}

/// The seed of a request. If it gives none, a seed is drawn and reported in a note.
fn seed(given: Option<i64>, notes: &mut Vec<Note>) -> u64 {
    match given {
        Some(seed) => seed as u64,
        None => {
            // 32 bits fit into the numbers of every language.
            let drawn = rand::random::<u32>();
            notes.push(Note::info("seed", format!("the seed is {drawn}")));
            u64::from(drawn)
        }
    }
}
