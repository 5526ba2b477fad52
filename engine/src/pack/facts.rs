//! What the layers above ask a pack, beside its capabilities.

use troupe_motion::model::{SamplingTask, Task};

use super::vermo::VerMoDoc;
use super::{Lexicon, Pack};
use crate::{EngineError, vermo};

/// Steps of the sampler of a pack whose network refines noise step by step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SamplerSteps {
    /// Steps of a task that names none; 1 to `max`.
    pub default: u32,
    /// Most steps of a task: those of the training.
    pub max: u32,
}

/// The language model of a pack.
#[derive(Debug, Clone, Copy)]
pub struct Language<'a> {
    pack: &'a Pack,
    table: &'a VerMoDoc,
}

/// A task that a language model does not take.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskRefusal {
    /// The task's field.
    pub field: &'static str,
    /// What it holds.
    pub found: String,
    /// What it may hold.
    pub allowed: String,
}

impl Pack {
    /// The steps of its sampler; none for a pack without one.
    pub fn sampler(&self) -> Option<SamplerSteps> {
        let table = self.manifest.unimogen.as_ref()?;
        Some(SamplerSteps {
            default: table.sampler_steps as u32,
            max: table.diffusion_steps as u32,
        })
    }

    /// Its language model; none for a pack without one.
    pub fn language(&self) -> Option<Language<'_>> {
        let table = self.manifest.vermo.as_ref()?;
        Some(Language { pack: self, table })
    }
}

impl<'a> Language<'a> {
    /// Names of the tasks that it was trained for, as `pack.toml` spells them.
    pub fn tasks(&self) -> impl Iterator<Item = &'static str> + use<'a> {
        self.table.tasks.iter().map(|task| task.name())
    }

    /// Most text pieces of a prompt, those of all characters together.
    pub fn max_prompt_pieces(&self) -> usize {
        self.table.max_prompt_pieces
    }

    /// Most characters of one motion.
    pub fn max_agents(&self) -> usize {
        self.table.max_agents
    }

    /// Most frames that it reads of one motion.
    pub fn max_frames(&self) -> usize {
        self.pack.rig.dims.max_frames()
    }

    /// Audio codes that it knows: 0 to one below this. 0 for a model without audio.
    pub fn audio_codes(&self) -> usize {
        self.table.audio_codes
    }

    /// Steps that the flow decoder was made for; 0 for a pack without it.
    pub fn flow_steps(&self) -> usize {
        self.table.flow_steps
    }

    /// How it chooses tokens of a task that does not say: every value is given.
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

    /// Words of a text that no caption of the training used, in lower case, each once, in the order
    /// of the text.
    pub fn unknown_words(&self, text: &str) -> Vec<String> {
        self.lexicon()
            .map_or_else(Vec::new, |lexicon| lexicon.unknown_words(text))
    }

    /// Whether it can read any letter of a text.
    pub fn can_read(&self, text: &str) -> bool {
        self.lexicon()
            .is_none_or(|lexicon| !lexicon.pieces(text).unwrap_or_default().is_empty())
    }

    /// Whether a prompt may be as long as this text.
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
            // Anything else is the generator's to say.
            Ok(()) | Err(_) => Ok(()),
        }
    }
}
