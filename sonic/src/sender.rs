//! The clock: a thread that sends a window to each robot, fifty times a second.
//!
//! It neither waits for the server nor for a robot. What the server makes of the future comes
//! through a channel, and what comes too late is left out.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::jitter::Jitter;
use crate::order::Move;
use crate::playback::{HZ, Halt, Playback};
use crate::publisher::Publisher;
use crate::row::Row;
use crate::waiting::Waiting;
use crate::wire::{COMMAND, Command, POSE, Window};
use crate::zmtp::message;

/// Time from one window of a robot to the next.
const TICK: Duration = Duration::from_millis(1000 / HZ as u64);
/// A clock that is later than this goes on from now. The robot has waited meanwhile.
const CATCH_UP: Duration = Duration::from_millis(60);
/// Ticks from one copy of a command to the next. Copies do no harm, and one may get lost.
const REPEAT: u64 = 5;
/// Copies of a command.
const COPIES: u64 = 5;
/// Ticks from the first start to the first order to follow poses: the robot leaves out a start that
/// comes together with it.
const FOLLOW_AFTER: u64 = 40;

/// Words that may wait for the clock, for each robot. It reads them all fifty times a second, and a
/// robot's task says at most two in a step of four ticks.
pub(crate) const WORDS: usize = 16;

/// Why a robot stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Why {
    /// It has had no order yet.
    #[default]
    New,
    /// By an order.
    Stopped,
    /// The server's frames were late.
    Late,
    /// The server was lost.
    Lost,
}

/// Something for the clock, with the index of its robot.
#[derive(Debug)]
pub(crate) enum Word {
    /// The server's frames from an index on.
    Rows(u64, Vec<Row>),
    /// Stand.
    Halt(Why),
    /// Follow the server's motion.
    Release,
    /// Begin or end control.
    Control(Command),
}

/// How a robot is doing. The clock writes it, reports read it.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    pub(crate) windows: u64,
    /// Frames that were due before the server's had come.
    pub(crate) guessed: u64,
    pub(crate) subscribers: usize,
    /// None while it moves.
    pub(crate) stands: Option<Why>,
    /// Whether the server's frames come in time.
    pub(crate) answered: bool,
    /// Times that the server's frames were late.
    pub(crate) late: u64,
    pub(crate) jitter: Jitter,
    /// Frames in which a hinge would have to be faster than it can.
    pub(crate) too_fast: u64,
    pub(crate) fastest: Fastest,
}

/// The hinge that came nearest to its highest speed, or went farthest beyond it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Fastest {
    /// Index of the hinge, in MuJoCo's order.
    pub hinge: usize,
    /// Its speed divided by its highest speed.
    pub ratio: f32,
}

impl Progress {
    /// Looks at the speeds of a frame's hinges, rad/s. `most` has their highest speeds.
    fn see_speeds(&mut self, speeds: &[f32], most: &[f32]) {
        let mut frame = Fastest::default();
        for (hinge, (speed, most)) in speeds.iter().zip(most).enumerate() {
            let ratio = speed.abs() / most;
            if ratio > frame.ratio {
                frame = Fastest { hinge, ratio };
            }
        }
        self.too_fast += u64::from(frame.ratio > 1.0);
        if frame.ratio > self.fastest.ratio {
            self.fastest = frame;
        }
    }
}

/// One robot of the clock.
#[derive(Debug)]
pub(crate) struct Station {
    pub(crate) publisher: Publisher,
    pub(crate) playback: Option<Playback>,
    pub(crate) limits: Vec<(f32, f32)>,
    /// Highest speeds of the hinges, rad/s.
    pub(crate) speeds: Vec<f32>,
    /// Index of the next window's first frame, 0 before the first one.
    pub(crate) ticks: watch::Sender<u64>,
    pub(crate) session: Arc<Waiting>,
    pub(crate) progress: Arc<Mutex<Progress>>,
    pub(crate) control: Option<(Command, u64)>,
    pub(crate) why: Why,
    pub(crate) late: u64,
    pub(crate) window: Window,
    pub(crate) buffer: Vec<u8>,
}

