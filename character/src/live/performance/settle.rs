//! What a performance does at each frame.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::{GlobalRoot, SegmentFrame};

use super::super::policy::MARGIN_FRAMES;
use super::super::{Clock, EventKind};
use super::script::BEGIN_FRAMES;
use super::{
    MAX_PAST_FRAMES, PerformCommand, Performance, PerformanceEnd, PerformanceState, WordsPart, WordsRequest,
};
use crate::keyframe::{Checked, KeyWriter};
use crate::live::Character;
use crate::primitives::{Locomotion, LocomotionCommand};

/// Most frames of a performance in the buffer beyond the reserve; more wait in the script.
const FED_FRAMES: i64 = 48;
/// With fewer than this, more frames enter the buffer.
const LOW_FRAMES: i64 = 24;
/// A performance that has not begun after this many frames ends: 10 s.
const MAX_WAIT_FRAMES: i64 = 300;
/// Keeps the random numbers of performances apart from those of plans.
const WORDS_STREAM: u64 = 1 << 63;

impl Character {
    /// The frames to ask a pack of words for. To be called after every other call.
    pub fn take_words_request(&mut self) -> Option<WordsRequest> {
        self.performance.as_mut()?.request.take()
    }

    /// Whether frames for request `number` may still be of use. Otherwise the request is to be
    /// given up.
    pub fn wants_words(&self, number: u64) -> bool {
        (self.performance.as_ref()).is_some_and(|it| it.number == number && it.listens())
    }

    /// Whether the command of this number is being performed, or waits for that.
    pub fn performs_as(&self, number: u64) -> bool {
        self.performance.as_ref().is_some_and(|it| it.number == number)
    }

    /// Takes frames that were asked for. Ignores them if the performance is over.
    pub fn words_arrived(&mut self, number: u64, part: WordsPart, is_last: bool) {
        let now = self.timeline.frame();
        if let Some(performance) = self.performance.as_mut().filter(|it| it.number == number) {
            performance.script.take(part, now, is_last);
            self.feed(now);
        }
    }

    /// Takes the news that no more frames will arrive although the text is not at its end. Frames
    /// that have arrived are still shown.
    pub fn words_failed(&mut self, number: u64, reason: String) {
        let now = self.timeline.frame();
        if let Some(performance) = self.performance.as_mut().filter(|it| it.number == number) {
            performance.script.fail(reason);
            self.feed(now);
        }
    }

    /// Whether a performance is under way, or waits to begin.
    pub(crate) fn performs(&self) -> bool {
        self.performance.is_some()
    }

    /// Takes up a command to perform. Everything else that the character does gives way.
    pub(in crate::live) fn take_up_words(&mut self, number: u64, command: PerformCommand, frame: i64) {
        self.stop_performing(frame, PerformanceEnd::Interrupted);
        if let Some((behaviour, mut parts)) = self.acting() {
            behaviour.make_way(frame, &mut parts);
        }
        self.performance = Some(Performance::new(number, command));
    }

    /// Ends a performance, if there is one. Locomotion goes on from wherever the performance
    /// brought the character.
    pub(in crate::live) fn stop_performing(&mut self, frame: i64, why: PerformanceEnd) {
        let begun = |it: &Performance| matches!(it.state, PerformanceState::Playing { .. });
        if self.performance.as_ref().is_some_and(begun) {
            self.walk_on(frame);
        }
        self.end_performance(frame, why);
    }

    /// Ends a performance that has been asked for, because something else decides about a frame.
    pub(in crate::live) fn performance_overtaken(&mut self, frame: i64) {
        if self
            .performance
            .as_ref()
            .is_some_and(|it| it.state != PerformanceState::Due)
        {
            self.end_performance(frame, PerformanceEnd::Interrupted);
        }
    }

    /// Notes the end of a performance. If only its last frames are left, it is done.
    fn end_performance(&mut self, frame: i64, why: PerformanceEnd) {
        let Some(performance) = self.performance.take() else {
            return;
        };
        let why = match performance.state {
            PerformanceState::Leaving { .. } if why == PerformanceEnd::Interrupted => PerformanceEnd::Done,
            _ => why,
        };
        self.events.push(
            frame,
            EventKind::Performed {
                number: performance.number,
                end: why,
            },
        );
    }

