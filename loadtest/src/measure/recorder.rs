//! Records every answer during the load.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::time::Instant;

use super::live::LiveHarvest;
use super::tally::{Call, FineBin, Harvest, Outcome, Second, Tally};
use crate::arrivals::Stages;

/// A request that is sent more than this after it was due counts as late.
const ON_TIME: Duration = Duration::from_millis(1);
/// Maximum number of distinct codes. Further codes are counted together.
const CODES: usize = 32;

/// The times of a load: its start, and its measured part.
#[derive(Debug, Clone)]
pub struct Clock {
    start: Instant,
    warmup: Duration,
    measured: Duration,
    /// Stages of the measured time, if it has several.
    stages: Option<Stages>,
    fine: bool,
}

impl Clock {
    /// Makes the clock of a load that begins at `start`. The time after the warm-up is measured.
    pub fn new(start: Instant, warmup: Duration, measured: Duration) -> Self {
        Self {
            start,
            warmup,
            measured,
            stages: None,
            fine: false,
        }
    }

    /// Counts the stages after the warm-up separately too.
    #[must_use]
    pub fn stages(mut self, stages: &Stages) -> Self {
        self.stages = (stages.count() > 1).then(|| stages.clone());
        self
    }

    /// Records latencies by tenths of a second too.
    #[must_use]
    pub fn fine(mut self, fine: bool) -> Self {
        self.fine = fine;
        self
    }

    /// Start of the load.
    pub fn start(&self) -> Instant {
        self.start
    }

    /// Start of the measured time.
    pub fn measured_from(&self) -> Instant {
        self.start + self.warmup
    }

    /// End of the load.
    pub fn end(&self) -> Instant {
        self.start + self.warmup + self.measured
    }

    /// Length of the measured time.
    pub fn measured(&self) -> Duration {
        self.measured
    }

    /// Length of the warm-up.
    pub fn warmup(&self) -> Duration {
        self.warmup
    }

    /// Whether `at` lies in the measured time.
    pub fn is_measured(&self, at: Instant) -> bool {
        at >= self.measured_from() && at < self.end()
    }

    /// Whole seconds from the start to `at`.
    fn second(&self, at: Instant) -> usize {
        let seconds = at.saturating_duration_since(self.start).as_secs();
        usize::try_from(seconds).unwrap_or(usize::MAX)
    }

    fn stage(&self, at: Instant) -> Option<usize> {
        let into = at.checked_duration_since(self.measured_from())?;
        self.stages.as_ref()?.stage_at(into.as_secs_f64())
    }
}

/// Progress of the load in its last whole second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Pulse {
    /// Right answers or ticks of the last whole second.
    pub right: u64,
    /// Refusals of that second.
    pub refused: u64,
    /// Failures of that second.
    pub failed: u64,
    /// Requests that this client dropped in that second.
    pub dropped: u64,
    /// Frames of that second.
    pub frames: u64,
    /// Frames of characters that slowed down in that second.
    pub underruns: u64,
    /// Median of the latencies in that second, milliseconds.
    pub p50_ms: f64,
    /// 99th percentile of the latencies in that second, milliseconds.
    pub p99_ms: f64,
    /// Requests in flight now.
    pub in_flight: u64,
}

/// Records every answer. All tasks of a process share one recorder. Recording an answer takes well
/// under a microsecond.
#[derive(Debug)]
pub struct Recorder {
    clock: Clock,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    harvest: Harvest,
    in_flight: u64,
}

/// Number of seconds after the load's end that are counted separately. Later answers count in the
/// last of them, so they take no memory.
const SECONDS_AFTER: usize = 120;

impl State {
    fn second(&mut self, clock: &Clock, at: Instant) -> &mut Second {
        let most = clock.second(clock.end()) + SECONDS_AFTER;
        let index = clock.second(at).min(most);
        let seconds = &mut self.harvest.seconds;
        if seconds.len() <= index {
            seconds.resize_with(index + 1, Second::default);
        }
        &mut seconds[index]
    }

    /// Records the outcome of a request in the tenth of a second in which it was due. `latency` is
    /// `None` without a right answer.
    fn fine(&mut self, clock: &Clock, due: Instant, latency: Option<Duration>) {
        if !clock.fine || due >= clock.end() {
            return;
        }
        let bin = due.saturating_duration_since(clock.start()).as_millis() / 100;
        let bin = usize::try_from(bin).unwrap_or(usize::MAX);
        let bins = &mut self.harvest.fine;
        if bins.len() <= bin {
            bins.resize_with(bin + 1, FineBin::default);
        }
        match latency {
            Some(latency) => {
                let us = u32::try_from(latency.as_micros()).unwrap_or(u32::MAX);
                bins[bin].latencies_us.push(us);
            }
            None => bins[bin].other += 1,
        }
    }

    fn stage(&mut self, clock: &Clock, at: Instant) -> Option<&mut Tally> {
        let index = clock.stage(at)?;
        let stages = &mut self.harvest.stages;
        if stages.len() <= index {
            stages.resize_with(index + 1, Tally::default);
        }
        stages.get_mut(index)
    }

