//! From keys to commands.

use std::f32::consts::FRAC_PI_8;
use std::time::{Duration, Instant};

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use glam::{Vec2, Vec3};
use troupe_client::Locomotion;
use troupe_motion::root::wrap_angle;

/// Time for which a key counts as held, in terminals that do not report releases: after the first
/// press, and after each repeat.
const HELD_AT_FIRST: Duration = Duration::from_millis(650);
const HELD_BY_REPEAT: Duration = Duration::from_millis(180);
/// Turn of one press of Q or E, radians.
const TURN: f32 = FRAC_PI_8;
const SPEED_STEP_MPS: f32 = 0.1;
const MAX_SPEED_MPS: f32 = 6.0;

/// A style to choose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    pub(super) name: String,
    pub(super) speed_mps: f32,
}

/// What a key asks for, beside moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    Nothing,
    Record,
    /// Use the nearest object.
    Use,
    /// End the interaction that is held.
    End,
    /// Put down the object in the hand.
    PutDown,
    Leave,
}

/// The keys that are held, with the chosen style and speed. Directions are those of the view from
/// above: up is +z, right is -x.
#[derive(Debug)]
pub(super) struct Controls {
    /// The moment until which each direction counts as held.
    held: [Option<Instant>; 4],
    /// Whether the terminal reports releases of keys.
    reports_releases: bool,
    facing: Option<f32>,
    speed_mps: f32,
    styles: Vec<Choice>,
    style: usize,
}

/// Up, left, down, right, as (x, z).
const DIRECTIONS: [Vec2; 4] = [Vec2::Y, Vec2::X, Vec2::NEG_Y, Vec2::NEG_X];

impl Controls {
    /// Without a held key. `style` is the index of the first style.
    pub(super) fn new(styles: Vec<Choice>, style: usize, reports_releases: bool) -> Self {
        let speed_mps = styles.get(style).map_or(1.2, |s| s.speed_mps);
        Self {
            held: [None; 4],
            reports_releases,
            facing: None,
            speed_mps,
            styles,
            style,
        }
    }

    /// Takes a key. `heading` is that of the character now, radians.
    pub(super) fn key(&mut self, key: KeyEvent, now: Instant, heading: f32) -> Asked {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code {
                KeyCode::Char('c' | 'C') => Asked::Leave,
                _ => Asked::Nothing,
            };
        }
        if let Some(direction) = direction(key.code) {
            self.hold(direction, key.kind, now);
            return Asked::Nothing;
        }
        if key.kind == KeyEventKind::Release {
            return Asked::Nothing;
        }
        match key.code {
            KeyCode::Char(letter) => return self.letter(letter.to_ascii_lowercase(), key.kind, heading),
            KeyCode::Esc => return Asked::Leave,
            _ => {}
        }
        Asked::Nothing
    }

    fn letter(&mut self, letter: char, kind: KeyEventKind, heading: f32) -> Asked {
        match letter {
            'q' => self.turn(TURN, heading),
            'e' => self.turn(-TURN, heading),
            'f' => self.facing = None,
            '+' | '=' => self.change_speed(SPEED_STEP_MPS),
            '-' | '_' => self.change_speed(-SPEED_STEP_MPS),
            ' ' => self.held = [None; 4],
            'r' if kind == KeyEventKind::Press => return Asked::Record,
            'u' if kind == KeyEventKind::Press => return Asked::Use,
            'x' if kind == KeyEventKind::Press => return Asked::End,
            'g' if kind == KeyEventKind::Press => return Asked::PutDown,
            '1'..='9' => self.choose(letter as usize - '1' as usize),
            _ => {}
        }
        Asked::Nothing
    }

    fn hold(&mut self, direction: usize, kind: KeyEventKind, now: Instant) {
        let held = &mut self.held[direction];
        if kind == KeyEventKind::Release {
            *held = None;
        } else if self.reports_releases {
            // So long that only its release ends it, but not for ever should that get lost.
            *held = Some(now + Duration::from_secs(60));
        } else if held.is_some_and(|until| until > now) {
            *held = Some(now + HELD_BY_REPEAT).max(*held);
        } else {
            *held = Some(now + HELD_AT_FIRST);
        }
    }

    fn turn(&mut self, by: f32, heading: f32) {
        self.facing = Some(wrap_angle(self.facing.unwrap_or(heading) + by));
    }

    fn change_speed(&mut self, by_mps: f32) {
        self.speed_mps = (self.speed_mps + by_mps).clamp(SPEED_STEP_MPS, MAX_SPEED_MPS);
    }

    fn choose(&mut self, style: usize) {
        if let Some(choice) = self.styles.get(style) {
            self.style = style;
            self.speed_mps = choice.speed_mps.max(SPEED_STEP_MPS);
        }
    }

    /// What the character should do now.
    pub(super) fn intent(&self, now: Instant) -> Locomotion {
        let held = self.held.iter().zip(DIRECTIONS);
        let way = held
            .filter(|(until, _)| until.is_some_and(|until| until > now))
            .map(|(_, direction)| direction)
            .sum::<Vec2>();
        let velocity = way.normalize_or_zero() * self.speed_mps;
        Locomotion {
            velocity: Vec3::new(velocity.x, 0.0, velocity.y),
            facing: self.facing,
            style: self.styles.get(self.style).map(|s| s.name.clone()),
            ..Locomotion::default()
        }
    }

    pub(super) fn style(&self) -> usize {
        self.style
    }

    pub(super) fn speed_mps(&self) -> f32 {
        self.speed_mps
    }
}

