//! Windows, checked as a robot checks them.

use proptest::prelude::*;

use super::*;
use crate::row::tests::row;

/// What a robot does with windows: it merges them, and plays them at its own clock.
#[derive(Default)]
struct Robot {
    window: Option<(u64, u64)>,
    length: usize,
    /// Frames from the window's start to the one that is played.
    cursor: u64,
    played: Vec<[f32; HINGES]>,
    /// Angles of the window's frames.
    held: VecDeque<[f32; HINGES]>,
}

impl Robot {
    /// Takes a window. Its playback starts again if the rules are broken, which is an error.
    fn take(&mut self, window: &Window) -> Result<(), String> {
        let (first, frames) = (window.first, window.angles.len());
        let last = first + frames as u64 - 1;
        if frames < 46 || (self.length != 0 && frames != self.length) {
            return Err(format!("{frames} frames"));
        }
        if window.speeds.len() != frames || window.turns.len() != frames {
            return Err("fields of different lengths".to_owned());
        }
        self.length = frames;
        let Some((start, end)) = self.window else {
            self.window = Some((first, last));
            self.held = window.angles.iter().copied().collect();
            return Ok(());
        };
        if first <= start || last <= end || first > end + 1 {
            return Err(format!("{first} to {last} after {start} to {end}"));
        }
        let kept = (start + self.cursor.saturating_sub(5)).min(first);
        if first - kept > 205 {
            return Err(format!("{first} is far from {kept}"));
        }
        self.held.drain(..(kept - start) as usize);
        self.held.truncate((first - kept) as usize);
        self.held.extend(&window.angles);
        self.cursor -= kept - start;
        self.window = Some((kept, last));
        Ok(())
    }

    fn tick(&mut self) {
        let Some((start, end)) = self.window else { return };
        self.played.push(self.held[self.cursor as usize]);
        if start + self.cursor + 46 < end {
            self.cursor += 1;
        }
    }
}

fn limits() -> Vec<(f32, f32)> {
    vec![(-1.5, 1.5); HINGES]
}

/// The server's frame of an index: it walks, turns, and swings its hinges.
fn walk(index: u64) -> Row {
    let time_s = index as f32 / HZ as f32;
    row(time_s, 0.5 * time_s, (6.0 * time_s).sin())
}

fn walks(first: u64, frames: u64) -> Vec<Row> {
    (first..first + frames).map(walk).collect()
}

/// A playback that follows a server, and the windows so far.
fn following() -> (Playback, Window) {
    let mut playback = Playback::new(&row(0.0, 0.0, 0.0), limits());
    playback.release();
    let mut window = Window::default();
    for _ in 0..60 {
        playback.update(playback.next(), &walks(playback.next(), 40));
        playback.window(&mut window);
    }
    assert!((window.angles[0][3] - walk(window.first)[10]).abs() < 1e-6);
    (playback, window)
}

/// Ticks from now until all frames of a window stand still, while the server says nothing.
fn ticks_to_stand(playback: &mut Playback, mut each: impl FnMut(&mut Playback)) -> usize {
    let mut window = Window::default();
    for tick in 1..200 {
        each(playback);
        playback.window(&mut window);
        let still = window.speeds.iter().flatten().all(|speed| speed.abs() < 1e-3);
        let stands = window.angles.iter().flatten().all(|angle| angle.abs() < 1e-6);
        if still && stands {
            return tick;
        }
    }
    panic!("it does not stand")
}

#[test]
fn it_stands_until_it_is_released() {
    let mut playback = Playback::new(&row(0.0, 0.3, 0.2), limits());
    let mut window = Window::default();
    for _ in 0..30 {
        playback.update(playback.next(), &walks(playback.next(), 40));
        playback.window(&mut window);
        assert!(playback.halts());
        assert!(window.angles.iter().flatten().all(|&angle| angle == 0.2));
        assert!(window.speeds.iter().flatten().all(|&speed| speed == 0.0));
    }
    playback.release();
    assert!(!playback.halts());
}

#[test]
fn velocities_are_those_of_the_angles() {
    let (_, window) = following();
    for at in 1..WINDOW - 1 {
        let wanted = (window.angles[at + 1][5] - window.angles[at - 1][5]) * 25.0;
        assert!((window.speeds[at][5] - wanted).abs() < 1e-3);
    }
}

#[test]
fn a_lost_server_ends_in_standing_within_a_second() {
    let (mut playback, _) = following();
    let mut halted = false;
    let ticks = ticks_to_stand(&mut playback, |playback| {
        if playback.is_late() && !halted {
            playback.halt(Halt::ALONE);
            halted = true;
        }
    });
    assert!(halted && ticks <= 45, "{ticks} ticks");
}

