//! The parts of a pack that only VerMo packs have: the table `[vermo]`, and its files
//! (docs/vermo-pack.md).

use std::collections::HashSet;
use std::fmt;

use serde::{Deserialize, Serialize};
use troupe_motion::model::{Capabilities, Capability, Dims};

use super::PackProblem;
use super::manifest::field;

/// File name of the language model.
pub const LANGUAGE_FILE: &str = "language.onnx";
/// File name of the network that turns frames into motion tokens.
pub const ENCODER_FILE: &str = "encoder.onnx";
/// File name of the network that turns motion tokens into frames.
pub const DECODER_FILE: &str = "decoder.onnx";
/// File name of the flow decoder. A pack may lack it.
pub const FLOW_FILE: &str = "flow.onnx";
/// File name of the tokenizer's text pieces.
pub const TOKENIZER_FILE: &str = "tokenizer.json";
/// File name of the list of words in captions of the training.
pub const WORDS_FILE: &str = "words.txt";
/// File name of the list of wordings of styles. A pack without guidance may lack it.
pub const STYLES_FILE: &str = "styles.txt";

/// Frames that one motion token stands for.
pub(crate) const FRAMES_PER_TOKEN: usize = 4;
/// Tokens of a message beside its text and its reply: `<BOS>`, task, `<INSTRUCTION>`, `<LEN_n>`,
/// `<REPLY>`, `<EOS>`.
const MARKS: usize = 6;
/// Upper bound of every size of the networks.
const MAX_SIZE: usize = 65_536;
/// Most tokens of a message.
const MAX_POSITIONS: usize = 16_384;
/// Most characters of one message.
const MAX_AGENTS: usize = 16;
/// Most steps of the flow decoder.
pub const MAX_FLOW_STEPS: usize = 256;
/// Highest temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;
/// Strongest penalty for repetition.
pub const MAX_REPETITION: f32 = 10.0;
/// Strongest guidance.
const MAX_GUIDANCE: f32 = 16.0;

/// The tasks that a message can name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MessageTask {
    /// From a caption to motion.
    TextToMotion,
    /// From motion to a caption.
    MotionToText,
    /// From the first two fifths of a motion to the rest.
    Prediction,
    /// From the motions before and after a gap to the motion in the gap.
    Inbetween,
    /// From the start of a motion to its continuation.
    Continuation,
    /// Any motion.
    Unconditional,
    /// From music to a dance.
    MusicToDance,
    /// From a dance to music.
    DanceToMusic,
    /// From speech to gestures.
    SpeechToGesture,
    /// From gestures to speech.
    GestureToSpeech,
}

impl MessageTask {
    /// All tasks, in the order of their tokens.
    pub const ALL: [Self; 10] = [
        Self::TextToMotion,
        Self::MotionToText,
        Self::Prediction,
        Self::Inbetween,
        Self::Continuation,
        Self::Unconditional,
        Self::MusicToDance,
        Self::DanceToMusic,
        Self::SpeechToGesture,
        Self::GestureToSpeech,
    ];

    /// The task's name in a manifest and in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::TextToMotion => "text_to_motion",
            Self::MotionToText => "motion_to_text",
            Self::Prediction => "prediction",
            Self::Inbetween => "inbetween",
            Self::Continuation => "continuation",
            Self::Unconditional => "unconditional",
            Self::MusicToDance => "music_to_dance",
            Self::DanceToMusic => "dance_to_music",
            Self::SpeechToGesture => "speech_to_gesture",
            Self::GestureToSpeech => "gesture_to_speech",
        }
    }

    /// Whether the message or its reply has audio tokens.
    pub fn has_audio(self) -> bool {
        matches!(
            self,
            Self::MusicToDance | Self::DanceToMusic | Self::SpeechToGesture | Self::GestureToSpeech
        )
    }
}