fn direction(key: KeyCode) -> Option<usize> {
    match key {
        KeyCode::Up | KeyCode::Char('w' | 'W') => Some(0),
        KeyCode::Left | KeyCode::Char('a' | 'A') => Some(1),
        KeyCode::Down | KeyCode::Char('s' | 'S') => Some(2),
        KeyCode::Right | KeyCode::Char('d' | 'D') => Some(3),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controls(reports_releases: bool) -> Controls {
        let choice = |name: &str, speed_mps| Choice {
            name: name.to_owned(),
            speed_mps,
        };
        Controls::new(vec![choice("walk", 1.2), choice("run", 3.0)], 0, reports_releases)
    }

    fn event(code: KeyCode, kind: KeyEventKind) -> KeyEvent {
        KeyEvent::new_with_kind(code, KeyModifiers::NONE, kind)
    }

    fn press(code: char) -> KeyEvent {
        event(KeyCode::Char(code), KeyEventKind::Press)
    }

    fn velocity(controls: &Controls, now: Instant) -> Vec2 {
        let velocity = controls.intent(now).velocity;
        Vec2::new(velocity.x, velocity.z)
    }

    #[test]
    fn a_key_moves_as_long_as_it_repeats() {
        let mut controls = controls(false);
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        controls.key(press('w'), at(0), 0.0);
        assert_eq!(velocity(&controls, at(500)), Vec2::new(0.0, 1.2));
        // Repeats begin after half a second and come 30 times a second.
        for ms in (500..2000).step_by(33) {
            controls.key(press('w'), at(ms), 0.0);
        }
        assert_eq!(velocity(&controls, at(2100)), Vec2::new(0.0, 1.2));
        assert_eq!(velocity(&controls, at(2300)), Vec2::ZERO);
        // A tap is a short walk, and space ends it at once.
        controls.key(press('a'), at(3000), 0.0);
        assert_eq!(velocity(&controls, at(3100)), Vec2::new(1.2, 0.0));
        controls.key(press(' '), at(3100), 0.0);
        assert_eq!(velocity(&controls, at(3101)), Vec2::ZERO);
    }

    #[test]
    fn releases_count_if_the_terminal_reports_them() {
        let mut controls = controls(true);
        let now = Instant::now();
        let later = now + Duration::from_secs(5);
        controls.key(event(KeyCode::Up, KeyEventKind::Press), now, 0.0);
        controls.key(event(KeyCode::Right, KeyEventKind::Press), now, 0.0);
        let diagonal = velocity(&controls, later);
        assert!((diagonal.length() - 1.2).abs() < 1e-6 && diagonal.x < 0.0 && diagonal.y > 0.0);
        controls.key(event(KeyCode::Right, KeyEventKind::Release), later, 0.0);
        assert_eq!(velocity(&controls, later), Vec2::new(0.0, 1.2));
        // Opposite directions are none.
        controls.key(event(KeyCode::Down, KeyEventKind::Press), later, 0.0);
        assert_eq!(velocity(&controls, later), Vec2::ZERO);
    }

    #[test]
    fn facing_begins_where_the_character_faces() {
        let mut controls = controls(false);
        let now = Instant::now();
        assert_eq!(controls.intent(now).facing, None);
        controls.key(press('q'), now, 1.0);
        controls.key(press('Q'), now, 5.0);
        let facing = controls.intent(now).facing.unwrap();
        assert!((facing - 1.0 - 2.0 * TURN).abs() < 1e-6, "{facing}");
        controls.key(press('e'), now, 5.0);
        assert!((controls.intent(now).facing.unwrap() - 1.0 - TURN).abs() < 1e-6);
        controls.key(press('f'), now, 5.0);
        assert_eq!(controls.intent(now).facing, None);
    }

    #[test]
    fn styles_bring_their_speed() {
        let mut controls = controls(false);
        let now = Instant::now();
        controls.key(press('2'), now, 0.0);
        assert_eq!((controls.style(), controls.speed_mps()), (1, 3.0));
        controls.key(press('9'), now, 0.0);
        assert_eq!(
            controls.intent(now).style.as_deref(),
            Some("run"),
            "there is no ninth"
        );
        for _ in 0..100 {
            controls.key(press('-'), now, 0.0);
        }
        assert!((controls.speed_mps() - SPEED_STEP_MPS).abs() < 1e-6);
        controls.key(press('+'), now, 0.0);
        assert!((controls.speed_mps() - 2.0 * SPEED_STEP_MPS).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_movement_is_asked_once() {
        let mut controls = controls(true);
        let now = Instant::now();
        let control_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(controls.key(control_c, now, 0.0), Asked::Leave);
        assert_eq!(
            controls.key(event(KeyCode::Esc, KeyEventKind::Press), now, 0.0),
            Asked::Leave
        );
        let asked = ['r', 'u', 'X', 'g'].map(|key| controls.key(press(key), now, 0.0));
        assert_eq!(asked, [Asked::Record, Asked::Use, Asked::End, Asked::PutDown]);
        for kind in [KeyEventKind::Repeat, KeyEventKind::Release] {
            for key in ['r', 'u', 'x', 'g'] {
                assert_eq!(
                    controls.key(event(KeyCode::Char(key), kind), now, 0.0),
                    Asked::Nothing
                );
            }
        }
    }
}
