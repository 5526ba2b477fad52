//! Checks tasks with words against what a pack's language model takes.

use troupe_character::live::MAX_UNKNOWN_WORDS;
use troupe_character::{FieldError, Path};
use troupe_engine::pack::{Language, Pack, TaskRefusal};
use troupe_motion::model::{PromptTask, Task};
use troupe_proto::v1;

use troupe_live::wire::MAX_PROMPT_CHARS;

/// Most characters of a word in a note.
const MAX_WORD_CHARS: usize = 32;

/// Most frames before the words. The language model may take more than the pack's context.
pub fn most_past(pack: &Pack) -> usize {
    let context = pack.rig.dims.context_frames;
    pack.language().map_or(context, |language| language.max_frames())
}

/// Checks a prompt's task against what the pack can read and write. Returns notes about what the
/// model may not do well.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(super) fn check_prompt(pack: &Pack, asked: &v1::Prompt, task: &Task) -> Result<Vec<String>, FieldError> {
    let Some(language) = pack.language() else {
        return Ok(Vec::new());
    };
    language
        .check(task)
        .map_err(|refusal| of_prompt(refusal, language, asked))?;
    let mut unknown: Vec<String> = Vec::new();
    for word in texts(asked).flat_map(|text| language.unknown_words(text)) {
        if !unknown.contains(&word) {
            unknown.push(word);
        }
    }
    Ok(unknown_note(&unknown).into_iter().collect())
}

/// Checks words without a task. Returns notes about what the model may not do well.
///
/// # Errors
/// [`FieldError`] if the pack cannot read them.
pub fn check_words(pack: &Pack, text: &str) -> Result<Vec<String>, FieldError> {
    let asked = v1::Prompt {
        text: text.to_owned(),
        ..v1::Prompt::default()
    };
    let task = Task::Prompt(PromptTask {
        text: text.to_owned(),
        ..PromptTask::default()
    });
    check_prompt(pack, &asked, &task)
}

/// The first words of a text, as many as fit into a prompt of the pack.
pub fn fitting(pack: &Pack, text: &str) -> String {
    let language = pack.language();
    let fits = |text: &str| {
        language.is_none_or(|language| language.fits(text)) && text.chars().count() <= MAX_PROMPT_CHARS
    };
    let mut text = text.trim();
    while !fits(text) {
        // Cut off the last word, or a letter of it if there is only one.
        let cut = text.rfind(char::is_whitespace);
        let cut = cut.or_else(|| text.char_indices().next_back().map(|(at, _)| at));
        text = text[..cut.unwrap_or(0)].trim_end();
    }
    text.to_owned()
}

/// Checks a description's task against what the pack can read and write.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn check_description(pack: &Pack, task: &Task) -> Result<(), FieldError> {
    match pack.language() {
        None => Ok(()),
        Some(language) => language.check(task).map_err(of_description),
    }
}

/// The texts of all characters.
fn texts(asked: &v1::Prompt) -> impl Iterator<Item = &str> {
    let others = asked.others.iter().map(|other| &*other.text);
    std::iter::once(&*asked.text).chain(others)
}

fn unknown_note(unknown: &[String]) -> Option<String> {
    if unknown.is_empty() {
        return None;
    }
    let named = unknown.iter().take(MAX_UNKNOWN_WORDS);
    let named: Vec<String> = named
        .map(|word| word.chars().take(MAX_WORD_CHARS).collect())
        .collect();
    let more = if unknown.len() > MAX_UNKNOWN_WORDS {
        ", and others"
    } else {
        ""
    };
    Some(format!(
        "captions of the pack's training have not used: {}{more}",
        named.join(", ")
    ))
}

/// Maps an error of the task to the prompt's field.
fn of_prompt(refusal: TaskRefusal, language: Language<'_>, asked: &v1::Prompt) -> FieldError {
    let root = Path::root();
    let prompt = root.field("prompt");
    let TaskRefusal {
        field,
        found,
        allowed,
    } = refusal;
    match field {
        "temperature" | "top_p" | "repetition" => sampling_error(&root, field, &found, allowed),
        "context" => root.field("past").error(format!("is {found}"), allowed),
        "frames" if asked.seconds.is_some() => {
            let found = format!("is {found} frames");
            prompt.field("seconds").error(found, allowed + " frames")
        }
        "frames" => prompt.field("frame_count").error(format!("is {found}"), allowed),
        "audio" if found == "given" => prompt.field("audio").error("is given", allowed),
        "audio" => {
            let audio = prompt.field("audio");
            audio.field("codes").error(format!("has {found}"), allowed)
        }
        "kind" => wanting(asked, &root, &prompt).error(
            format!("needs one of the tasks {found}"),
            format!("those of the pack: {allowed}"),
        ),
        "message" if asked.audio.is_some() => {
            let audio = prompt.field("audio");
            audio.field("codes").error(format!("is {found}"), allowed)
        }
        "message" => prompt.field("text").error(format!("is {found}"), allowed),
        "text" => {
            let other = unread(language, asked).and_then(|index| index.checked_sub(1));
            let at = other.map(|index| prompt.element("others", index));
            let at = at.as_ref().unwrap_or(&prompt);
            at.field("text").error(format!("is {found}"), allowed)
        }
        field => prompt.field(field).error(format!("is {found}"), allowed),
    }
}

/// Maps an error of the task to the description's field.
fn of_description(refusal: TaskRefusal) -> FieldError {
    let root = Path::root();
    let TaskRefusal {
        field,
        found,
        allowed,
    } = refusal;
    match field {
        "temperature" | "top_p" | "repetition" => sampling_error(&root, field, &found, allowed),
        "kind" => root.field("into").error(
            format!("needs the task {found}"),
            format!("those of the pack: {allowed}"),
        ),
        "message" => root.field("frames").error(format!("is {found}"), allowed),
        field => root.field(field).error(format!("is {found}"), allowed),
    }
}

fn sampling_error(root: &Path<'_>, field: &'static str, found: &str, allowed: String) -> FieldError {
    let sampling = root.field("sampling");
    sampling.field(field).error(format!("is {found}"), allowed)
}

/// The prompt's field that decides which task it is.
fn wanting<'a>(asked: &v1::Prompt, root: &'a Path<'a>, prompt: &'a Path<'a>) -> Path<'a> {
    if asked.audio.is_some() {
        prompt.field("audio")
    } else if !asked.targets.is_empty() {
        prompt.field("targets")
    } else if asked.text.trim().is_empty() {
        root.field("past")
    } else {
        prompt.field("text")
    }
}

/// The first character whose text has no letter that the pack can read.
fn unread(language: Language<'_>, asked: &v1::Prompt) -> Option<usize> {
    texts(asked).position(|text| !text.trim().is_empty() && !language.can_read(text))
}

#[cfg(test)]
#[path = "words_tests.rs"]
mod tests;
