//! From a task to messages: chooses the pack's task, checks the values, and fixes the length of
//! each reply.

use std::sync::Arc;

use troupe_motion::model::{
    Audio, DescribeTask, Dims, KeyTensors, PromptTask, SamplingTask, Sound, Task, Telling,
};

use super::motion::Frames;
use super::reply::Rules;
use super::sampler::Sampling;
use super::vocabulary::{Kind, Vocabulary};
use super::wanted::{continuing, wanted_tasks};
use super::{Condition, Message};
use crate::EngineError;
use crate::pack::{Lexicon, MAX_FLOW_STEPS, MAX_REPETITION, MAX_TEMPERATURE, MessageTask, Pack, VerMoDoc};

/// Most frames of a motion that a task may ask for.
const MAX_FRAMES: usize = 4096;

/// Knows what a pack accepts, and plans messages for it.
#[derive(Debug, Clone)]
pub(super) struct Planner {
    pub(super) table: VerMoDoc,
    pub(super) dims: Dims,
    pub(super) lexicon: Arc<Lexicon>,
    pub(super) vocabulary: Vocabulary,
}

/// The contents of a job's messages, before its motion is encoded.
#[derive(Debug, Clone)]
pub(super) struct Speech {
    pub(super) task: MessageTask,
    /// Text pieces of each agent's caption; empty for no instruction.
    pub(super) captions: Vec<Vec<u32>>,
    /// Text pieces of the caption without its style, if the reply is guided.
    pub(super) unstyled: Option<Vec<u32>>,
    /// Frames of each agent that precede the reply or are described, in whole tokens; empty for
    /// none.
    pub(super) given: Vec<Frames>,
    /// Frames behind the gap, in whole tokens.
    pub(super) behind: Option<Frames>,
    pub(super) audio: Option<Audio>,
    pub(super) agents: usize,
    pub(super) sampling: Sampling,
}

/// How the tokens of the next message and reply are shared out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Share {
    /// Tokens of the reply, if fixed.
    pub(super) length: Option<usize>,
    /// Tokens of each agent's given motion that the message contains.
    pub(super) given: usize,
    pub(super) rules: Rules,
}

/// Checks whether a pack accepts a task, before a generator of the pack admits it.
///
/// # Errors
/// [`EngineError::Task`], which names the task's field and the allowed values.
pub fn check(pack: &Pack, task: &Task) -> Result<(), EngineError> {
    Planner::new(pack)?.check(task)
}

impl Planner {
    /// The planner of a pack.
    ///
    /// # Errors
    /// [`EngineError::WrongTask`] if the pack belongs to another family, or its files were not
    /// read.
    pub(super) fn new(pack: &Pack) -> Result<Self, EngineError> {
        let table = pack.manifest.vermo.clone().ok_or(EngineError::WrongTask)?;
        Ok(Self {
            vocabulary: Vocabulary::new(&table, pack.rig.dims.max_tokens),
            dims: pack.rig.dims,
            lexicon: pack.lexicon.clone().ok_or(EngineError::WrongTask)?,
            table,
        })
    }

    /// Checks a task of one of the family's kinds.
    fn check(&self, task: &Task) -> Result<(), EngineError> {
        match task {
            Task::Prompt(task) => self.prompt(task).map(|_| ()),
            Task::Describe(task) => self.describe(task).map(|_| ()),
            Task::Keyframes(_) | Task::Path(_) => Err(EngineError::WrongTask),
        }
    }

    /// Checks a prompt.
    pub(super) fn prompt(&self, task: &PromptTask) -> Result<Speech, EngineError> {
        let agents = 1 + task.others.len();
        in_range("others", agents - 1, 0, self.table.max_agents - 1)?;
        let texts = std::iter::once(&task.text).chain(task.others.iter().map(|other| &other.text));
        let captions = self.captions(texts)?;
        let contexts = std::iter::once(&task.context).chain(task.others.iter().map(|other| &other.context));
        let given = self.given(contexts)?;
        if let Some(frames) = task.frames {
            in_range("frames", frames, 1, MAX_FRAMES)?;
        }
        in_range("flow_steps", task.flow_steps as usize, 0, self.most_flow_steps())?;
        let behind = self.behind(task)?;
        if let Some(audio) = &task.audio {
            self.check_audio(audio, task)?;
        }
        let speech = Speech {
            task: self.choose(&wanted_tasks(task, !given.is_empty(), !captions.is_empty()))?,
            unstyled: self.unstyled(task, &captions)?,
            captions,
            given,
            behind,
            audio: task.audio.clone(),
            agents,
            sampling: self.sampling(&task.sampling)?,
        };
        // A task that could not be finished is refused before it starts.
        let Share { length, .. } = self.share(&speech, task.frames)?;
        let made = length.map_or(usize::MAX, |tokens| tokens * self.dims.frames_per_token);
        if task.frames.is_some_and(|frames| frames > made) {
            self.next(&speech, Vec::new())?;
        }
        Ok(speech)
    }