/// The progress, whatever happened to others that held it.
pub(crate) fn look(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs the clock until all who could send words are gone.
pub(crate) fn run(mut stations: Vec<Station>, words: &Receiver<(usize, Word)>) {
    let apart = TICK / stations.len().max(1) as u32;
    let mut due = Instant::now();
    loop {
        for nth in 0..stations.len() {
            let at = due + apart * nth as u32;
            if let Some(early) = at.checked_duration_since(Instant::now()) {
                std::thread::sleep(early);
            }
            loop {
                match words.try_recv() {
                    Ok((robot, word)) => {
                        if let Some(station) = stations.get_mut(robot) {
                            station.hear(word);
                        }
                    }
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            stations[nth].tick(at);
        }
        due += TICK;
        let now = Instant::now();
        if now.saturating_duration_since(due) > CATCH_UP {
            due = now;
        }
    }
}

impl Station {
    fn hear(&mut self, word: Word) {
        match (word, &mut self.playback) {
            (Word::Control(command), _) => self.control = Some((command, 0)),
            (Word::Rows(first, rows), Some(playback)) => playback.update(first, &rows),
            (Word::Rows(first, rows), None) => {
                let playback = |row| Playback::new(row, self.limits.clone());
                let mut playback = rows.first().map(playback);
                if let Some(playback) = &mut playback {
                    playback.update(first, &rows);
                }
                self.playback = playback;
            }
            (Word::Halt(why), Some(playback)) => {
                let halt = match why {
                    Why::Stopped => Halt::WITH_SERVER,
                    _ => Halt::ALONE,
                };
                if !playback.halts() {
                    playback.halt(halt);
                    self.why = why;
                }
            }
            (Word::Release, Some(playback)) => playback.release(),
            (Word::Halt(_) | Word::Release, None) => {}
        }
    }

    /// The copy of a command that is due now.
    fn command(&mut self) -> Option<Command> {
        let (command, tick) = self.control.as_mut()?;
        let now = *tick;
        *tick += 1;
        let is_copy = |since: u64| now >= since && (now - since).is_multiple_of(REPEAT);
        let due = match *command {
            Command::Start if is_copy(FOLLOW_AFTER) => Some(Command::Follow),
            Command::Start if now >= REPEAT * COPIES => None,
            command => is_copy(0).then_some(command),
        };
        let last = match *command {
            Command::Start => FOLLOW_AFTER + REPEAT * COPIES,
            _ => REPEAT * COPIES,
        };
        if now + 1 >= last {
            self.control = None;
        }
        due
    }

    fn tick(&mut self, due: Instant) {
        if let Some(command) = self.command() {
            self.publisher.send(COMMAND, &message(&command.message()).into());
        }
        let mut sent = None;
        if let Some(playback) = &mut self.playback {
            if playback.is_late() && !playback.halts() {
                playback.halt(Halt::ALONE);
                self.why = Why::Late;
                self.late += 1;
                self.session.give(Move::Stand);
            }
            playback.window(&mut self.window);
            self.window.write(&mut self.buffer);
            self.publisher.send_newest(POSE, &message(&self.buffer).into());
            sent = Some(playback.next());
        }
        self.publisher.poll();
        let mut progress = look(&self.progress);
        progress.subscribers = self.publisher.subscribers(POSE);
        if let Some(playback) = &self.playback {
            progress.windows += 1;
            let shown = self.window.speeds.first();
            progress.see_speeds(shown.map_or(&[][..], |speeds| &speeds[..]), &self.speeds);
            progress.guessed = playback.guessed();
            progress.stands = playback.halts().then_some(self.why);
            progress.answered = !playback.is_late();
            progress.late = self.late;
            progress.jitter.add(due.elapsed());
        }
        drop(progress);
        if let Some(next) = sent {
            self.ticks.send_replace(next);
        }
    }
}

#[cfg(test)]
mod tests {
    use troupe_motion::robot::ROOT_QPOS;

    use super::*;

    fn station() -> Station {
        Station {
            publisher: Publisher::bind(([127, 0, 0, 1], 0).into()).unwrap(),
            playback: None,
            limits: Vec::new(),
            speeds: vec![20.0; crate::wire::HINGES],
            ticks: watch::channel(0).0,
            session: Arc::default(),
            progress: Arc::default(),
            control: None,
            why: Why::New,
            late: 0,
            window: Window::default(),
            buffer: Vec::new(),
        }
    }

    #[test]
    fn a_start_comes_well_before_the_poses_count() {
        let mut station = station();
        station.hear(Word::Control(Command::Start));
        let sent: Vec<_> = (0..100)
            .filter_map(|tick| Some((tick, station.command()?)))
            .collect();
        let of = |wanted| sent.iter().filter(move |(_, command)| *command == wanted);
        let starts: Vec<_> = of(Command::Start).collect();
        let follows: Vec<_> = of(Command::Follow).collect();
        assert_eq!((starts.len(), follows.len()), (5, 5));
        let (last, first) = (starts[4].0, follows[0].0);
        assert!(first - last >= 10, "{first} - {last} ticks");
        assert!(sent.iter().all(|(_, command)| *command != Command::End));
    }

    #[test]
    fn frames_with_a_hinge_that_is_too_fast_are_counted() {
        let mut station = station();
        station.hear(Word::Rows(0, vec![crate::row::tests::row(0.0, 0.0, 0.0)]));
        station.hear(Word::Release);
        // 5 rad/s, then for five frames 25 rad/s of 20 by the third hinge.
        for tick in 0..60_u64 {
            let first = station.playback.as_ref().unwrap().next();
            let rows = (first..first + 60).map(|index| {
                let mut row = crate::row::tests::row(0.0, 0.0, 0.1 * index as f32);
                row[ROOT_QPOS + 2] += 0.4 * (index.clamp(40, 45) - 40) as f32;
                row
            });
            station.hear(Word::Rows(first, rows.collect()));
            station.tick(Instant::now());
            assert_eq!(look(&station.progress).windows, tick + 1);
        }
        let progress = look(&station.progress);
        assert_eq!(progress.fastest.hinge, 2);
        assert!(
            (progress.fastest.ratio - 1.25).abs() < 1e-3,
            "{:?}",
            progress.fastest
        );
        // A frame's speed is the mean of those to it and from it, so the first and the last of the
        // five steps have a frame between them and 5 rad/s.
        assert_eq!(progress.too_fast, 4);
    }

    #[test]
    fn an_end_is_said_five_times() {
        let mut station = station();
        station.hear(Word::Control(Command::Start));
        station.command();
        station.hear(Word::Control(Command::End));
        let sent: Vec<_> = (0..100).filter_map(|_| station.command()).collect();
        assert_eq!(sent, [Command::End; 5]);
    }

    #[test]
    fn late_frames_make_it_stand() {
        let mut station = station();
        let row = crate::row::tests::row(0.0, 0.0, 0.3);
        station.hear(Word::Rows(0, vec![row]));
        station.hear(Word::Release);
        for tick in 0..50 {
            let first = station.playback.as_ref().unwrap().next();
            if tick < 10 {
                station.hear(Word::Rows(first, vec![row; 60]));
            }
            station.tick(Instant::now());
        }
        {
            let progress = look(&station.progress);
            assert_eq!((progress.stands, progress.answered), (Some(Why::Late), false));
            assert_eq!((progress.windows, progress.late), (50, 1));
        }
        assert_eq!(*station.ticks.borrow(), 51);
        station.hear(Word::Rows(51, vec![row; 60]));
        station.hear(Word::Halt(Why::Stopped));
        station.tick(Instant::now());
        let progress = look(&station.progress);
        assert!(progress.answered);
        assert_eq!(progress.stands, Some(Why::Late), "it stands already");
    }
}