    fn code(&mut self, code: &str, message: &str) {
        let codes = &mut self.harvest.codes;
        let code = if codes.contains_key(code) || codes.len() < CODES {
            code
        } else {
            "OTHER"
        };
        *codes.entry(code.to_owned()).or_default() += 1;
        if !message.is_empty() && !self.harvest.examples.contains_key(code) {
            let message = message.chars().take(300).collect();
            self.harvest.examples.insert(code.to_owned(), message);
        }
    }
}

impl Recorder {
    /// Makes a recorder for a load with this clock.
    pub fn new(clock: Clock) -> Self {
        Self {
            clock,
            state: Mutex::default(),
        }
    }

    /// The times of the load.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // After a panic the counts may be slightly wrong, but that is better than to lose them.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that a request is about to be sent.
    pub fn sent(&self, at: Instant) {
        let mut state = self.state();
        state.in_flight += 1;
        let now = state.in_flight;
        let second = state.second(&self.clock, at);
        second.in_flight = second.in_flight.max(now);
    }

    /// Records an answer.
    pub fn done(&self, call: &Call) {
        let mut state = self.state();
        state.in_flight = state.in_flight.saturating_sub(1);
        self.note(&mut state, call);
    }

    /// Records a message without a request, such as a tick of a stream. `slowed` of its characters
    /// slowed down.
    pub fn came(&self, call: &Call, slowed: u64) {
        let mut state = self.state();
        self.note(&mut state, call);
        state.second(&self.clock, call.done).underruns += slowed;
    }

    fn note(&self, state: &mut State, call: &Call) {
        state.second(&self.clock, call.done).note(call);
        let right = matches!(call.outcome, Outcome::Right(_));
        let latency = right.then(|| call.done.saturating_duration_since(call.due));
        state.fine(&self.clock, call.due, latency);
        if let (Outcome::Right(answer), true) = (&call.outcome, self.clock.is_measured(call.done)) {
            let done = &mut state.harvest.done;
            done.requests += 1;
            done.characters += u64::from(answer.characters);
            done.frames += answer.frames;
            done.bytes += answer.bytes;
        }
        if !self.clock.is_measured(call.due) {
            return;
        }
        state.harvest.total.note(call);
        if let Some(stage) = state.stage(&self.clock, call.due) {
            stage.note(call);
        }
        match &call.outcome {
            Outcome::Right(answer) => {
                let lag = call.sent.saturating_duration_since(call.due);
                let harvest = &mut state.harvest;
                harvest.send_lag.record(lag);
                harvest.late_sends += u64::from(lag > ON_TIME);
                harvest.on_the_way_us += micros(call.done.saturating_duration_since(call.sent));
                if let Some(timing) = &answer.timing {
                    harvest.timing.add(timing);
                }
            }
            Outcome::Refused(code) => state.code(code, ""),
            Outcome::Failed { code, message } => state.code(code, message),
        }
    }

    /// Records a request that was not sent, because too many were in flight.
    pub fn dropped(&self, due: Instant) {
        let mut state = self.state();
        state.second(&self.clock, due).dropped += 1;
        state.fine(&self.clock, due, None);
        if self.clock.is_measured(due) {
            state.harvest.total.dropped += 1;
            if let Some(stage) = state.stage(&self.clock, due) {
                stage.dropped += 1;
            }
        }
    }

    /// Counts answers that were fully decoded and checked.
    pub fn verified(&self, answers: u64) {
        self.state().harvest.verified += answers;
    }

    /// Records a fault without a request, such as a lost session.
    pub fn fault(&self, code: &str, message: &str) {
        let mut state = self.state();
        state.code(code, message);
        state.harvest.total.failed += 1;
    }

    /// Lets `change` update the counts of live characters.
    pub fn live(&self, change: impl FnOnce(&mut LiveHarvest)) {
        change(self.state().harvest.live.get_or_insert_default());
    }

    /// Progress at the time `at`: the last whole second, and the requests in flight.
    pub fn pulse(&self, at: Instant) -> Pulse {
        let state = self.state();
        let before = self.clock.second(at).checked_sub(1);
        let second = before.and_then(|index| state.harvest.seconds.get(index));
        let in_flight = state.in_flight;
        second.map_or(
            Pulse {
                in_flight,
                ..Pulse::default()
            },
            |of| Pulse {
                right: of.right,
                refused: of.refused,
                failed: of.failed,
                dropped: of.dropped,
                frames: of.frames,
                underruns: of.underruns,
                p50_ms: of.latency.quantile_ms(0.5),
                p99_ms: of.latency.quantile_ms(0.99),
                in_flight,
            },
        )
    }

    /// All records so far.
    pub fn harvest(&self) -> Harvest {
        self.state().harvest.clone()
    }
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}

#[cfg(test)]
#[path = "recorder_tests.rs"]
mod tests;
