//! Requests to describe a motion: from a message to a task.

use troupe_character::keyframe::KeyWriter;
use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_motion::model::{DescribeTask, Sound, Task, Telling};
use troupe_proto::v1;

use super::MAX_GENERATED_FRAMES;
use super::prepare::check_keyframes;
use super::prompt::{check_near, same_count, segment};
use super::sampling::check_sampling;
use super::words::check_description;
use troupe_live::wire::keyframe::Role;

/// Checks a request, and makes it a task for `pack`. Also returns what the motion is described in.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare_describe(request: &v1::DescribeRequest, pack: &Pack) -> Result<(Task, Telling), FieldError> {
    let root = Path::root();
    let sampling = check_sampling(&root, request.sampling.as_ref())?;
    let into = check_telling(&root, request, pack)?;
    let count = request.frames.len();
    if !(2..=MAX_GENERATED_FRAMES).contains(&count) {
        let message = format!("has {count} keyframes");
        let allowed = format!("2 to {MAX_GENERATED_FRAMES}");
        return Err(root.field("frames").error(message, allowed));
    }
    let frames = check_keyframes(&root, "frames", &request.frames, Role::Context, &pack.rig)?;
    check_near(&root, "frames", &frames, frames.first())?;
    let mut others = Vec::with_capacity(request.others.len());
    for (index, other) in request.others.iter().enumerate() {
        let path = root.element("others", index);
        same_count(&path.field("frames"), other.frames.len(), ("frames", count))?;
        let keys = check_keyframes(&path, "frames", &other.frames, Role::Context, &pack.rig)?;
        check_near(&path, "frames", &keys, frames.first())?;
        others.push(keys);
    }

    let segment = segment(frames.first());
    let mut writer = KeyWriter::new(&pack.rig.skeleton, pack.rig.fps);
    let task = Task::Describe(DescribeTask {
        frames: writer.write(&segment, &frames),
        others: others.iter().map(|keys| writer.write(&segment, keys)).collect(),
        into,
        seed: request.seed,
        sampling,
    });
    check_description(pack, &task)?;
    Ok((task, into))
}

/// Checks what the motion is described in. Packs without a language model offer only words for one
/// character.
fn check_telling(root: &Path<'_>, request: &v1::DescribeRequest, pack: &Pack) -> Result<Telling, FieldError> {
    let into = match v1::Telling::try_from(request.into) {
        Ok(v1::Telling::Words) => Telling::Words,
        Ok(v1::Telling::Music) => Telling::Audio(Sound::Music),
        Ok(v1::Telling::Speech) => Telling::Audio(Sound::Speech),
        Err(_) => {
            let found = format!("is {}", request.into);
            let allowed = "TELLING_WORDS (0), TELLING_MUSIC (1) or TELLING_SPEECH (2)";
            return Err(root.field("into").error(found, allowed));
        }
    };
    if pack.language().is_some() {
        return Ok(into);
    }
    let no_model = format!("the pack {} has no language model", pack.name());
    if into != Telling::Words {
        let allowed = format!("words: {no_model}");
        return Err(root.field("into").error("asks for audio", allowed));
    }
    match request.others.is_empty() {
        true => Ok(into),
        false => Err(root
            .field("others")
            .error("is given", format!("none: {no_model}"))),
    }
}
