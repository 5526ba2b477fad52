//! One job: its message, and the output of its tokens.

use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::model::{DescribeTask, Motion, Output, PromptTask, Rig};

use super::flow::Flow;
use super::motion::{BodyFrame, Frames, Stitcher, first_body};
use super::network::Networks;
use super::plan::{Planner, Share, Speech};
use super::sequences::Prompt;
use super::vocabulary::{AGENT_SEP, Kind};
use super::windows::Windows;
use crate::EngineError;
use crate::generator::JobId;
use crate::pack::{FRAMES_PER_TOKEN, LANGUAGE_FILE};
use crate::random::step64;

/// Frames of a token depend on this number of tokens on either side. The same
/// number is held back while more may follow.
const HELD_BACK: usize = 2;
/// Tokens before a window that are decoded together with it.
const LEAD: usize = 4;
/// Tokens of the first part of a motion.
const FIRST_PART: usize = 4;
/// Tokens of the later parts of a motion. Each part decodes tokens of the part before again, so
/// long parts are cheaper.
const LATER_PART: usize = 8;
/// Distance between characters that begin without a context, metres.
const SIDE_BY_SIDE_M: f32 = 1.0;

/// What a job does in its next step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// It encodes its motion and writes its message.
    Prompt,
    /// The model writes its reply.
    Reply,
    /// Its reply is complete.
    Whole,
}

/// A job in progress.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) id: JobId,
    pub(super) phase: Phase,
    speech: Speech,
    seed: u64,
    /// Tokens that were drawn in earlier replies of the job.
    drawn: u64,
    reply: Answer,
}

/// The output that a reply becomes.
#[derive(Debug)]
enum Answer {
    Motion(Box<Agents>),
    Text {
        pieces: Vec<u32>,
        /// Bytes of the text that were given out.
        sent: usize,
    },
    Audio {
        codes: Vec<u32>,
        sent: usize,
    },
}

/// A motion in progress.
#[derive(Debug)]
struct Agents {
    agents: Vec<Agent>,
    /// Index of the agent whose tokens the model is writing.
    current: usize,
    in_parts: bool,
    flow_steps: u32,
    seed: u64,
    /// The motion behind the gap: its codes, and its first frame.
    behind: Option<(Vec<u32>, BodyFrame)>,
}

/// A character of a motion.
#[derive(Debug)]
struct Agent {
    stitcher: Stitcher,
    /// Codes of the given motion, then those of the reply.
    codes: Vec<u32>,
    /// Number of codes of the given motion.
    given: usize,
    /// Number of the reply's codes whose frames were given out.
    sent: usize,
    /// Frames that are still to be made, if the task fixes their number.
    left: Option<usize>,
    flow: Option<Flow>,
}

impl Job {
    /// A job that makes motion from a prompt.
    pub(super) fn prompt(
        id: JobId,
        task: &PromptTask,
        planner: &Planner,
        rig: &Arc<Rig>,
    ) -> Result<Self, EngineError> {
        let speech = planner.prompt(task)?;
        let keep = planner.dims.context_frames;
        let agents = (0..speech.agents).map(|index| {
            let past = speech.given.get(index);
            let start = Vec3::new(SIDE_BY_SIDE_M * index as f32, 0.0, 0.0);
            Agent {
                stitcher: Stitcher::new(rig, past.unwrap_or(&Frames::default()), start, keep),
                codes: Vec::new(),
                given: 0,
                sent: 0,
                left: task.frames,
                flow: None,
            }
        });
        let target = speech
            .behind
            .as_ref()
            .and_then(|frames| first_body(frames, rig.dims.joints));
        let motion = Agents {
            agents: agents.collect(),
            current: 0,
            in_parts: task.in_parts && task.flow_steps == 0 && target.is_none(),
            flow_steps: task.flow_steps,
            seed: task.seed,
            behind: target.map(|body| (Vec::new(), body)),
        };
        Ok(Self {
            id,
            phase: Phase::Prompt,
            speech,
            seed: task.seed,
            drawn: 0,
            reply: Answer::Motion(Box::new(motion)),
        })
    }

    /// A job that describes a motion.
    pub(super) fn describe(id: JobId, task: &DescribeTask, planner: &Planner) -> Result<Self, EngineError> {
        let speech = planner.describe(task)?;
        let reply = match planner.share(&speech, None)?.rules.kind {
            Kind::Audio => Answer::Audio {
                codes: Vec::new(),
                sent: 0,
            },
            Kind::Text | Kind::Motion => Answer::Text {
                pieces: Vec::new(),
                sent: 0,
            },
        };
        Ok(Self {
            id,
            phase: Phase::Prompt,
            speech,
            seed: task.seed,
            drawn: 0,
            reply,
        })
    }

