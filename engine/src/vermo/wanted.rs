//! Which of a pack's tasks a prompt may be.

use troupe_motion::model::{Audio, PromptTask, Sound};

use crate::pack::MessageTask;

/// What a prompt may be to a pack, the best first.
pub(super) fn wanted_tasks(task: &PromptTask, has_context: bool, has_text: bool) -> Vec<MessageTask> {
    match &task.audio {
        Some(Audio {
            sound: Sound::Music, ..
        }) => return vec![MessageTask::MusicToDance],
        Some(Audio {
            sound: Sound::Speech, ..
        }) => return vec![MessageTask::SpeechToGesture],
        None => {}
    }
    match (task.targets.is_empty(), has_context, has_text) {
        (false, _, _) => vec![MessageTask::Inbetween],
        (true, true, has_text) => continuing(has_text).to_vec(),
        (true, false, true) => vec![MessageTask::TextToMotion],
        (true, false, false) => vec![MessageTask::Unconditional],
    }
}

/// What a motion that goes on may be to a pack.
pub(super) fn continuing(has_text: bool) -> &'static [MessageTask] {
    match has_text {
        true => &[
            MessageTask::Continuation,
            MessageTask::TextToMotion,
            MessageTask::Prediction,
        ],
        false => &[MessageTask::Continuation, MessageTask::Prediction],
    }
}
