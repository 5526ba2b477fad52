//! What all pictures have in common: colours, letters, the bar that shows a plan's scale.

use super::canvas::{Align, Canvas, Ink, Point, Type, Weight};

/// Distance of everything from the picture's edges.
pub(crate) const MARGIN: f32 = 40.0;

pub(crate) const DARK: Ink = Ink::hex(0x1f_29_33);
pub(crate) const MUTED: Ink = Ink::hex(0x7b_87_94);
pub(crate) const RULE: Ink = Ink::hex(0xd5_db_e2);
pub(crate) const PANEL: Ink = Ink::hex(0xf6_f8_fa);
const RAMP: [Ink; 3] = [Ink::hex(0x1b_6f_d8), Ink::hex(0x7a_4d_d8), Ink::hex(0xd8_43_8c)];

/// Colours of styles, in the order in which they come.
pub(crate) const STYLE_INKS: [Ink; 10] = [
    Ink::hex(0x1b_6f_d8),
    Ink::hex(0xd8_43_8c),
    Ink::hex(0xf0_8c_00),
    Ink::hex(0x2f_9e_44),
    Ink::hex(0x7a_4d_d8),
    Ink::hex(0x0c_85_99),
    Ink::hex(0xe0_31_31),
    Ink::hex(0x86_8e_20),
    Ink::hex(0x5c_6b_7a),
    Ink::hex(0x9c_5f_2c),
];

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
