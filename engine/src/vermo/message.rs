//! The tokens of a task: `<BOS> TASK [<INSTRUCTION> text] [<CONDITION> items] [<LEN_n>] <REPLY>`.
//! The reply follows them.

use super::vocabulary::{AGENT_SEP, BOS, CONDITION, GAP, INSTRUCTION, Kind, REPLY, Vocabulary};
use crate::pack::MessageTask;

/// The given material of a message: context of a reply, or material to describe.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Condition {
    /// No condition.
    #[default]
    None,
    /// Motion codes of each agent.
    Motion(Vec<Vec<u32>>),
    /// Motion codes of each agent, before and behind a gap.
    Gap(Vec<[Vec<u32>; 2]>),
    /// Audio codes of the whole message.
    Audio(Vec<u32>),
}

/// A message up to its reply.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// The task's token follows `<BOS>`.
    pub task: MessageTask,
    /// Text pieces of each agent's caption; empty for no instruction.
    pub captions: Vec<Vec<u32>>,
    /// Context of the reply.
    pub condition: Condition,
    /// Tokens of each agent's reply, if fixed.
    pub length: Option<usize>,
}

impl Message {
    /// The kind of tokens in the reply.
    pub fn reply_kind(&self) -> Kind {
        match self.task {
            MessageTask::MotionToText => Kind::Text,
            MessageTask::DanceToMusic | MessageTask::GestureToSpeech => Kind::Audio,
            MessageTask::TextToMotion
            | MessageTask::Prediction
            | MessageTask::Inbetween
            | MessageTask::Continuation
            | MessageTask::Unconditional
            | MessageTask::MusicToDance
            | MessageTask::SpeechToGesture => Kind::Motion,
        }
    }

    /// The message as tokens, up to `<REPLY>`.
    pub fn tokens(&self, vocabulary: &Vocabulary) -> Vec<u32> {
        let mut tokens = vec![BOS, Vocabulary::task(self.task)];
        if !self.captions.is_empty() {
            tokens.push(INSTRUCTION);
            each_agent(&mut tokens, &self.captions, |tokens, caption| {
                tokens.extend(vocabulary.tokens(Kind::Text, caption));
            });
        }
        if self.condition != Condition::None {
            tokens.push(CONDITION);
        }
        match &self.condition {
            Condition::None => {}
            Condition::Motion(agents) => each_agent(&mut tokens, agents, |tokens, codes| {
                tokens.extend(vocabulary.tokens(Kind::Motion, codes));
            }),
            Condition::Gap(agents) => each_agent(&mut tokens, agents, |tokens, [before, behind]| {
                tokens.extend(vocabulary.tokens(Kind::Motion, before));
                tokens.push(GAP);
                tokens.extend(vocabulary.tokens(Kind::Motion, behind));
            }),
            Condition::Audio(codes) => tokens.extend(vocabulary.tokens(Kind::Audio, codes)),
        }
        tokens.extend(self.length.map(|tokens| vocabulary.length(tokens)));
        tokens.push(REPLY);
        tokens
    }
}

/// Writes the items of all agents, separated by [`AGENT_SEP`].
fn each_agent<T>(tokens: &mut Vec<u32>, agents: &[T], write: impl Fn(&mut Vec<u32>, &T)) {
    for (index, agent) in agents.iter().enumerate() {
        if index > 0 {
            tokens.push(AGENT_SEP);
        }
        write(tokens, agent);
    }
}
