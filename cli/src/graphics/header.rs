//! The head of a picture: title, subtitle and legend.

use std::ops::Range;

use super::canvas::{Align, Canvas, Fonts, Ink, Point, Type};
use super::theme::{DARK, MARGIN, MUTED, heading, regular};

/// Baselines of title and subtitle.
const TITLE_Y: f32 = 50.0;
const SUBTITLE_Y: f32 = 76.0;
const TITLE_SIZE: f32 = 27.0;
/// From a line of the legend to the next.
const LINE: f32 = 26.0;
/// Between entries of the legend.
const GAP: f32 = 20.0;
/// Least room between the title and a legend beside it.
const ROOM: f32 = 32.0;
/// From a mark's last disc to its name, from disc to disc, and their radius.
const TO_NAME: f32 = 14.0;
const APART: f32 = 9.0;
const RADIUS: f32 = 6.5;
/// Length of a dotted line that is a mark.
const DOTTED: f32 = 34.0;

/// What a legend has in front of a name.
#[derive(Debug, Clone)]
pub(crate) enum Mark {
    /// Discs in these colours.
    Discs(Vec<Ink>),
    /// A dotted line.
    Dotted(Ink),
}

/// A name in a legend, and its mark.
#[derive(Debug, Clone)]
pub(crate) struct Entry<'a> {
    pub(crate) mark: Mark,
    pub(crate) name: &'a str,
}

/// Title, subtitle and legend, laid out. The legend is beside the title if both fit, else in
/// lines of its own below.
#[derive(Debug)]
pub(crate) struct Header<'a> {
    title: &'a str,
    subtitle: &'a str,
    entries: &'a [Entry<'a>],
    /// Where each entry begins.
    places: Vec<Point>,
    lines_below: usize,
}

impl<'a> Header<'a> {
    /// A header that ends at `right`.
    pub(crate) fn new(
        fonts: &Fonts,
        right: f32,
        (title, subtitle): (&'a str, &'a str),
        entries: &'a [Entry<'a>],
    ) -> Self {
        let widths: Vec<f32> = entries.iter().map(|entry| entry.width(fonts)).collect();
        let title_ends = MARGIN + fonts.width(title, heading(TITLE_SIZE));
        let beside = right - sum(&widths);
        let (places, lines_below) = if beside >= title_ends + ROOM {
            (row(&widths, Point::new(beside, TITLE_Y)), 0)
        } else {
            let lines = lines(&widths, right - MARGIN);
            let places = lines.iter().enumerate().flat_map(|(nth, line)| {
                let y = SUBTITLE_Y + LINE * (nth + 1) as f32;
                row(&widths[line.clone()], Point::new(MARGIN, y))
            });
            (places.collect(), lines.len())
        };
        Self {
            title,
            subtitle,
            entries,
            places,
            lines_below,
        }
    }

    /// How much higher it is than one without lines below.
    pub(crate) fn extra_height(&self) -> f32 {
        LINE * self.lines_below as f32
    }

    /// Draws it. All that is drawn later is lower by its extra height.
    pub(crate) fn draw(&self, canvas: &mut Canvas) {
        canvas.text(self.title, Point::new(MARGIN, TITLE_Y), heading(TITLE_SIZE));
        let below = Point::new(MARGIN, SUBTITLE_Y);
        canvas.text(self.subtitle, below, regular(16.0, MUTED, Align::Left));
        for (entry, &at) in self.entries.iter().zip(&self.places) {
            entry.draw(canvas, at);
        }
        canvas.move_down(self.extra_height());
    }
}

impl Entry<'_> {
    /// Font and size of the text.
    fn letters() -> Type {
        regular(16.0, DARK, Align::Left)
    }

    /// Length of its mark, from the left end to the name.
    fn mark_width(&self) -> f32 {
        match &self.mark {
            Mark::Discs(inks) => RADIUS + APART * inks.len().saturating_sub(1) as f32 + TO_NAME,
            Mark::Dotted(_) => DOTTED + TO_NAME,
        }
    }

    fn width(&self, fonts: &Fonts) -> f32 {
        self.mark_width() + fonts.width(self.name, Self::letters())
    }

    /// Draws it from its left end on a baseline.
    fn draw(&self, canvas: &mut Canvas, at: Point) {
        // The middle of small letters.
        let middle = at - Point::new(0.0, 5.5);
        match &self.mark {
            Mark::Discs(inks) => {
                for (nth, ink) in inks.iter().enumerate() {
                    let centre = middle + Point::new(RADIUS + APART * nth as f32, 0.0);
                    canvas.disc(centre, RADIUS, *ink);
                }
            }
            Mark::Dotted(ink) => {
                let ends = [middle, middle + Point::new(DOTTED, 0.0)];
                canvas.dashed(&ends, 3.0, [1.0, 7.0], *ink);
            }
        }
        canvas.text(
            self.name,
            at + Point::new(self.mark_width(), 0.0),
            Self::letters(),
        );
    }
}

/// Width of entries side by side.
fn sum(widths: &[f32]) -> f32 {
    widths.iter().sum::<f32>() + GAP * widths.len().saturating_sub(1) as f32
}

/// Where entries begin that stand side by side.
fn row(widths: &[f32], first: Point) -> Vec<Point> {
    let place = |nth: usize| {
        let before = &widths[..nth];
        first + Point::new(before.iter().sum::<f32>() + GAP * nth as f32, 0.0)
    };
    (0..widths.len()).map(place).collect()
}

/// The entries of each line. No line is wider than `most`, unless a single entry is.
fn lines(widths: &[f32], most: f32) -> Vec<Range<usize>> {
    let mut lines: Vec<Range<usize>> = Vec::new();
    for nth in 0..widths.len() {
        match lines.last_mut() {
            Some(line) if sum(&widths[line.start..=nth]) <= most => line.end = nth + 1,
            _ => lines.push(nth..nth + 1),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(names: &[&'static str]) -> Vec<Entry<'static>> {
        let entry = |name: &&'static str| Entry {
            mark: Mark::Discs(vec![DARK]),
            name,
        };
        names.iter().map(entry).collect()
    }

    #[test]
    fn a_short_legend_is_beside_the_title() {
        let fonts = Fonts::load().unwrap();
        let entries = entries(&["normal", "elderly"]);
        let header = Header::new(&fonts, 1560.0, ("A title", "and more"), &entries);
        assert_eq!((header.extra_height(), header.places[0].y), (0.0, TITLE_Y));
        let end = header.places[1].x + entries[1].width(&fonts);
        assert!((end - 1560.0).abs() < 1e-2);
    }

    #[test]
    fn a_long_legend_is_below_and_covers_nothing() {
        let fonts = Fonts::load().unwrap();
        let entries = entries(&["not-confident"; 22]);
        let header = Header::new(&fonts, 1560.0, ("A title of some length", ""), &entries);
        assert!(header.extra_height() > 2.0 * LINE);
        for (entry, place) in entries.iter().zip(&header.places) {
            assert!(place.y > SUBTITLE_Y && place.x >= MARGIN);
            assert!(place.x + entry.width(&fonts) <= 1560.0);
        }
    }
}