    /// Encodes the motion that the message contains, and writes the message.
    pub(super) fn write_prompt(
        &mut self,
        planner: &Planner,
        networks: &mut dyn Networks,
    ) -> Result<Prompt, EngineError> {
        let frames = match &self.reply {
            Answer::Motion(motion) => motion.agents.first().and_then(|agent| agent.left),
            Answer::Text { .. } | Answer::Audio { .. } => None,
        };
        let Share { length, given, rules } = planner.share(&self.speech, frames)?;
        let latest = |codes: Vec<u32>| codes[codes.len().saturating_sub(given)..].to_vec();
        let encoded: Vec<Vec<u32>> = (self.speech.given.iter())
            .map(|frames| networks.encode(frames).map(latest))
            .collect::<Result<_, _>>()?;
        let behind = self
            .speech
            .behind
            .as_ref()
            .map(|frames| networks.encode(frames))
            .transpose()?;
        let message = planner.message(&self.speech, &encoded, behind.as_ref(), length);
        if let Answer::Motion(motion) = &mut self.reply {
            motion.begin(&encoded, behind);
        }
        self.phase = Phase::Reply;
        Ok(Prompt {
            tokens: message.tokens(&planner.vocabulary),
            guides: planner.guides(&self.speech, length),
            rules,
            sampling: self.speech.sampling,
            seed: self.seed,
            drawn: self.drawn,
        })
    }

    /// Whether the next step is one of the flow decoder.
    pub(super) fn flows(&self) -> bool {
        match &self.reply {
            Answer::Motion(motion) => self.phase == Phase::Whole && motion.flow_steps > 0,
            Answer::Text { .. } | Answer::Audio { .. } => false,
        }
    }

    /// Takes one token of the reply.
    pub(super) fn receive(&mut self, planner: &Planner, token: u32) {
        self.drawn += 1;
        let code = |kind| planner.vocabulary.code(kind, token);
        match &mut self.reply {
            Answer::Motion(motion) if token == AGENT_SEP => motion.current += 1,
            Answer::Motion(motion) => {
                let current = motion.current;
                if let (Some(agent), Some(code)) = (motion.agents.get_mut(current), code(Kind::Motion)) {
                    agent.codes.push(code);
                }
            }
            Answer::Text { pieces, .. } => pieces.extend(code(Kind::Text)),
            Answer::Audio { codes, .. } => codes.extend(code(Kind::Audio)),
        }
    }

    /// Adds the windows that must be decoded for the frames that can be given out now. A job of the
    /// flow decoder takes one step of it instead.
    pub(super) fn want(
        &mut self,
        networks: &mut dyn Networks,
        windows: &mut Windows,
    ) -> Result<(), EngineError> {
        let is_whole = self.phase == Phase::Whole;
        let Answer::Motion(motion) = &mut self.reply else {
            return Ok(());
        };
        if is_whole && motion.flow_steps > 0 {
            motion.flow(networks)
        } else {
            motion.want(self.id, is_whole, windows);
            Ok(())
        }
    }

    /// The output that is ready, from decoded windows; [`Taken::Last`] is the last one. A motion
    /// that continues writes another message afterwards.
    pub(super) fn take(&mut self, planner: &Planner, windows: &mut Windows) -> Result<Taken, EngineError> {
        let is_whole = self.phase == Phase::Whole;
        match &mut self.reply {
            Answer::Text { pieces, sent } => {
                let problem = |problem| EngineError::Network {
                    file: LANGUAGE_FILE,
                    problem,
                };
                let text = planner.lexicon.text(pieces).map_err(problem)?;
                // A text piece may end inside a character.
                let ready = if is_whole {
                    text.len()
                } else {
                    text.trim_end_matches('\u{fffd}').len()
                };
                let fresh = text.get(*sent..ready).unwrap_or_default();
                *sent = ready.max(*sent);
                let is_empty = fresh.is_empty();
                Ok(Taken::of(Output::Text(fresh.to_owned()), is_empty, is_whole))
            }
            Answer::Audio { codes, sent } => {
                let fresh = codes[*sent..].to_vec();
                *sent = codes.len();
                let is_empty = fresh.is_empty();
                Ok(Taken::of(Output::Audio(fresh), is_empty, is_whole))
            }
            Answer::Motion(motion) => {
                if !motion.is_ready(is_whole) {
                    return Ok(Taken::Nothing);
                }
                let motions = motion.take(self.id, is_whole, windows);
                let goes_on = is_whole
                    && motion
                        .agents
                        .iter()
                        .any(|agent| agent.left.is_some_and(|left| left > 0));
                if goes_on {
                    let given = motion.agents.iter().map(|agent| agent.stitcher.past()).collect();
                    self.speech = planner.next(&self.speech, given)?;
                    // The token for the end was drawn too.
                    self.drawn += 1;
                    self.phase = Phase::Prompt;
                }
                let is_empty = motions.iter().all(|motion| motion.frames() == 0);
                Ok(Taken::of(output(motions), is_empty, is_whole && !goes_on))
            }
        }
    }
}

/// Output of a job in one step.
#[derive(Debug)]
pub(super) enum Taken {
    /// No output is ready.
    Nothing,
    /// More output follows.
    Part(Output),
    /// The job ends with this output.
    Last(Output),
}