impl fmt::Display for MessageTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The table `[vermo]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VerMoDoc {
    /// Layers of the language model.
    pub layers: usize,
    /// Heads of a layer's keys and values.
    pub key_heads: usize,
    /// Numbers of a head.
    pub head_width: usize,
    /// The longest message, in tokens.
    pub positions: usize,
    /// Text pieces of the vocabulary.
    pub text_pieces: usize,
    /// Motion tokens of the vocabulary.
    pub motion_codes: usize,
    /// Audio tokens of the vocabulary; 0 for none.
    pub audio_codes: usize,
    /// What the model was trained to do.
    pub tasks: Vec<MessageTask>,
    /// Most text pieces of a prompt, those of all its captions together.
    pub max_prompt_pieces: usize,
    /// Most characters of a message.
    pub max_agents: usize,
    /// Steps of the flow decoder for tasks that name none; 0 for a pack without flow decoder.
    pub flow_steps: usize,
    /// Temperature for tasks that name none; 0 always takes the likeliest token.
    pub temperature: f32,
    /// Only the `top_k` likeliest tokens may be chosen; 0 allows all.
    pub top_k: usize,
    /// Only the likeliest tokens, up to this sum of probabilities, may be chosen; 1 allows all.
    pub top_p: f32,
    /// Divisor of the logits of the latest tokens, against repetition; 1 changes nothing.
    pub repetition: f32,
    /// How strongly a caption's content counts in a reply whose caption names a style; 1 is as
    /// trained.
    #[serde(default = "unguided")]
    pub content_guidance: f32,
    /// How strongly its style counts; 1 is as trained.
    #[serde(default = "unguided")]
    pub style_guidance: f32,
}

fn unguided() -> f32 {
    1.0
}

impl VerMoDoc {
    /// Whether replies to captions that name a style are guided.
    pub fn is_guided(&self) -> bool {
        (self.content_guidance, self.style_guidance) != (1.0, 1.0)
    }

    /// Checks all values.
    ///
    /// # Errors
    /// [`PackProblem::Field`] for the first value out of its range.
    pub(super) fn check(&self, dims: &Dims, capabilities: Capabilities) -> Result<(), PackProblem> {
        let unit = FRAMES_PER_TOKEN;
        let least = self.max_prompt_pieces.min(MAX_POSITIONS) + dims.max_tokens + MARKS;
        let ranges = [
            ("frames_per_token", dims.frames_per_token, unit, unit),
            ("context_frames", dims.context_frames, unit, dims.max_frames()),
            ("vermo.layers", self.layers, 1, MAX_SIZE),
            ("vermo.key_heads", self.key_heads, 1, MAX_SIZE),
            ("vermo.head_width", self.head_width, 1, MAX_SIZE),
            ("vermo.text_pieces", self.text_pieces, 1, MAX_SIZE),
            ("vermo.motion_codes", self.motion_codes, 1, MAX_SIZE),
            ("vermo.audio_codes", self.audio_codes, 0, MAX_SIZE),
            ("vermo.tasks", self.tasks.len(), 1, MessageTask::ALL.len()),
            (
                "vermo.max_prompt_pieces",
                self.max_prompt_pieces,
                1,
                MAX_POSITIONS,
            ),
            ("vermo.positions", self.positions, least, MAX_POSITIONS),
            ("vermo.max_agents", self.max_agents, 1, MAX_AGENTS),
            ("vermo.flow_steps", self.flow_steps, 0, MAX_FLOW_STEPS),
            ("vermo.top_k", self.top_k, 0, MAX_SIZE),
        ];
        for (name, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(field(name, value, format!("{low} to {high}")));
            }
        }
        if !dims.context_frames.is_multiple_of(unit) {
            return Err(field(
                "context_frames",
                dims.context_frames,
                format!("a multiple of {unit}"),
            ));
        }
        let shares = [
            ("vermo.temperature", self.temperature, 0.0, MAX_TEMPERATURE),
            ("vermo.top_p", self.top_p, f32::MIN_POSITIVE, 1.0),
            ("vermo.repetition", self.repetition, 1.0, MAX_REPETITION),
            ("vermo.content_guidance", self.content_guidance, 1.0, MAX_GUIDANCE),
            ("vermo.style_guidance", self.style_guidance, 1.0, MAX_GUIDANCE),
        ];
        for (name, value, low, high) in shares {
            if !(low..=high).contains(&value) {
                let low = if low == f32::MIN_POSITIVE {
                    "more than 0".to_owned()
                } else {
                    low.to_string()
                };
                return Err(field(name, value, format!("{low} to {high}")));
            }
        }
        self.check_tasks(capabilities)
    }

    /// Checks that the tasks fit the capabilities and the tokens of the vocabulary.
    fn check_tasks(&self, capabilities: Capabilities) -> Result<(), PackProblem> {
        let mut seen = HashSet::new();
        if let Some(twice) = self.tasks.iter().find(|task| !seen.insert(**task)) {
            return Err(field("vermo.tasks", twice, "each task once"));
        }
        if let Some(task) = self
            .tasks
            .iter()
            .find(|task| task.has_audio() && self.audio_codes == 0)
        {
            return Err(field(
                "vermo.tasks",
                task,
                "tasks without audio, because audio_codes is 0",
            ));
        }
        let has = |task| self.tasks.contains(&task);
        let agents = self.max_agents > 1;
        for (capability, can, allowed) in [
            (
                Capability::Text,
                has(MessageTask::TextToMotion),
                "only with the task text_to_motion",
            ),
            (
                Capability::Describe,
                has(MessageTask::MotionToText),
                "only with the task motion_to_text",
            ),
            (Capability::Agents, agents, "only with vermo.max_agents above 1"),
            (Capability::Inbetween, false, "none, because of the family"),
            (Capability::Live, false, "none, because of the family"),
            (Capability::Path, false, "none, because of the family"),
        ] {
            let says = capabilities.has(capability);
            if says != can {
                let says = if says { "present" } else { "missing" };
                return Err(field("capabilities", format!("{capability} {says}"), allowed));
            }
        }
        Ok(())
    }

    /// The files of the networks and of the text pieces, in the order in which the content hash
    /// reads them.
    pub(super) fn files(&self) -> &'static [&'static str] {
        match self.flow_steps {
            0 => &[LANGUAGE_FILE, ENCODER_FILE, DECODER_FILE, TOKENIZER_FILE],
            _ => &[
                LANGUAGE_FILE,
                ENCODER_FILE,
                DECODER_FILE,
                FLOW_FILE,
                TOKENIZER_FILE,
            ],
        }
    }
}
