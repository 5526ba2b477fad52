//! What goes to the terminal beside a command's answer. All of it goes to standard error.

use std::io::IsTerminal as _;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// A text of one line whose control characters are escaped: names in files may have any.
pub(crate) fn plain(text: &str) -> String {
    escaped(text, char::is_control)
}

/// The same for a text of several lines.
pub(crate) fn plain_lines(text: &str) -> String {
    escaped(text, |c| c.is_control() && c != '\n' && c != '\t')
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> String {
    let mut made = String::with_capacity(text.len());
    for c in text.chars() {
        match is_escaped(c) {
            true => made.extend(c.escape_default()),
            false => made.push(c),
        }
    }
    made
}

/// Notes and progress bars: notes unless quiet, bars only on a terminal.
pub struct Term {
    quiet: bool,
}

impl Term {
    /// Notes and bars, or neither if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// Says something worth knowing that is not the command's answer.
    pub fn note(&self, text: impl std::fmt::Display) {
        if !self.quiet {
            eprintln!("{}", plain_lines(&text.to_string()));
        }
    }

    /// Whether lines that change may be drawn.
    pub(crate) fn is_live(&self) -> bool {
        !self.quiet && std::io::stderr().is_terminal()
    }

    /// A bar over a known number of steps.
    pub fn bar(&self, steps: usize, what: &'static str) -> ProgressBar {
        if !self.is_live() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(steps as u64), ProgressDrawTarget::stderr_with_hz(10));
        let template = "{msg:24} {wide_bar:.cyan/dim} {pos}/{len} {rate:>6} {eta:>5} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                // Nothing can be done about a bar that does not draw.
                let _ = write!(out, "{:.0}/s", state.per_sec());
            };
            bar.set_style(style.with_key("rate", rate).progress_chars("━╸─"));
        }
        bar.set_message(what);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        let text = "foot\u{1b}[31m\r\n\tüß";
        assert_eq!(plain(text), "foot\\u{1b}[31m\\r\\n\\tüß");
        assert_eq!(plain_lines(text), "foot\\u{1b}[31m\\r\n\tüß");
    }
}