    /// Checks a motion to describe.
    pub(super) fn describe(&self, task: &DescribeTask) -> Result<Speech, EngineError> {
        let agents = 1 + task.others.len();
        in_range("others", agents - 1, 0, self.table.max_agents - 1)?;
        let unit = self.dims.frames_per_token;
        in_range(
            "frames",
            task.frames.len(),
            unit,
            self.dims.max_frames() + unit - 1,
        )?;
        let all = std::iter::once(&task.frames).chain(&task.others);
        let whole = task.frames.len() / unit * unit;
        let given = all.map(|keys| match keys.len() == task.frames.len() {
            true => self.frames("frames", &keys[..whole]),
            false => Err(wrong(
                "others",
                keys.len(),
                format!("{} frames", task.frames.len()),
            )),
        });
        let wanted = match task.into {
            Telling::Words => MessageTask::MotionToText,
            Telling::Audio(Sound::Music) => MessageTask::DanceToMusic,
            Telling::Audio(Sound::Speech) => MessageTask::GestureToSpeech,
        };
        let speech = Speech {
            task: self.choose(&[wanted])?,
            captions: Vec::new(),
            unstyled: None,
            given: given.collect::<Result<_, _>>()?,
            behind: None,
            audio: None,
            agents,
            sampling: self.sampling(&task.sampling)?,
        };
        self.share(&speech, None)?;
        Ok(speech)
    }

    /// The message of a speech whose motion has these codes.
    pub(super) fn message(
        &self,
        speech: &Speech,
        given: &[Vec<u32>],
        behind: Option<&Vec<u32>>,
        length: Option<usize>,
    ) -> Message {
        let condition = match (&speech.audio, behind) {
            (Some(audio), _) => Condition::Audio(audio.codes.clone()),
            (None, Some(behind)) => {
                let before = given.first().cloned().unwrap_or_default();
                Condition::Gap(vec![[before, behind.clone()]])
            }
            (None, None) if given.is_empty() => Condition::None,
            (None, None) => Condition::Motion(given.to_vec()),
        };
        Message {
            task: speech.task,
            captions: speech.captions.clone(),
            condition,
            length,
        }
    }

