//! The motion of one robot as it goes out: windows of the coming second, fifty times a second.
//!
//! The robot plays the frames at its own clock. It looks 45 frames ahead, and starts its playback
//! again if windows do not follow each other as it wants. So each window has the same length and
//! begins one frame after the one before. What comes after its first frames may change from window
//! to window: that is how a command takes effect at once.
//!
//! Frames come from the server for less than a second ahead. Those after them are guesses that slow
//! down. A ramp leads from the server's motion to standing and back. So the robot stands within a
//! second, whether the server answers or not.

use std::collections::VecDeque;

use glam::Quat;
use troupe_motion::robot::ROOT_QPOS;
use troupe_motion::rotation::{align_sign, to_wxyz};

use crate::row::{Row, mix, onward, standing_at, turn, upright};
use crate::wire::{HINGES, Window};

/// Frames of a window: the 46 that the controller reads, and four more, so that messages that are
/// 60 ms late do not stop its playback.
pub const WINDOW: usize = 50;
/// Windows a second, and frames a second.
pub const HZ: u32 = 50;
/// The robot may have played this many frames of a window already, so ramps begin after them.
const PLAYED: u64 = 4;
/// Without new frames from the server for this many ticks, the robot stands.
pub const LATE: u64 = 15;
/// Frames over which frames that differ from guesses fade in.
const FADE: u64 = 10;

/// A change between the server's motion (0) and standing (1).
#[derive(Debug, Clone, Copy)]
struct Ramp {
    start: u64,
    frames: u64,
    from: f32,
    to: f32,
}

impl Ramp {
    fn weight(&self, frame: u64) -> f32 {
        let done = frame.saturating_sub(self.start) as f32 / self.frames as f32;
        let x = done.min(1.0);
        self.from + (self.to - self.from) * x * x * (3.0 - 2.0 * x)
    }
}

/// How a robot comes to stand: ticks until it begins to, and ticks that it takes. Both end within a
/// second of the cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Halt {
    delay: u64,
    frames: u64,
}

impl Halt {
    /// The server stops too: most of the way is its own.
    pub const WITH_SERVER: Self = Self {
        delay: 10,
        frames: 22,
    };
    /// No word from the server for [`LATE`] ticks.
    pub const ALONE: Self = Self { delay: 0, frames: 24 };
}

/// Frames of a robot's past, present and future.
#[derive(Debug)]
pub struct Playback {
    stand: Row,
    limits: Vec<(f32, f32)>,
    /// The first one is before the next window, for its velocities.
    frames: VecDeque<Row>,
    /// Index of the first frame of the next window.
    next: u64,
    /// Frames from this index on are guesses.
    known: u64,
    /// `next` when frames came last.
    fresh: u64,
    /// In the order of their starts; each counts from its start on.
    ramps: VecDeque<Ramp>,
    /// Rotation of the pelvis in the frame before the next window, with its sign.
    before: Quat,
    guessed: u64,
}

impl Playback {
    /// Stands as in a frame. Limits are those of the hinges, radians.
    pub fn new(first: &Row, limits: Vec<(f32, f32)>) -> Self {
        let stands = Ramp {
            start: 0,
            frames: 1,
            from: 1.0,
            to: 1.0,
        };
        Self {
            stand: upright(first),
            limits,
            frames: VecDeque::from([*first]),
            next: 1,
            known: 1,
            fresh: 1,
            ramps: VecDeque::from([stands]),
            before: turn(first),
            guessed: 0,
        }
    }

    /// Index of the first frame of the next window.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Frames that were due before the server's had come.
    pub fn guessed(&self) -> u64 {
        self.guessed
    }

    /// Whether the server has sent nothing for [`LATE`] ticks.
    pub fn is_late(&self) -> bool {
        self.next - self.fresh >= LATE
    }

    /// Whether it stands, or will once a ramp is over.
    pub fn halts(&self) -> bool {
        self.ramps.back().is_some_and(|ramp| ramp.to == 1.0)
    }