    /// Has locomotion go on from the frames in the buffer, by the command that held before. If that
    /// was a path, the character stands.
    fn walk_on(&mut self, frame: i64) {
        let command = match self.locomotion.path() {
            Some(path) => LocomotionCommand::standing(&path.style),
            None => self.locomotion.command().clone(),
        };
        let heading = self.root_at(frame + self.timeline.look_ahead()).heading;
        self.locomotion = Locomotion::new(frame as u64, heading, self.rig.fps, command);
        self.timeline.command_changed();
        self.planning.forget_turn();
        if let Some(behaviour) = &mut self.behaviour {
            behaviour.leave_off();
        }
    }

    /// Decides about a frame that its behaviour leaves to the character's performance or
    /// locomotion.
    pub(in crate::live) fn settle_performance(&mut self, frame: i64, clock: Clock) {
        let Some(performance) = &self.performance else {
            return self.settle_on_foot(frame, clock);
        };
        match performance.state {
            PerformanceState::Due => self.settle_due(frame, clock),
            PerformanceState::Asked { at, splice } => self.settle_asked(frame, clock, (at, splice)),
            PerformanceState::Playing { .. } => self.settle_playing(frame, clock),
            PerformanceState::Leaving { until } => {
                if frame >= until {
                    self.end_performance(frame, PerformanceEnd::Done);
                }
                self.settle_on_foot(frame, clock);
            }
        }
    }

    /// Asks for frames. On a clock that waits, no plan may change the frames that they start from.
    fn settle_due(&mut self, frame: i64, clock: Clock) {
        match clock {
            Clock::Waits => {
                self.timeline.settle_for(None);
                if self.timeline.is_free() {
                    self.ask_for_words(frame);
                }
            }
            Clock::Runs => {
                self.ask_for_words(frame);
                self.settle_on_foot(frame, clock);
            }
        }
    }

    fn ask_for_words(&mut self, frame: i64) {
        let splice = self.timeline.soonest(frame);
        let Some(performance) = &self.performance else {
            return;
        };
        let (number, command) = (performance.number, performance.command.clone());
        let mut random = ChaCha8Rng::seed_from_u64(self.options.seed);
        random.set_stream(WORDS_STREAM | number);
        let past = self.past(splice, command.past_frames.min(MAX_PAST_FRAMES));
        if let Some(performance) = &mut self.performance {
            performance.request = Some(WordsRequest {
                number,
                command,
                past,
                seed: random.next_u64(),
                splice_in_frames: (splice - frame) as u32,
            });
            performance.state = PerformanceState::Asked { at: frame, splice };
            performance.barrier = Some(splice);
        }
    }

    /// The last `count` frames up to `splice`, in the segment frame of the last.
    fn past(&self, splice: i64, count: u32) -> Vec<troupe_motion::model::KeyTensors> {
        let buffer = self.timeline.buffer();
        let frames = splice + 1 - i64::from(count)..=splice;
        let key = |frame| {
            Checked::of(
                Some(self.root_at(frame)),
                None,
                None,
                Some(buffer.pose(frame).to_vec()),
            )
        };
        let keys: Vec<Checked> = frames.map(key).collect();
        let frame = SegmentFrame::from_root(self.root_at(splice));
        KeyWriter::new(&self.rig.skeleton, self.rig.fps).write(&frame, &keys)
    }

    /// Root of a frame of the buffer, with its heading.
    fn root_at(&self, frame: i64) -> GlobalRoot {
        let buffer = self.timeline.buffer();
        let pelvis = buffer.pose(frame).first().copied().unwrap_or_default();
        GlobalRoot::of_pose(buffer.root(frame), pelvis, self.rig.skeleton.left_axis)
    }