    /// Shares out the tokens of the next message and reply, if `frames` frames of motion are still
    /// to be made.
    ///
    /// # Errors
    /// [`EngineError::Task`] if the message leaves no room for a reply.
    pub(super) fn share(&self, speech: &Speech, frames: Option<usize>) -> Result<Share, EngineError> {
        let Dims {
            min_tokens,
            max_tokens,
            frames_per_token,
            context_frames,
            ..
        } = self.dims;
        let agents = speech.agents;
        let bare = self.message(
            speech,
            &vec![Vec::new(); speech.given.len()],
            None,
            frames.map(|_| 1),
        );
        // The token for the gap counts too.
        let behind = speech
            .behind
            .as_ref()
            .map_or(0, |frames| frames.len() / frames_per_token + 1);
        let room = self
            .table
            .positions
            .saturating_sub(bare.tokens(&self.vocabulary).len() + behind + 1);
        let given = speech
            .given
            .first()
            .map_or(0, |frames| frames.len() / frames_per_token);
        let kind = bare.reply_kind();
        let too_long = |room: usize| {
            let allowed = format!("at most {} tokens of message and reply", self.table.positions);
            wrong(
                "message",
                format!("too long, with room for {room} tokens"),
                allowed,
            )
        };
        if kind != Kind::Motion {
            let room = room
                .checked_sub(given * speech.given.len())
                .filter(|&room| room > 0);
            let most = room.ok_or_else(|| too_long(0))?;
            let rules = Rules {
                kind,
                agents: 1,
                least: 1,
                most,
            };
            return Ok(Share {
                length: None,
                given,
                rules,
            });
        }
        let wanted = frames.map(|frames| frames.div_ceil(frames_per_token).max(min_tokens));
        let each = ((room + 1) / agents).saturating_sub(1);
        // Given motion yields to the motion to be made, down to the pack's context.
        let kept = given
            .min(max_tokens)
            .min(each.saturating_sub(wanted.unwrap_or(max_tokens).min(max_tokens)))
            .max(given.min(context_frames / frames_per_token));
        let most = each.saturating_sub(kept).min(max_tokens);
        let in_one = speech.audio.is_some() || speech.behind.is_some();
        if most < min_tokens || in_one && wanted.is_some_and(|wanted| wanted > most) {
            return Err(too_long(most));
        }
        let length = wanted.map(|wanted| match wanted.checked_sub(most) {
            None | Some(0) => wanted,
            // The last reply must not have fewer tokens than a reply may have.
            Some(rest) => most
                .saturating_sub(min_tokens.saturating_sub(rest))
                .max(min_tokens),
        });
        Ok(Share {
            length,
            given: kept,
            rules: Rules {
                kind,
                agents,
                least: length.unwrap_or(min_tokens),
                most: length.unwrap_or(most),
            },
        })
    }

    /// The speech that continues a motion.
    pub(super) fn next(&self, speech: &Speech, given: Vec<Frames>) -> Result<Speech, EngineError> {
        let wanted = continuing(!speech.captions.is_empty());
        Ok(Speech {
            task: self.choose(wanted)?,
            given,
            unstyled: None,
            ..speech.clone()
        })
    }

    fn most_flow_steps(&self) -> usize {
        if self.table.flow_steps > 0 {
            MAX_FLOW_STEPS
        } else {
            0
        }
    }