impl Taken {
    fn of(output: Output, is_empty: bool, is_last: bool) -> Self {
        match (is_last, is_empty) {
            (true, _) => Self::Last(output),
            (false, true) => Self::Nothing,
            (false, false) => Self::Part(output),
        }
    }
}

/// [`Output::Motion`] for one character, [`Output::Motions`] for several.
fn output(mut motions: Vec<Motion>) -> Output {
    match motions.len() {
        0 | 1 => Output::Motion(motions.pop().unwrap_or_default()),
        _ => Output::Motions(motions),
    }
}

impl Agents {
    /// Begins a new reply, after given motion with these codes.
    fn begin(&mut self, given: &[Vec<u32>], behind: Option<Vec<u32>>) {
        self.current = 0;
        for (index, agent) in self.agents.iter_mut().enumerate() {
            agent.codes = given.get(index).cloned().unwrap_or_default();
            agent.given = agent.codes.len();
            agent.sent = 0;
            agent.flow = None;
        }
        if let (Some((codes, _)), Some(behind)) = (&mut self.behind, behind) {
            *codes = behind;
        }
    }

    /// Takes a step of the flow decoder for the first agent that is not done.
    fn flow(&mut self, networks: &mut dyn Networks) -> Result<(), EngineError> {
        let (seed, steps) = (self.seed, self.flow_steps);
        let behind = self.behind.as_ref().map_or(&[][..], |(codes, _)| codes);
        for (index, agent) in self.agents.iter_mut().enumerate() {
            let codes = &agent.codes;
            let new = || Flow::new([codes, behind].concat(), step64(seed, index as u64), steps);
            let flow = agent.flow.get_or_insert_with(new);
            if !flow.is_done() {
                return flow.step(networks);
            }
        }
        Ok(())
    }

    /// Whether frames can be given out now.
    fn is_ready(&self, is_whole: bool) -> bool {
        let is_made = |agent: &Agent| agent.flow.as_ref().is_some_and(Flow::is_done);
        match (is_whole, self.flow_steps) {
            (true, 0) => true,
            (true, _) => self.agents.iter().all(is_made),
            (false, _) => self.in_parts,
        }
    }

    /// Adds the window of each agent that has frames to give out now.
    fn want(&self, id: JobId, is_whole: bool, windows: &mut Windows) {
        if !self.is_ready(is_whole) {
            return;
        }
        let behind = self.behind.as_ref().map_or(&[][..], |(codes, _)| codes);
        for (index, agent) in self.agents.iter().enumerate() {
            if agent.ready(is_whole || index < self.current).is_some() {
                windows.add(id, index, [&agent.codes[agent.lead()..], behind].concat());
            }
        }
    }

    /// The frames of each agent that are ready.
    fn take(&mut self, id: JobId, is_whole: bool, windows: &mut Windows) -> Vec<Motion> {
        let Self {
            agents,
            current,
            behind,
            ..
        } = self;
        let target = behind.as_ref().map(|(_, body)| body);
        let agents = agents.iter_mut().enumerate();
        agents
            .map(|(index, agent)| {
                let window = windows.take(id, index);
                agent.take(is_whole || index < *current, window, target)
            })
            .collect()
    }
}

impl Agent {
    /// How many of the reply's tokens are ready: all except those held back, or all if the reply
    /// `ends`. None if they are too few for a part.
    fn ready(&self, ends: bool) -> Option<usize> {
        let written = self.codes.len() - self.given;
        let held_back = if ends { 0 } else { HELD_BACK };
        let least = match (ends, self.sent) {
            (true, _) => 1,
            (false, 0) => FIRST_PART,
            (false, _) => LATER_PART,
        };
        let ready = written.saturating_sub(held_back);
        (ready >= self.sent + least).then_some(ready)
    }

    /// Index of the first token that is decoded for the next part.
    fn lead(&self) -> usize {
        (self.given + self.sent).saturating_sub(LEAD)
    }

    /// The frames of the tokens that are ready, out of their decoded window.
    fn take(&mut self, ends: bool, window: Option<Frames>, target: Option<&BodyFrame>) -> Motion {
        let Some(ready) = self.ready(ends) else {
            return Motion::default();
        };
        // The flow decoder has made all frames at once.
        let (lead, window) = match (&self.flow, window) {
            (Some(flow), _) => (0, flow.frames().clone()),
            (None, Some(window)) => (self.lead(), window),
            (None, None) => return Motion::default(),
        };
        let first = (self.given + self.sent - lead) * FRAMES_PER_TOKEN;
        let made = (ready - self.sent) * FRAMES_PER_TOKEN;
        let wanted = self.left.map_or(made, |left| left.min(made));
        self.sent = ready;
        if let Some(left) = &mut self.left {
            *left -= wanted;
        }
        self.stitcher.join(&window, first, first + wanted, target)
    }
}
