//! Guidance: replies in which a caption's content and style count more than the training made them
//! (docs/vermo-pack.md).

use troupe_motion::model::PromptTask;

use super::plan::{Planner, Speech};
use super::{Condition, Guide, Message};
use crate::EngineError;
use crate::pack::MessageTask;

impl Planner {
    /// Text pieces of the caption without its style, if the reply is to be guided. Only motion of
    /// one character from a caption alone is.
    pub(super) fn unstyled(
        &self,
        task: &PromptTask,
        captions: &[Vec<u32>],
    ) -> Result<Option<Vec<u32>>, EngineError> {
        let is_bare = task.context.is_empty()
            && task.targets.is_empty()
            && task.others.is_empty()
            && task.audio.is_none();
        let [caption] = captions else {
            return Ok(None);
        };
        if !is_bare || !self.table.is_guided() || !self.table.tasks.contains(&MessageTask::Unconditional) {
            return Ok(None);
        }
        let unstyled = self.lexicon.unstyled(&task.text);
        let pieces = unstyled
            .map(|text| self.captions(std::iter::once(&text)))
            .transpose()?;
        // A guide must leave the reply as much room as the prompt does.
        let fits = |pieces: &Vec<u32>| pieces.len() <= caption.len();
        Ok(pieces
            .and_then(|captions| captions.into_iter().next())
            .filter(fits))
    }

    /// The messages that guide a reply: the same without the style of its caption, and no caption.
    ///
    /// With the content's guidance a and the style's b, the logits are
    /// `nothing + a · (content − nothing) + b · (content and style − content)`.
    pub(super) fn guides(&self, speech: &Speech, length: Option<usize>) -> Vec<Guide> {
        let Some(unstyled) = &speech.unstyled else {
            return Vec::new();
        };
        let (content, style) = (self.table.content_guidance, self.table.style_guidance);
        let message = |task, captions| Message {
            task,
            captions,
            condition: Condition::None,
            length,
        };
        let plain = message(speech.task, vec![unstyled.clone()]);
        let nothing = message(MessageTask::Unconditional, Vec::new());
        let guides = [(plain, content - style), (nothing, 1.0 - content)].map(|(message, weight)| Guide {
            tokens: message.tokens(&self.vocabulary),
            weight,
        });
        guides.into_iter().filter(|guide| guide.weight != 0.0).collect()
    }
}