    /// Begins if enough frames have arrived, and otherwise goes on as before.
    fn settle_asked(&mut self, frame: i64, clock: Clock, (at, splice): (i64, i64)) {
        let reserve = self.reserve();
        let Some(Performance { script, .. }) = &mut self.performance else {
            return;
        };
        let may_begin = match clock {
            Clock::Waits => script.is_enough(reserve),
            Clock::Runs => script.will_last(at, reserve),
        };
        let nothing_comes = script.is_whole() && script.is_empty();
        if nothing_comes {
            let why = script.take_failure();
            let why = why.unwrap_or_else(|| "the pack gave no frames".to_owned());
            self.end_performance(frame, PerformanceEnd::Failed(why));
        } else if may_begin && frame >= splice {
            return self.begin_performing(frame, clock);
        } else if frame - at >= MAX_WAIT_FRAMES && clock == Clock::Runs {
            self.end_performance(frame, PerformanceEnd::Late);
        }
        match clock {
            Clock::Waits if self.performs() => drop(self.timeline.settle_for(None)),
            _ => self.settle_on_foot(frame, clock),
        }
    }

    /// Frames that must be in the buffer for locomotion to take over in time.
    fn reserve(&self) -> i64 {
        self.timeline.ahead() + MARGIN_FRAMES
    }

    fn begin_performing(&mut self, frame: i64, clock: Clock) {
        let origin = self.root_at(frame);
        let lies = SegmentFrame::from_root(origin);
        let Some(performance) = &mut self.performance else {
            return;
        };
        performance.state = PerformanceState::Playing { origin };
        let first = performance.script.give(BEGIN_FRAMES, &lies);
        let kind = EventKind::Performing {
            number: performance.number,
            text: performance.command.text.clone(),
            pack: performance.command.pack.clone(),
            unknown_words: performance.command.unknown_words.clone(),
        };
        self.events.push(frame, kind);
        self.timeline.forget_flight();
        self.timeline.put(frame, first.columns(), true);
        self.moved(frame);
        self.settle_playing(frame, clock);
    }

    /// Notes that the frames after `frame` have changed.
    fn moved(&mut self, frame: i64) {
        if let Some((behaviour, mut parts)) = self.acting() {
            behaviour.moved(frame, &mut parts);
        }
    }

    /// Moves frames that have arrived into the buffer, as far as the cursor needs them soon.
    fn feed(&mut self, frame: i64) {
        let reserve = self.reserve();
        let Some(performance) = &mut self.performance else {
            return;
        };
        let Some(lies) = performance.lies() else {
            if performance.script.is_enough(reserve) {
                performance.barrier = None;
            }
            return;
        };
        let last = self.timeline.buffer().last();
        let spare = last - frame - reserve;
        let ends = performance.script.is_whole();
        if spare < LOW_FRAMES && !performance.script.is_empty() {
            let part = performance.script.give((FED_FRAMES - spare) as usize, &lies);
            self.timeline.extend(part.columns());
            self.moved(last);
        }
        let lasts = self.timeline.buffer().last() - reserve;
        if let Some(performance) = &mut self.performance {
            performance.barrier = (!ends).then_some(lasts);
        }
    }

    /// Shows the performance until locomotion is to take over.
    fn settle_playing(&mut self, frame: i64, clock: Clock) {
        self.feed(frame);
        let left = self.timeline.buffer().last() - frame;
        let reserve = self.reserve();
        let Some(Performance { script, .. }) = &mut self.performance else {
            return;
        };
        if left > reserve || !script.is_empty() || clock == Clock::Waits && !script.is_whole() {
            self.timeline.settle_for(None);
            return;
        }
        let end = match (script.is_whole(), script.take_failure()) {
            (_, Some(why)) => Some(PerformanceEnd::Failed(why)),
            (false, None) => Some(PerformanceEnd::Late),
            (true, None) => None,
        };
        self.walk_on(frame);
        match end {
            Some(end) => self.end_performance(frame, end),
            None => {
                let until = (frame + left - MARGIN_FRAMES).max(frame + 1);
                if let Some(performance) = &mut self.performance {
                    performance.state = PerformanceState::Leaving { until };
                }
            }
        }
        self.settle_on_foot(frame, clock);
    }
}
