//! What the terminal shows while a character is driven.

use std::collections::VecDeque;
use std::io;

use crossterm::event::{KeyboardEnhancementFlags, PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags};
use crossterm::{execute, terminal};
use glam::Vec2;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke, Points};
use ratatui::widgets::{Block, Paragraph, Wrap};
use ratatui::{DefaultTerminal, Frame};

use super::keys::Choice;

/// Height of the ground that the view shows, metres.
const VIEW_M: f64 = 8.0;
/// Seconds of the way that are shown, at most so many points.
const TRAIL: usize = 600;

/// The terminal in full-screen mode. Dropping it brings back what was there, whatever happened.
pub(super) struct Screen {
    terminal: DefaultTerminal,
    enhanced: bool,
}

impl Screen {
    pub(super) fn open() -> io::Result<Self> {
        // Also sets a panic hook that restores the terminal first.
        let terminal = ratatui::try_init()?;
        let enhanced = matches!(terminal::supports_keyboard_enhancement(), Ok(true));
        let screen = Self { terminal, enhanced };
        if enhanced {
            let flags = KeyboardEnhancementFlags::REPORT_EVENT_TYPES
                | KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES;
            execute!(io::stdout(), PushKeyboardEnhancementFlags(flags))?;
        }
        Ok(screen)
    }

    /// Whether the terminal tells when keys are let go.
    pub(super) fn reports_releases(&self) -> bool {
        self.enhanced
    }

    pub(super) fn draw(&mut self, view: &View) -> io::Result<()> {
        self.terminal.draw(|frame| view.draw(frame)).map(|_| ())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if self.enhanced {
            // Nothing can be done about a terminal that is gone.
            let _ = execute!(io::stdout(), PopKeyboardEnhancementFlags);
        }
        ratatui::restore();
    }
}

/// An object of the scene.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SceneObject {
    pub(super) id: String,
    /// (x, z).
    pub(super) place: Vec2,
}

/// What there is to show.
#[derive(Debug, Default)]
pub(super) struct View {
    /// Where the character was, (x, z), oldest first.
    pub(super) trail: VecDeque<Vec2>,
    pub(super) place: Vec2,
    pub(super) heading: f32,
    pub(super) speed_mps: f32,
    /// (x, z), m/s.
    pub(super) commanded: Vec2,
    pub(super) facing: Option<f32>,
    pub(super) chosen_speed_mps: f32,
    pub(super) styles: Vec<Choice>,
    pub(super) style: usize,
    pub(super) tick: u64,
    pub(super) dropped: u64,
    pub(super) underruns: u64,
    /// Seconds recorded, while recording.
    pub(super) recording_s: Option<f32>,
    /// The objects of the scene. None without a scene.
    pub(super) objects: Option<Vec<SceneObject>>,
    /// The object in use, and the set that it is at.
    pub(super) in_use: Option<String>,
    /// The object in the hand.
    pub(super) in_hand: Option<String>,
    /// The last event.
    pub(super) note: String,
}

impl View {
    /// The character has come to a place.
    pub(super) fn moved(&mut self, place: Vec2) {
        self.place = place;
        if self.trail.len() == TRAIL {
            self.trail.pop_front();
        }
        self.trail.push_back(place);
    }

