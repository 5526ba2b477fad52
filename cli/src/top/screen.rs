//! The terminal's picture of a server, and its keys.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Stylize as _;
use ratatui::text::{Line, Text};
use ratatui::widgets::{Block, Paragraph, Row, Table, TableState, Wrap};
use troupe_proto::v1;

use super::figures::{CALL_HEADERS, Figures, PACK_HEADERS, SESSION_HEADERS, session_row, sort};

/// Rows of the calls' table at most: the others are seldom of interest.
const MOST_CALLS: usize = 6;

/// What a key asks for beyond the screen itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    Nothing,
    Leave,
}

/// What there is to show.
#[derive(Debug, Default)]
pub(super) struct View {
    pub(super) server: String,
    pub(super) figures: Figures,
    sessions: Vec<v1::Session>,
    /// What went wrong last; empty if nothing.
    pub(super) notes: Vec<String>,
    /// Column that sessions are sorted by.
    column: usize,
    reverse: bool,
    table: TableState,
}

impl View {
    pub(super) fn new(server: &str) -> Self {
        Self {
            server: server.to_owned(),
            ..Self::default()
        }
    }

    pub(super) fn sessions(&self) -> &[v1::Session] {
        &self.sessions
    }

    pub(super) fn set_sessions(&mut self, sessions: Vec<v1::Session>) {
        self.sessions = sessions;
        self.sort();
    }

    fn sort(&mut self) {
        sort(&mut self.sessions, self.column, self.reverse);
    }

    pub(super) fn press(&mut self, key: KeyEvent) -> Asked {
        let columns = SESSION_HEADERS.len();
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Asked::Leave,
            KeyCode::Char('q') | KeyCode::Esc => return Asked::Leave,
            KeyCode::Right | KeyCode::Char('s') => self.column = (self.column + 1) % columns,
            KeyCode::Left => self.column = (self.column + columns - 1) % columns,
            KeyCode::Char('r') => self.reverse = !self.reverse,
            KeyCode::Down => self.table.scroll_down_by(1),
            KeyCode::Up => self.table.scroll_up_by(1),
            KeyCode::PageDown => self.table.scroll_down_by(20),
            KeyCode::PageUp => self.table.scroll_up_by(20),
            KeyCode::Home => self.table.select_first(),
            _ => return Asked::Nothing,
        }
        self.sort();
        Asked::Nothing
    }

    pub(super) fn draw(&mut self, frame: &mut Frame<'_>) {
        let calls = self.figures.calls.len().min(MOST_CALLS);
        let height = |rows: usize| Constraint::Length(rows as u16 + 3);
        let notes = Constraint::Length(self.notes.len() as u16);
        let [head, packs, calls, notes, sessions, keys] = Layout::vertical([
            Constraint::Length(3),
            height(self.figures.packs.len()),
            height(calls),
            notes,
            Constraint::Min(3),
            Constraint::Length(1),
        ])
        .areas(frame.area());
        let title = Line::from(format!(" Troupe at {} ", self.server)).bold();
        let words = Paragraph::new(&*self.figures.head).wrap(Wrap { trim: true });
        frame.render_widget(words.block(Block::new().title(title)), head);
        self.draw_packs(frame, packs);
        self.draw_calls(frame, calls);
        let lines: Vec<Line<'_>> = self.notes.iter().map(|note| Line::from(&**note).red()).collect();
        frame.render_widget(Text::from(lines), notes);
        self.draw_sessions(frame, sessions);
        let help = " q leave · ←→ sort by · r reverse · ↑↓ scroll";
        frame.render_widget(Line::from(help).dim(), keys);
    }

    fn draw_packs(&self, frame: &mut Frame<'_>, area: Rect) {
        let mut widths = [Constraint::Length(10); 10];
        widths[0] = Constraint::Fill(1);
        let rows = self
            .figures
            .packs
            .iter()
            .map(|row| Row::new(row.iter().map(|cell| &**cell)));
        let table = Table::new(rows, widths).header(Row::new(PACK_HEADERS).bold());
        frame.render_widget(table.block(Block::bordered().title(" packs ")), area);
    }

    fn draw_calls(&self, frame: &mut Frame<'_>, area: Rect) {
        let widths = [
            Constraint::Fill(1),
            Constraint::Length(10),
            Constraint::Length(10),
            Constraint::Length(10),
        ];
        let rows = self.figures.calls.iter().take(MOST_CALLS);
        let rows = rows.map(|row| Row::new(row.iter().map(|cell| &**cell)));
        let table = Table::new(rows, widths).header(Row::new(CALL_HEADERS).bold());
        frame.render_widget(table.block(Block::bordered().title(" calls ")), area);
    }

    fn draw_sessions(&mut self, frame: &mut Frame<'_>, area: Rect) {
        let mut widths = [Constraint::Length(10); 9];
        (widths[0], widths[2], widths[8]) =
            (Constraint::Fill(2), Constraint::Fill(1), Constraint::Length(11));
        let mark = if self.reverse { "▼" } else { "▲" };
        let header = SESSION_HEADERS
            .iter()
            .enumerate()
            .map(|(nth, name)| match nth == self.column {
                true => Line::from(format!("{name} {mark}")).reversed(),
                false => Line::from(*name).bold(),
            });
        let title = format!(" {} sessions ", self.sessions.len());
        let rows = self.sessions.iter().map(|session| Row::new(session_row(session)));
        let table = Table::new(rows, widths)
            .header(Row::new(header))
            .block(Block::bordered().title(title))
            .row_highlight_style(ratatui::style::Style::new().reversed());
        frame.render_stateful_widget(table, area, &mut self.table);
    }
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::super::testing::{figures, sessions};
    use super::*;

    fn drawn(view: &mut View, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    fn view() -> View {
        let mut view = View::new("http://127.0.0.1:8080");
        view.figures = figures();
        view.set_sessions(sessions());
        view
    }

    fn press(view: &mut View, code: KeyCode) -> Asked {
        view.press(KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn the_screen_is_as_documented() {
        insta::assert_snapshot!(drawn(&mut view(), 120, 28));
    }

    #[test]
    fn a_small_terminal_is_no_panic() {
        let mut view = view();
        view.notes = vec!["no Troupe server answers".to_owned(); 3];
        for (width, height) in [(1, 1), (2, 40), (5, 3), (31, 6), (300, 2), (40, 12)] {
            for key in [KeyCode::Down, KeyCode::PageDown, KeyCode::Right] {
                press(&mut view, key);
                drawn(&mut view, width, height);
            }
        }
        drawn(&mut View::new(""), 1, 1);
    }

    #[test]
    fn keys_sort_and_leave() {
        let mut view = view();
        let first = |view: &View| view.sessions()[0].id.clone();
        assert_eq!(first(&view), "guard-1");
        assert_eq!(press(&mut view, KeyCode::Char('r')), Asked::Nothing);
        assert_eq!(first(&view), "robot");
        press(&mut view, KeyCode::Left);
        assert_eq!(first(&view), "guard-2", "the most underruns");
        assert!(drawn(&mut view, 140, 20).contains("underruns ▼"));
        for _ in 0..40 {
            press(&mut view, KeyCode::Right);
            press(&mut view, KeyCode::Char('x'));
        }
        for code in [KeyCode::Esc, KeyCode::Char('q')] {
            assert_eq!(press(&mut view, code), Asked::Leave);
        }
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(view.press(interrupt), Asked::Leave);
    }
}