#[test]
fn a_stop_ends_in_standing_within_a_second_though_the_server_walks_on() {
    let (mut playback, _) = following();
    playback.halt(Halt::WITH_SERVER);
    let ticks = ticks_to_stand(&mut playback, |playback| {
        playback.update(playback.next() + 4, &walks(playback.next() + 4, 40));
    });
    assert!(ticks <= 45, "{ticks} ticks");
    assert!(playback.halts() && !playback.is_late());
}

#[test]
fn late_frames_fade_in() {
    let (mut playback, _) = following();
    let mut window = Window::default();
    for _ in 0..60 {
        playback.window(&mut window);
    }
    let first = playback.next() + 4;
    playback.update(first, &walks(first + 1000, 60));
    playback.window(&mut window);
    let steps = window
        .angles
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).abs());
    assert!(steps.fold(0.0, f32::max) < 0.35);
    assert!((window.angles[30][0] - walk(window.first + 30 + 1000)[7]).abs() < 1e-6);
    assert!(playback.guessed() > 15);
}

#[test]
fn frames_of_the_past_are_left_out() {
    let (mut playback, _) = following();
    let next = playback.next();
    playback.update(next - 10, &walks(next - 10, 30));
    let mut window = Window::default();
    playback.window(&mut window);
    assert!((window.angles[0][0] - walk(next)[7]).abs() < 1e-6);
    playback.update(next - 10, &walks(next - 10, 5));
    playback.window(&mut window);
    assert_eq!(window.first, next + 1);
}

#[derive(Debug, Clone)]
enum Deed {
    Frames { ahead: u64, count: u64, jump: u64 },
    Stop,
    Late,
    Release,
    Send { lost: bool, robot_ticks: u8 },
}

fn deeds() -> impl Strategy<Value = Vec<Deed>> {
    let frames =
        (0..8_u64, 1..70_u64, 0..3_u64).prop_map(|(ahead, count, jump)| Deed::Frames { ahead, count, jump });
    let send =
        (prop::bool::weighted(0.1), 0..3_u8).prop_map(|(lost, robot_ticks)| Deed::Send { lost, robot_ticks });
    let deed = prop_oneof![
        4 => frames,
        1 => Just(Deed::Stop),
        1 => Just(Deed::Late),
        2 => Just(Deed::Release),
        12 => send,
    ];
    prop::collection::vec(deed, 1..400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_window_restarts_a_robot(deeds in deeds()) {
        let mut playback = Playback::new(&row(0.0, 0.0, 0.0), limits());
        let mut robot = Robot::default();
        let mut window = Window::default();
        for deed in deeds {
            match deed {
                Deed::Frames { ahead, count, jump } => {
                    let first = playback.next() + ahead;
                    playback.update(first, &walks(first + 7 * jump, count));
                }
                Deed::Stop => playback.halt(Halt::WITH_SERVER),
                Deed::Late => playback.halt(Halt::ALONE),
                Deed::Release => playback.release(),
                Deed::Send { lost, robot_ticks } => {
                    playback.window(&mut window);
                    if !lost {
                        prop_assert_eq!(robot.take(&window), Ok(()));
                    }
                    for _ in 0..robot_ticks {
                        robot.tick();
                    }
                    for (angles, turn) in window.angles.iter().zip(&window.turns) {
                        prop_assert!(angles.iter().all(|angle| (-1.5..=1.5).contains(angle)));
                        let length = turn.iter().map(|number| number * number).sum::<f32>();
                        prop_assert!((length - 1.0).abs() < 1e-4);
                    }
                    for pair in window.turns.windows(2) {
                        let dot: f32 = pair[0].iter().zip(&pair[1]).map(|(a, b)| a * b).sum();
                        prop_assert!(dot > 0.0, "the sign changes");
                    }
                }
            }
        }
        // Whatever happened, a stop ends in standing within a second.
        playback.halt(Halt::WITH_SERVER);
        let ticks = ticks_to_stand(&mut playback, |_| ());
        prop_assert!(ticks <= 45, "{} ticks", ticks);
    }

    #[test]
    fn ramps_meet(deeds in prop::collection::vec((0..4_u8, 0..30_usize), 1..40)) {
        let mut playback = Playback::new(&row(0.0, 0.0, 0.0), limits());
        let mut window = Window::default();
        for (deed, ticks) in deeds {
            match deed {
                0 => playback.halt(Halt::WITH_SERVER),
                1 => playback.halt(Halt::ALONE),
                _ => playback.release(),
            }
            for _ in 0..ticks {
                playback.update(playback.next(), &[row(0.0, 0.0, 1.0); 60]);
                let before = window.angles.first().map_or(0.0, |angles| angles[0]);
                playback.window(&mut window);
                let mut angles = vec![before];
                angles.extend(window.angles.iter().map(|angles| angles[0]));
                let steps = angles.windows(2).map(|pair| (pair[1] - pair[0]).abs());
                prop_assert!(steps.fold(0.0, f32::max) < 0.07);
            }
        }
    }
}
