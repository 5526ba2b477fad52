//! What becomes of a performance from frame to frame.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::{GlobalRoot, SegmentFrame};

use super::super::policy::MARGIN_FRAMES;
use super::super::{CharacterEvent, Clock, EventKind};
use super::script::BEGIN_FRAMES;
use super::{MAX_PAST_FRAMES, PerformCommand, Performance, PerformanceEnd, Stage, WordsPart, WordsRequest};
use crate::keyframe::{Checked, KeyWriter};
use crate::live::Character;
use crate::primitives::{Locomotion, LocomotionCommand};

/// Most frames beyond the reserve that a performance has in the buffer; others wait beside it.
const FED_FRAMES: i64 = 48;
/// With fewer, more are brought there.
const LOW_FRAMES: i64 = 24;
/// Frames after which a performance has not begun in time: 10 s.
const MAX_WAIT_FRAMES: i64 = 300;
/// Tells the seeds of words from those of plans.
const WORDS_STREAM: u64 = 1 << 63;

impl Character {
    /// The words to ask a pack for, if there are any; to be called after every other call.
    pub fn take_words_request(&mut self) -> Option<WordsRequest> {
        self.words_outbox.take()
    }

    /// Whether words that were asked for by this number may still be of use. Others are to be given
    /// up.
    pub fn wants_words(&self, number: u64) -> bool {
        (self.performance.as_ref()).is_some_and(|it| it.number == number && it.listens())
    }

    /// The command of this number is being performed, or is to be.
    pub fn performs_as(&self, number: u64) -> bool {
        self.performance.as_ref().is_some_and(|it| it.number == number)
    }

    /// Frames of words that were asked for have come. Those that nobody wants any more are ignored.
    pub fn words_arrived(&mut self, number: u64, part: WordsPart, is_last: bool) {
        let now = self.timeline.frame();
        if let Some(performance) = self.performance.as_mut().filter(|it| it.number == number) {
            performance.script.take(part, now, is_last);
            self.feed(now);
        }
    }

    /// No more words will come, though they are not at their end. What has come is still shown.
    pub fn words_failed(&mut self, number: u64, reason: String) {
        let now = self.timeline.frame();
        if let Some(performance) = self.performance.as_mut().filter(|it| it.number == number) {
            performance.script.fail(reason);
            self.feed(now);
        }
    }

    /// It acts out words, or is about to.
    pub(crate) fn performs(&self) -> bool {
        self.performance.is_some()
    }

    /// Takes up a command to perform; whatever else the character does gives way.
    pub(in crate::live) fn take_up_words(&mut self, number: u64, command: PerformCommand, frame: i64) {
        self.stop_performing(frame, PerformanceEnd::Interrupted);
        if let Some((act, mut body)) = self.acting() {
            act.make_way(frame, &mut body);
        }
        self.performance = Some(Performance::new(number, command));
    }

    /// Ends a performance, where there is one; locomotion goes on from wherever it has brought the
    /// character.
    pub(in crate::live) fn stop_performing(&mut self, frame: i64, why: PerformanceEnd) {
        let begun = |it: &Performance| matches!(it.stage, Stage::Playing { .. });
        if self.performance.as_ref().is_some_and(begun) {
            self.walk_on(frame);
        }
        self.end_performance(frame, why);
    }

    /// Something else than locomotion decides about a frame: what has begun ends.
    pub(in crate::live) fn performance_overtaken(&mut self, frame: i64) {
        if self.performance.as_ref().is_some_and(|it| it.stage != Stage::Due) {
            self.end_performance(frame, PerformanceEnd::Interrupted);
        }
    }

    /// Notes the end of a performance. One that is over but for its last frames went through to it.
    fn end_performance(&mut self, frame: i64, why: PerformanceEnd) {
        let Some(performance) = self.performance.take() else {
            return;
        };
        self.words_outbox = None;
        self.timeline.await_words(None);
        let why = match performance.stage {
            Stage::Leaving { .. } if why == PerformanceEnd::Interrupted => PerformanceEnd::Done,
            _ => why,
        };
        self.events.push(CharacterEvent {
            frame: frame.max(0) as u64,
            kind: EventKind::Performed {
                number: performance.number,
                end: why,
            },
        });
    }

    /// Locomotion goes on from the frames in the buffer by the command that held before; where that
    /// was a path, it stands.
    fn walk_on(&mut self, frame: i64) {
        let command = match self.locomotion.path() {
            Some(path) => LocomotionCommand::standing(&path.style),
            None => self.locomotion.command().clone(),
        };
        let heading = self.root_at(frame + self.timeline.look_ahead()).heading;
        self.locomotion = Locomotion::new(frame as u64, heading, self.rig.fps, command);
        self.timeline.command_changed();
        self.unfinished = false;
        if let Some(act) = &mut self.behaviour {
            act.leave_off();
        }
    }

    /// Decides about a frame that is left to a character with a performance.
    pub(in crate::live) fn settle_performance(&mut self, frame: i64, clock: Clock) {
        let Some(performance) = &self.performance else {
            return self.settle_on_foot(frame, clock);
        };
        match performance.stage {
            Stage::Due => self.settle_due(frame, clock),
            Stage::Asked { at, splice } => self.settle_asked(frame, clock, (at, splice)),
            Stage::Playing { .. } => self.settle_playing(frame, clock),
            Stage::Leaving { until } => {
                if frame >= until {
                    self.end_performance(frame, PerformanceEnd::Done);
                }
                self.settle_on_foot(frame, clock);
            }
        }
    }

    /// Asks for words. For a clock that waits, no plan may change the frames that they go on from.
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
        self.words_outbox = Some(WordsRequest {
            number,
            command,
            past,
            seed: random.next_u64(),
            splice_in_frames: (splice - frame) as u32,
        });
        if let Some(performance) = &mut self.performance {
            performance.stage = Stage::Asked { at: frame, splice };
        }
        self.timeline.await_words(Some(splice));
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

    /// Begins where words have come, and goes on as before where they have not.
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
        performance.stage = Stage::Playing { origin };
        let first = performance.script.give(BEGIN_FRAMES, &lies);
        let kind = EventKind::Performing {
            number: performance.number,
            text: performance.command.text.clone(),
            pack: performance.command.pack.clone(),
            unknown_words: performance.command.unknown_words.clone(),
        };
        let frame_number = frame.max(0) as u64;
        self.events.push(CharacterEvent {
            frame: frame_number,
            kind,
        });
        self.timeline.forget_flight();
        self.timeline.put(frame, first.columns(), true);
        self.moved(frame);
        self.settle_playing(frame, clock);
    }

    /// Frames behind `frame` are others than they were.
    fn moved(&mut self, frame: i64) {
        if let Some((act, mut body)) = self.acting() {
            act.moved(frame, &mut body);
        }
    }

    /// Brings frames that have come into the buffer, as far as the cursor will be soon.
    fn feed(&mut self, frame: i64) {
        let reserve = self.reserve();
        let Some(performance) = &mut self.performance else {
            return;
        };
        let Some(lies) = performance.lies() else {
            if performance.script.is_enough(reserve) {
                self.timeline.await_words(None);
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
        self.timeline.await_words((!ends).then_some(lasts));
    }

    /// Shows its frames, until locomotion is to take over.
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
                    performance.stage = Stage::Leaving { until };
                }
            }
        }
        self.settle_on_foot(frame, clock);
    }
}