    pub(super) fn draw(&self, frame: &mut Frame<'_>) {
        // In a scene the note may be longer than a line.
        let below = if self.objects.is_some() { 4 } else { 2 };
        let [main, bottom] =
            Layout::vertical([Constraint::Min(4), Constraint::Length(below)]).areas(frame.area());
        let [ground, side] = Layout::horizontal([Constraint::Min(10), Constraint::Length(30)]).areas(main);
        self.draw_ground(frame, ground);
        frame.render_widget(Paragraph::new(self.status()).block(Block::bordered()), side);
        let keys = Line::from(
            " WASD move · QE turn · F face ahead · 1-9 style · +- speed · space stand · R record · Esc leave",
        );
        let mut lines = vec![keys.dim()];
        if self.objects.is_some() {
            lines.push(Line::from(" U use what is near · X end what is held · G put down").dim());
        }
        lines.push(Line::from(format!(" {}", self.note)));
        frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }), bottom);
    }

    fn draw_ground(&self, frame: &mut Frame<'_>, area: Rect) {
        // A cell is about twice as high as it is wide.
        let inner = (
            f64::from(area.width.saturating_sub(2)),
            f64::from(area.height.saturating_sub(2)),
        );
        let wide = VIEW_M * inner.0 / (2.0 * inner.1.max(1.0));
        // Right is -x.
        let (x, y) = (-f64::from(self.place.x), f64::from(self.place.y));
        let canvas = Canvas::default()
            .block(Block::bordered().title(" from above, metres "))
            .marker(Marker::Braille)
            .x_bounds([x - wide / 2.0, x + wide / 2.0])
            .y_bounds([y - VIEW_M / 2.0, y + VIEW_M / 2.0])
            .paint(|context| self.paint(context, x, y, wide));
        frame.render_widget(canvas, area);
    }

    fn paint(&self, context: &mut Context<'_>, x: f64, y: f64, wide: f64) {
        let (across, along) = ((wide / 2.0).ceil() as i64 + 1, (VIEW_M / 2.0) as i64 + 1);
        let grid = (-across..=across).flat_map(|i| {
            let column = x.round() + i as f64;
            (-along..=along).map(move |j| (column, y.round() + j as f64))
        });
        let grid = grid.collect::<Vec<_>>();
        context.draw(&Points {
            coords: &grid,
            color: Color::DarkGray,
        });
        let trail = self.trail.iter().map(|p| (-f64::from(p.x), f64::from(p.y)));
        let trail = trail.collect::<Vec<_>>();
        context.draw(&Points {
            coords: &trail,
            color: Color::Blue,
        });
        context.layer();
        for object in self.objects.iter().flatten() {
            let name = Span::styled(format!("▪{}", object.id), Style::new().fg(Color::Magenta));
            context.print(-f64::from(object.place.x), f64::from(object.place.y), name);
        }
        let mut arrow = |way: Vec2, color| {
            let tip = (x - f64::from(way.x), y + f64::from(way.y));
            context.draw(&Stroke::new(x, y, tip.0, tip.1, color));
        };
        arrow(self.commanded, Color::Yellow);
        let (sin, cos) = self.heading.sin_cos();
        arrow(Vec2::new(sin, cos) * 0.7, Color::Green);
        context.print(x, y, Span::styled("●", Style::new().fg(Color::Green)));
    }

    fn status(&self) -> Vec<Line<'_>> {
        let row = |name: &'static str, value: String| Line::from(vec![name.dim(), Span::raw(value)]);
        let facing = match self.facing {
            Some(facing) => format!("{:.0}°", facing.to_degrees()),
            None => "ahead".to_owned(),
        };
        let mut lines = vec![
            row("place    ", format!("{:.2} {:.2} m", self.place.x, self.place.y)),
            row(
                "heading  ",
                format!("{:.0}°, commanded {facing}", self.heading.to_degrees()),
            ),
            row(
                "speed    ",
                format!("{:.2} of {:.2} m/s", self.speed_mps, self.commanded.length()),
            ),
            row("to go at ", format!("{:.1} m/s", self.chosen_speed_mps)),
            row("tick     ", format!("{}, {} dropped", self.tick, self.dropped)),
            row("underruns", format!(" {}", self.underruns)),
            match self.recording_s {
                Some(seconds) => Line::from(format!("● recording {seconds:.1} s")).red(),
                None => Line::from("not recording").dim(),
            },
            Line::default(),
        ];
        if self.objects.is_some() {
            let name = |of: &Option<String>| of.clone().unwrap_or_else(|| "nothing".to_owned());
            let at = lines.len() - 1;
            let scene = [
                row("in use   ", name(&self.in_use)),
                row("in hand  ", name(&self.in_hand)),
            ];
            lines.splice(at..at, scene);
        }
        for (nth, style) in self.styles.iter().enumerate().take(9) {
            let line = Line::from(format!("{} {} {:.1} m/s", nth + 1, style.name, style.speed_mps));
            lines.push(if nth == self.style { line.reversed() } else { line });
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;

    fn drawn(view: &View, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    fn view() -> View {
        let choice = |name: &str, speed_mps| Choice {
            name: name.to_owned(),
            speed_mps,
        };
        let mut view = View {
            heading: 0.5,
            speed_mps: 1.13,
            commanded: Vec2::new(0.0, 1.2),
            chosen_speed_mps: 1.2,
            styles: vec![choice("normal", 1.2), choice("elderly", 0.7)],
            style: 1,
            tick: 321,
            dropped: 2,
            underruns: 1,
            recording_s: Some(2.5),
            note: "take-1.bvh written".to_owned(),
            ..View::default()
        };
        for i in 0..60 {
            view.moved(Vec2::new(0.5, 0.03 * i as f32));
        }
        view
    }

    #[test]
    fn the_screen_is_as_documented() {
        insta::assert_snapshot!(drawn(&view(), 100, 24));
    }

    #[test]
    fn objects_and_their_keys_are_shown_in_a_scene() {
        let mut view = view();
        view.objects = Some(vec![SceneObject {
            id: "cup-1".to_owned(),
            place: Vec2::new(-1.0, 3.0),
        }]);
        view.in_hand = Some("cup-1".to_owned());
        view.note =
            "reached lift: root 0.1 cm, heading 0.3°, joints 3.6 cm off, drawn to 0.0 cm, 0.0°, 0.0 cm, and \
                     whatever else there is to say"
                .to_owned();
        let drawn = drawn(&view, 100, 24);
        assert!(drawn.contains("▪cup-1"), "{drawn}");
        assert!(drawn.contains("G put down"), "{drawn}");
        assert!(drawn.contains("in use   nothing"), "{drawn}");
        assert!(drawn.contains("in hand  cup-1"), "{drawn}");
        assert!(
            drawn.contains("else there is to say"),
            "a long note goes on: {drawn}"
        );
    }

    #[test]
    fn a_tiny_terminal_is_no_panic() {
        for (width, height) in [(1, 1), (5, 3), (31, 6), (300, 2)] {
            drawn(&view(), width, height);
        }
    }

    #[test]
    fn the_trail_is_bounded() {
        let mut view = view();
        for i in 0..10_000 {
            view.moved(Vec2::new(i as f32, 0.0));
        }
        assert_eq!(view.trail.len(), TRAIL);
    }
}