    /// Text pieces of each agent's caption; empty if no agent has text.
    pub(super) fn captions<'a>(
        &self,
        texts: impl Iterator<Item = &'a String>,
    ) -> Result<Vec<Vec<u32>>, EngineError> {
        let most = self.table.max_prompt_pieces;
        let pieces = |text: &String| {
            let pieces = self
                .lexicon
                .pieces(text)
                .map_err(|found| wrong("text", found, "text"))?;
            match pieces.is_empty() && !text.trim().is_empty() {
                true => Err(wrong(
                    "text",
                    format!("{text:?}"),
                    "letters that the pack can read",
                )),
                false => Ok(pieces),
            }
        };
        let captions: Vec<Vec<u32>> = texts.map(pieces).collect::<Result<_, _>>()?;
        let all: usize = captions.iter().map(Vec::len).sum();
        if all > most {
            return Err(wrong(
                "text",
                format!("{all} pieces long"),
                format!("at most {most} pieces"),
            ));
        }
        let with_text = captions.iter().filter(|caption| !caption.is_empty()).count();
        match with_text {
            0 => Ok(Vec::new()),
            count if count == captions.len() => Ok(captions),
            _ => Err(wrong("text", "empty", "text for each character, or for none")),
        }
    }

    /// The latest frames before the motion, of each agent, in whole tokens: as many as a message
    /// may have.
    fn given<'a>(
        &self,
        contexts: impl Iterator<Item = &'a Vec<KeyTensors>>,
    ) -> Result<Vec<Frames>, EngineError> {
        let unit = self.dims.frames_per_token;
        let (least, most) = (self.dims.context_frames, self.dims.max_frames());
        let mut given = Vec::new();
        let mut first = None;
        for keys in contexts {
            let count = keys.len();
            if *first.get_or_insert(count) != count {
                return Err(wrong(
                    "context",
                    count,
                    "the same number of frames for each character",
                ));
            }
            if count == 0 {
                continue;
            }
            in_range("context", count, least, usize::MAX)?;
            let used = (count / unit * unit).min(most);
            given.push(self.frames("context", &keys[count - used..])?);
        }
        Ok(given)
    }

    /// The frames behind a gap. Fails if the gap cannot be filled.
    fn behind(&self, task: &PromptTask) -> Result<Option<Frames>, EngineError> {
        let unit = self.dims.frames_per_token;
        let count = task.targets.len();
        if count == 0 {
            return Ok(None);
        }
        if !task.others.is_empty() {
            return Err(wrong("targets", count, "none beside other characters"));
        }
        if task.context.is_empty() {
            return Err(wrong("targets", count, "none without a context"));
        }
        in_range("targets", count, unit, usize::MAX)?;
        let (least, most) = (self.dims.min_frames(), self.dims.max_frames());
        let frames = task.frames.unwrap_or(0);
        if !(least..=most).contains(&frames) || !frames.is_multiple_of(unit) {
            let allowed = format!("{least} to {most} between context and targets, a multiple of {unit}");
            return Err(wrong("frames", frames, allowed));
        }
        let used = (count / unit * unit).min(most);
        self.frames("targets", &task.targets[..used]).map(Some)
    }

    fn check_audio(&self, audio: &Audio, task: &PromptTask) -> Result<(), EngineError> {
        let known = self.table.audio_codes;
        if let Some(code) = audio.codes.iter().find(|&&code| code as usize >= known) {
            return Err(wrong("audio", code, format!("codes below {known}")));
        }
        if audio.codes.is_empty() {
            return Err(wrong("audio", 0, "one code or more"));
        }
        if !task.context.is_empty() || !task.others.is_empty() || !task.targets.is_empty() {
            return Err(wrong(
                "audio",
                "given",
                "none beside a context, targets or other characters",
            ));
        }
        match task.frames {
            Some(frames) => in_range("frames", frames, 1, self.dims.max_frames()),
            None => Ok(()),
        }
    }

    fn frames(&self, field: &'static str, keys: &[KeyTensors]) -> Result<Frames, EngineError> {
        let wanted = || wrong(field, "without a root or a pose", "keyframes with both");
        Frames::of_keys(keys, self.dims.joints).ok_or_else(wanted)
    }

    /// The first of these tasks that the pack was trained for.
    fn choose(&self, wanted: &[MessageTask]) -> Result<MessageTask, EngineError> {
        let known = &self.table.tasks;
        let found = wanted.iter().find(|task| known.contains(task));
        found.copied().ok_or_else(|| {
            let names = |tasks: &[MessageTask]| {
                tasks
                    .iter()
                    .map(|task| task.name())
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            wrong("kind", names(wanted), names(known))
        })
    }

    fn sampling(&self, task: &SamplingTask) -> Result<Sampling, EngineError> {
        let table = &self.table;
        let sampling = Sampling {
            temperature: task.temperature.unwrap_or(table.temperature),
            top_k: task.top_k.map_or(table.top_k, |top_k| top_k as usize),
            top_p: task.top_p.unwrap_or(table.top_p),
            repetition: task.repetition.unwrap_or(table.repetition),
        };
        let Sampling {
            temperature,
            top_p,
            repetition,
            ..
        } = sampling;
        for (field, found, fits, allowed) in [
            (
                "temperature",
                temperature,
                (0.0..=MAX_TEMPERATURE).contains(&temperature),
                format!("0 to {MAX_TEMPERATURE}"),
            ),
            (
                "top_p",
                top_p,
                top_p > 0.0 && top_p <= 1.0,
                "more than 0 to 1".to_owned(),
            ),
            (
                "repetition",
                repetition,
                (1.0..=MAX_REPETITION).contains(&repetition),
                format!("1 to {MAX_REPETITION}"),
            ),
        ] {
            if !fits {
                return Err(wrong(field, found, allowed));
            }
        }
        Ok(sampling)
    }
}

fn in_range(field: &'static str, found: usize, low: usize, high: usize) -> Result<(), EngineError> {
    match (low..=high).contains(&found) {
        true => Ok(()),
        false if high == usize::MAX => Err(wrong(field, found, format!("{low} or more"))),
        false => Err(wrong(field, found, format!("{low} to {high}"))),
    }
}

fn wrong(field: &'static str, found: impl ToString, allowed: impl Into<String>) -> EngineError {
    EngineError::Task {
        field,
        found: found.to_string(),
        allowed: allowed.into(),
    }
}
