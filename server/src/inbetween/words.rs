//! What a pack that understands text takes, before a task is admitted to it.

use troupe_character::{FieldError, Path};
use troupe_engine::EngineError;
use troupe_engine::pack::Pack;
use troupe_engine::vermo;
use troupe_motion::model::Task;

/// Most words that a note names.
const MAX_NAMED: usize = 8;
/// Most characters of a word that a note names.
const MAX_WORD_CHARS: usize = 32;

/// Most frames that go before words: more than the pack's context where it takes more.
pub fn most_past(pack: &Pack) -> usize {
    match &pack.manifest.vermo {
        Some(_) => pack.rig.dims.max_frames(),
        None => pack.rig.dims.context_frames,
    }
}

/// Checks a task against the lengths that the pack can read and write. Gives notes on what the model may not do well.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn check_words(pack: &Pack, task: &Task) -> Result<Vec<String>, FieldError> {
    if pack.manifest.vermo.is_some()
        && let Err(EngineError::Task {
            field,
            found,
            allowed,
        }) = vermo::check(pack, task)
    {
        return Err(field_error(task, field, &found, allowed));
    }
    let (Task::Prompt(prompt), Some(lexicon)) = (task, &pack.lexicon) else {
        return Ok(Vec::new());
    };
    let unknown = lexicon.unknown_words(&prompt.text);
    if unknown.is_empty() {
        return Ok(Vec::new());
    }
    let named = unknown.iter().take(MAX_NAMED);
    let named: Vec<String> = named
        .map(|word| word.chars().take(MAX_WORD_CHARS).collect())
        .collect();
    let more = if unknown.len() > MAX_NAMED {
        ", and others"
    } else {
        ""
    };
    Ok(vec![format!(
        "captions of the pack's training have not used: {}{more}",
        named.join(", ")
    )])
}

/// An error of the request's field that a task's field comes from.
fn field_error(task: &Task, field: &'static str, found: &str, allowed: String) -> FieldError {
    let root = Path::root();
    let goal = match task {
        Task::Describe(_) => root.field("describe"),
        _ => root.field("prompt"),
    };
    let path = match (field, task) {
        ("temperature", _) => root.field("temperature"),
        ("context", _) => root.field("past"),
        ("frames", Task::Describe(_)) => goal.field("frames"),
        ("frames", _) => goal.field("frame_count"),
        (field, _) => goal.field(field),
    };
    path.error(format!("is {found}"), allowed)
}

#[cfg(test)]
mod tests {
    use std::path::Path as FilePath;

    use troupe_motion::model::{DescribeTask, KeyTensors, PromptTask, SamplingTask};

    use super::*;

    fn pack() -> Pack {
        let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
        Pack::load(&folder).unwrap()
    }

    fn prompt(text: &str) -> PromptTask {
        PromptTask {
            text: text.to_owned(),
            ..PromptTask::default()
        }
    }

    #[test]
    fn words_that_training_did_not_use_are_noted() {
        let notes = |text: &str| check_words(&pack(), &Task::Prompt(prompt(text))).unwrap();
        assert_eq!(notes("An old person walks."), [] as [&str; 0]);
        assert_eq!(
            notes("A robot walks like a robot, whirring"),
            ["captions of the pack's training have not used: robot, whirring"]
        );
        let many = notes("b c d e f g h i j k");
        assert_eq!(
            many,
            ["captions of the pack's training have not used: b, c, d, e, f, g, h, i, and others"]
        );
    }

    #[test]
    fn what_the_pack_cannot_take_names_the_requests_field() {
        let describe = |frames: usize| {
            Task::Describe(DescribeTask {
                frames: vec![KeyTensors::default(); frames],
                ..DescribeTask::default()
            })
        };
        let warm = PromptTask {
            sampling: SamplingTask::at(9.0),
            ..prompt("walk")
        };
        let past = PromptTask {
            context: vec![KeyTensors::default(); 4],
            ..prompt("walk")
        };
        for (task, said) in [
            (
                Task::Prompt(prompt(&"zz ".repeat(50))),
                "prompt.text: is 150 pieces long; allowed: at most 40 pieces",
            ),
            (
                Task::Prompt(prompt("?!")),
                "prompt.text: is \"?!\"; allowed: letters that the pack can read",
            ),
            (Task::Prompt(warm), "temperature: is 9; allowed: 0 to 2"),
            (Task::Prompt(past), "past: is 4; allowed: 16 or more"),
            (describe(3), "describe.frames: is 3; allowed: 4 to 259"),
            (describe(300), "describe.frames: is 300; allowed: 4 to 259"),
        ] {
            let error = check_words(&pack(), &task).unwrap_err();
            assert_eq!(error.to_string(), said);
        }
    }
}
