//! Live characters with this client's clock: each call steps a group of characters by one frame.

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until};
use troupe_client::KeyedChannel;
use troupe_proto::v1;
use v1::sessions_client::SessionsClient;

use super::connect::MOST_ANSWER_BYTES;
use super::frames::Block;
use super::groups::Groups;
use super::grpc::from_status;
use super::route::GroupRoute;
use super::wander::Walker;
use crate::failure::Failure;
use crate::measure::{Answer, Call, Outcome, Recorder};
use crate::plan::{Plan, Share, Stepping};

/// Pause after a step that failed.
const BACK_OFF: Duration = Duration::from_millis(10);

/// A share of the characters, ready to be stepped.
#[derive(Debug)]
pub struct Step {
    stepping: Stepping,
    timeout: Duration,
    groups: Groups,
}

impl Step {
    pub(super) async fn prepare(plan: &Plan, stepping: &Stepping, share: Share) -> Result<Self, Failure> {
        Ok(Self {
            stepping: stepping.clone(),
            timeout: plan.timeout(),
            groups: Groups::open(plan, &stepping.live, share).await?,
        })
    }

    pub(super) async fn carry_out(self, recorder: &Arc<Recorder>) -> Result<(), Failure> {
        self.groups.count(recorder);
        let Groups {
            opened,
            joints,
            groups,
        } = self.groups;
        let mut tasks = JoinSet::new();
        let count = u32::try_from(groups.len()).unwrap_or(u32::MAX);
        for (nth, group) in (0_u32..).zip(groups) {
            let (channel, route, walkers) = (group.channel, group.route, group.walkers);
            let period = Duration::from_secs(1) / self.stepping.live.rate_hz;
            let group = Group {
                recorder: recorder.clone(),
                rate_hz: self.stepping.live.rate_hz,
                compact: self.stepping.live.compact,
                period,
                phase: period * nth / count.max(1),
                paced: self.stepping.paced,
                timeout: self.timeout,
                joints,
                verify_every: self.stepping.live.verify_every.into(),
                ids: walkers.iter().map(|w| w.id.clone()).collect(),
                walkers,
            };
            tasks.spawn(async move { group.run(channel, &route).await });
        }
        opened.see_through(tasks, recorder).await
    }
}

/// Characters that are stepped together.
struct Group {
    recorder: Arc<Recorder>,
    rate_hz: u32,
    compact: bool,
    period: Duration,
    /// Offset of the group's steps within a period, so that groups do not step at the same time.
    phase: Duration,
    paced: bool,
    timeout: Duration,
    joints: usize,
    verify_every: u64,
    ids: Vec<String>,
    walkers: Vec<Walker>,
}

impl Group {
    async fn run(mut self, channel: KeyedChannel, route: &GroupRoute) {
        let mut rpc = SessionsClient::new(channel).max_decoding_message_size(MOST_ANSWER_BYTES);
        let (start, end) = (self.recorder.clock().start(), self.recorder.clock().end());
        let mut due = start + self.phase;
        sleep_until(due).await;
        for nth in 0.. {
            if self.paced {
                sleep_until(due).await;
            } else {
                due = Instant::now();
            }
            if due >= end {
                return;
            }
            let sent = Instant::now();
            let request = route.call(self.request(sent));
            self.recorder.sent(sent);
            let outcome = match tokio::time::timeout(self.timeout, rpc.step(request)).await {
                Ok(Ok(answer)) => self.read(&answer.into_inner(), nth),
                Ok(Err(status)) => from_status(&status),
                Err(_) => Outcome::Failed {
                    code: "TIMED_OUT".into(),
                    message: format!("no answer within {:?}", self.timeout),
                },
            };
            let right = matches!(outcome, Outcome::Right(_));
            let done = Instant::now();
            self.recorder.done(&Call {
                due,
                sent,
                done,
                outcome,
            });
            if done.saturating_duration_since(due) > self.period && self.recorder.clock().is_measured(due) {
                self.recorder.live(|live| live.late_ticks += 1);
            }
            if !right {
                tokio::time::sleep(BACK_OFF).await;
            }
            due += self.period;
        }
    }

    fn request(&mut self, now: Instant) -> v1::StepRequest {
        let at = now.saturating_duration_since(self.recorder.clock().start());
        let commands = self.walkers.iter_mut().filter_map(|w| w.decide(at, now));
        let commands = commands.collect::<Vec<_>>();
        if self.recorder.clock().is_measured(now) {
            let count = commands.len() as u64;
            self.recorder.live(|live| live.commands += count);
        }
        let encoding = if self.compact {
            v1::Encoding::Compact
        } else {
            v1::Encoding::F32
        };
        v1::StepRequest {
            session_ids: self.ids.clone(),
            frames: 1,
            rate_hz: self.rate_hz,
            commands,
            encoding: encoding.into(),
            ..v1::StepRequest::default()
        }
    }

    fn read(&mut self, answer: &v1::StepResponse, nth: u64) -> Outcome {
        let now = Instant::now();
        let wrong = |code: &'static str, message: String| Outcome::Failed {
            code: code.into(),
            message,
        };
        if let Some(problem) = answer.problems.iter().find_map(|p| p.problem.as_ref()) {
            return wrong("SESSION_LOST", problem.message.clone());
        }
        let whole = self.verify_every > 0 && nth.is_multiple_of(self.verify_every);
        let (mut here, mut bytes) = (0, 0);
        for block in &answer.blocks {
            let block = match Block::read(block, self.joints) {
                Ok(block) => block,
                Err(why) => return wrong("WRONG_FRAMES", why.to_string()),
            };
            if let Err(why) = if whole { block.check() } else { Ok(()) } {
                return wrong("WRONG_FRAMES", why.to_string());
            }
            bytes += block.bytes();
            for (slot, place) in block.places() {
                here += 1;
                let Some(walker) = self.walkers.get_mut(slot as usize) else {
                    continue;
                };
                if let Some(after) = walker.seen(place, self.period.as_secs_f32(), now)
                    && self.recorder.clock().is_measured(now)
                {
                    self.recorder.live(|live| live.command_to_motion.record(after));
                }
            }
        }
        if whole {
            self.recorder.verified(here);
        }
        if here != self.ids.len() as u64 {
            return wrong(
                "WRONG_CHARACTERS",
                format!("{here} characters instead of {}", self.ids.len()),
            );
        }
        Outcome::Right(Answer {
            characters: u32::try_from(here).unwrap_or(u32::MAX),
            frames: here,
            bytes,
            timing: None,
        })
    }
}
