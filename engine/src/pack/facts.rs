//! Facts of a pack that the layers above need, beside its capabilities.

use troupe_motion::model::{SamplingTask, Task};

use super::vermo::VerMoDoc;
use super::{Lexicon, Pack};
use crate::{EngineError, vermo};

/// Steps of the sampler of a pack whose network refines noise step by step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SamplerSteps {
    /// Steps for a task that names none; 1 to `max`.
    pub default: u32,
    /// Most steps of a task: as many as the training had.
    pub max: u32,
}

/// The language model of a pack.
#[derive(Debug, Clone, Copy)]
pub struct Language<'a> {
    pack: &'a Pack,
    table: &'a VerMoDoc,
}

/// A task that a language model does not accept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskRefusal {
    /// The task's field, as requests spell it.
    pub field: &'static str,
    /// The field's value, as text.
    pub found: String,
    /// The allowed values, as text.
    pub allowed: String,
}

impl Pack {
    /// The steps of the pack's sampler; none for a pack without one.
    pub fn sampler(&self) -> Option<SamplerSteps> {
        let table = self.manifest.unimogen.as_ref()?;
        Some(SamplerSteps {
            default: table.sampler_steps as u32,
            max: table.diffusion_steps as u32,
        })
    }

    /// The pack's language model; none for a pack without one.
    pub fn language(&self) -> Option<Language<'_>> {
        let table = self.manifest.vermo.as_ref()?;
        Some(Language { pack: self, table })
    }
}

impl<'a> Language<'a> {
    /// Names of the tasks of the training, as `pack.toml` spells them.
    pub fn tasks(&self) -> impl Iterator<Item = &'static str> + use<'a> {
        self.table.tasks.iter().map(|task| task.name())
    }

    /// Most text pieces of a prompt: the sum over all characters.
    pub fn max_prompt_pieces(&self) -> usize {
        self.table.max_prompt_pieces
    }

    /// Most characters of one motion.
    pub fn max_agents(&self) -> usize {
        self.table.max_agents
    }

    /// Most frames of one motion that the model reads.
    pub fn max_frames(&self) -> usize {
        self.pack.rig.dims.max_frames()
    }

    /// Number of audio codes, which count from 0; 0 for a model without audio.
    pub fn audio_codes(&self) -> usize {
        self.table.audio_codes
    }

    /// Steps that the flow decoder was made for; 0 for a pack without it.
    pub fn flow_steps(&self) -> usize {
        self.table.flow_steps
    }

    /// How the model chooses tokens for a task that does not say. Every value is given.
    pub fn sampling(&self) -> SamplingTask {
        SamplingTask {
            temperature: Some(self.table.temperature),
            top_k: Some(self.table.top_k as u32),
            top_p: Some(self.table.top_p),
            repetition: Some(self.table.repetition),
        }
    }

    fn lexicon(&self) -> Option<&'a Lexicon> {
        self.pack.lexicon.as_deref()
    }

    /// Words of a text that occur in no caption of the training: in lower case, each once, in the
    /// order of the text.
    pub fn unknown_words(&self, text: &str) -> Vec<String> {
        self.lexicon()
            .map_or_else(Vec::new, |lexicon| lexicon.unknown_words(text))
    }

    /// Whether the model can read at least one letter of a text.
    pub fn can_read(&self, text: &str) -> bool {
        self.lexicon()
            .is_none_or(|lexicon| !lexicon.pieces(text).unwrap_or_default().is_empty())
    }

    /// Whether this text is short enough for a prompt.
    pub fn fits(&self, text: &str) -> bool {
        self.lexicon().is_none_or(|lexicon| {
            lexicon.pieces(text).unwrap_or_default().len() <= self.table.max_prompt_pieces
        })
    }

    /// Checks a task before a generator admits it.
    ///
    /// # Errors
    /// [`TaskRefusal`] for the first field that is not accepted.
    pub fn check(&self, task: &Task) -> Result<(), TaskRefusal> {
        match vermo::check(self.pack, task) {
            Err(EngineError::Task {
                field,
                found,
                allowed,
            }) => Err(TaskRefusal {
                field,
                found,
                allowed,
            }),
            // The generator reports any other problem.
            Ok(()) | Err(_) => Ok(()),
        }
    }
}