    /// Takes the server's frames from an index on, instead of all from there on.
    pub fn update(&mut self, first: u64, rows: &[Row]) {
        let past = self.next.saturating_sub(first);
        let rows = rows.get(past as usize..).unwrap_or_default();
        if rows.is_empty() {
            return;
        }
        let first = first + past;
        let guessed = first > self.known;
        self.extend(first + FADE);
        let at = self.place(first);
        for (nth, row) in rows.iter().enumerate() {
            match self.frames.get_mut(at + nth) {
                Some(old) if guessed && (nth as u64) < FADE => {
                    *old = mix(old, row, (nth + 1) as f32 / (FADE + 1) as f32);
                }
                Some(old) => *old = *row,
                None => self.frames.push_back(*row),
            }
        }
        self.frames.truncate(at + rows.len());
        self.known = first + rows.len() as u64;
        self.fresh = self.next;
    }

    /// Comes to stand.
    pub fn halt(&mut self, halt: Halt) {
        self.ramp(1.0, halt.delay, halt.frames);
    }

    /// Follows the server's motion.
    pub fn release(&mut self) {
        self.ramp(0.0, 0, 25);
    }

    fn ramp(&mut self, to: f32, delay: u64, frames: u64) {
        let start = self.next + PLAYED + delay;
        let from = self.weight(start);
        self.ramps.retain(|ramp| ramp.start < start);
        self.ramps.push_back(Ramp {
            start,
            frames,
            from,
            to,
        });
    }

    fn weight(&self, frame: u64) -> f32 {
        let mut ramps = self.ramps.iter().rev();
        let ramp = ramps.find(|ramp| ramp.start <= frame);
        ramp.map_or(1.0, |ramp| ramp.weight(frame))
    }

    /// Place of a frame of an index in the list.
    fn place(&self, index: u64) -> usize {
        (index + 1 - self.next) as usize
    }

    /// Guesses frames up to an index, that one not included.
    fn extend(&mut self, end: u64) {
        while self.frames.len() < self.place(end) {
            let last = self.frames.len() - 1;
            let before = &self.frames[last.saturating_sub(1)];
            let guess = onward(before, &self.frames[last], &self.limits);
            self.frames.push_back(guess);
        }
    }

    /// The frame at a place in the list, as it is shown.
    fn shown(&self, place: usize) -> Row {
        let row = &self.frames[place];
        let index = self.next + place as u64;
        match self.weight(index.saturating_sub(1)) {
            0.0 => *row,
            1.0 => standing_at(&self.stand, row),
            weight => mix(row, &standing_at(&self.stand, row), weight),
        }
    }

    /// The next window. Reuses what it is given.
    pub fn window(&mut self, out: &mut Window) {
        let frames = WINDOW as u64;
        self.extend(self.next + frames + 1);
        out.first = self.next;
        out.angles.clear();
        out.speeds.clear();
        out.turns.clear();
        let mut sign = self.before;
        let (mut before, mut row) = (self.shown(0), self.shown(1));
        for place in 1..=WINDOW {
            let after = self.shown(place + 1);
            let angles = std::array::from_fn(|nth| row[ROOT_QPOS + nth]);
            let speed = |nth: usize| (after[ROOT_QPOS + nth] - before[ROOT_QPOS + nth]) * 0.5 * HZ as f32;
            let turned = align_sign(turn(&row), sign);
            out.angles.push(angles);
            out.speeds.push(std::array::from_fn::<f32, HINGES, _>(speed));
            out.turns.push(to_wxyz(turned));
            if place == 1 {
                self.before = turned;
            }
            sign = turned;
            (before, row) = (row, after);
        }
        self.guessed += u64::from(self.next >= self.known);
        self.frames.pop_front();
        self.next += 1;
        if self.ramps.get(1).is_some_and(|ramp| ramp.start < self.next) {
            self.ramps.pop_front();
        }
    }
}

#[cfg(test)]
#[path = "playback_tests.rs"]
mod tests;
