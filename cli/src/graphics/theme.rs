//! What all pictures have in common: colours, letters, the bar that shows a plan's scale.

use super::canvas::{Align, Canvas, Ink, Point, Type, Weight};

/// Distance of everything from the picture's edges.
pub(crate) const MARGIN: f32 = 40.0;

pub(crate) const DARK: Ink = Ink::hex(0x1f_29_33);
pub(crate) const MUTED: Ink = Ink::hex(0x7b_87_94);
pub(crate) const RULE: Ink = Ink::hex(0xd5_db_e2);
pub(crate) const PANEL: Ink = Ink::hex(0xf6_f8_fa);
const RAMP: [Ink; 3] = [Ink::hex(0x1b_6f_d8), Ink::hex(0x7a_4d_d8), Ink::hex(0xd8_43_8c)];

/// The colour of a moment: 0 at the beginning, 1 at the end.
pub(crate) fn ramp(t: f32) -> Ink {
    if t < 0.5 {
        RAMP[0].mix(RAMP[1], t * 2.0)
    } else {
        RAMP[1].mix(RAMP[2], t * 2.0 - 1.0)
    }
}

/// Plain letters.
pub(crate) fn regular(size: f32, ink: Ink, align: Align) -> Type {
    Type {
        size,
        weight: Weight::Regular,
        align,
        ink,
    }
}

/// Letters of a heading.
pub(crate) fn heading(size: f32) -> Type {
    Type {
        size,
        weight: Weight::SemiBold,
        align: Align::Left,
        ink: DARK,
    }
}

/// The picture's title and the line below it.
pub(crate) fn draw_title(canvas: &mut Canvas, title: &str, subtitle: &str) {
    canvas.text(title, Point::new(MARGIN, 50.0), heading(27.0));
    let below = Point::new(MARGIN, 76.0);
    canvas.text(subtitle, below, regular(16.0, MUTED, Align::Left));
}

/// A legend on the title's line, from its right end `pen` towards the left: names, each with its colours in front of it,
/// `gap` pixels apart.
pub(crate) fn draw_legend<'n>(
    canvas: &mut Canvas,
    mut pen: f32,
    gap: f32,
    entries: impl IntoIterator<Item = (&'n str, Vec<Ink>)>,
) {
    let label = regular(16.0, DARK, Align::Left);
    for (name, inks) in entries {
        pen -= canvas.text_width(name, label);
        canvas.text(name, Point::new(pen, 50.0), label);
        pen -= 14.0;
        for ink in inks.iter().rev() {
            canvas.disc(Point::new(pen, 44.5), 6.5, *ink);
            pen -= 9.0;
        }
        pen -= gap;
    }
}

/// A bar of a round length, from its left end on; `scale` pixels make a metre.
pub(crate) fn draw_scale(canvas: &mut Canvas, left: Point, scale: f32) {
    let lengths = [
        (5.0, "5 m"),
        (2.0, "2 m"),
        (1.0, "1 m"),
        (0.5, "0.5 m"),
        (0.2, "0.2 m"),
    ];
    let (length, name) = lengths
        .into_iter()
        .find(|(length, _)| length * scale < 110.0)
        .unwrap_or((0.1, "0.1 m"));
    let right = left + Point::new(length * scale, 0.0);
    let tick = Point::new(0.0, 6.0);
    canvas.line(&[left - tick, left, right, right - tick], 1.5, MUTED);
    canvas.text(
        name,
        right + Point::new(10.0, 0.0),
        regular(15.0, MUTED, Align::Left),
    );
}
