//! The tasks of a pack that can serve a prompt.

use troupe_motion::model::{Audio, PromptTask, Sound};

use crate::pack::MessageTask;

/// The tasks that can serve a prompt, the best first.
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

/// The tasks that can continue a motion, the best first.
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
