//! Lines, discs and letters on a white picture.

use ab_glyph::{Font, FontRef, GlyphId, OutlineCurve, PxScale, ScaleFont as _};
use tiny_skia::{
    Color, FillRule, LineCap, Mask, Paint, PathBuilder, Pixmap, PixmapPaint, Stroke, StrokeDash, Transform,
};

/// A point in pixels: x to the right, y down.
pub(crate) type Point = glam::Vec2;

/// A colour: red, green, blue and opacity, each 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ink {
    rgb: [f32; 3],
    alpha: f32,
}

impl Ink {
    /// From `0xRRGGBB`.
    pub(crate) const fn hex(code: u32) -> Self {
        let [_, r, g, b] = code.to_be_bytes();
        Self {
            rgb: [r as f32 / 255.0, g as f32 / 255.0, b as f32 / 255.0],
            alpha: 1.0,
        }
    }

    /// The same colour, see-through.
    pub(crate) fn alpha(self, alpha: f32) -> Self {
        Self { alpha, ..self }
    }

    /// How solid it is: 0 to 1.
    pub(crate) fn opacity(self) -> f32 {
        self.alpha
    }

    /// This colour at `t` 0, `other` at 1.
    pub(crate) fn mix(self, other: Self, t: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * t;
        Self {
            rgb: std::array::from_fn(|i| mix(self.rgb[i], other.rgb[i])),
            alpha: mix(self.alpha, other.alpha),
        }
    }

    fn paint(self) -> Paint<'static> {
        let channel = |v: f32| v.clamp(0.0, 1.0);
        let [r, g, b] = self.rgb.map(channel);
        let mut paint = Paint {
            anti_alias: true,
            ..Paint::default()
        };
        if let Some(color) = Color::from_rgba(r, g, b, channel(self.alpha)) {
            paint.set_color(color);
        }
        paint
    }
}

/// Weight of the letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    SemiBold,
}

/// Where a text stands relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Align {
    Left,
    Centre,
}

/// How a text is set.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Type {
    pub(crate) size: f32,
    pub(crate) weight: Weight,
    pub(crate) align: Align,
    pub(crate) ink: Ink,
}

/// A picture being drawn, in the pixels of the layout; `zoom` of its own pixels to each of them.
#[derive(Clone)]
pub(crate) struct Canvas {
    pixels: Pixmap,
    zoom: f32,
    /// What is drawn at 0 appears so far below the upper edge.
    down: f32,
    /// Where alone something is drawn.
    clip: Option<Mask>,
    fonts: Fonts,
}

/// The letters of all pictures.
#[derive(Debug, Clone)]
pub(crate) struct Fonts {
    regular: FontRef<'static>,
    semi_bold: FontRef<'static>,
}

const REGULAR: &[u8] = include_bytes!("../../assets/Inter-Regular-subset.ttf");
const SEMI_BOLD: &[u8] = include_bytes!("../../assets/Inter-SemiBold-subset.ttf");

impl Fonts {
    /// The fonts of this program.
    ///
    /// # Errors
    /// A sentence, if they cannot be read.
    pub(crate) fn load() -> Result<Self, String> {
        let font = |bytes| FontRef::try_from_slice(bytes).map_err(|e| format!("the built-in font: {e}"));
        Ok(Self {
            regular: font(REGULAR)?,
            semi_bold: font(SEMI_BOLD)?,
        })
    }

    /// Width of a line of text.
    pub(crate) fn width(&self, text: &str, set: Type) -> f32 {
        let font = self.of(set.weight);
        let scaled = font.as_scaled(scale(font, set.size));
        text.chars()
            .map(|letter| scaled.h_advance(font.glyph_id(letter)))
            .sum()
    }

    fn of(&self, weight: Weight) -> &FontRef<'static> {
        match weight {
            Weight::Regular => &self.regular,
            Weight::SemiBold => &self.semi_bold,
        }
    }
}

impl Canvas {
    /// A white picture of a layout of `width` x `height`, scaled by `zoom`.
    ///
    /// # Errors
    /// A sentence, if no picture can have this size.
    pub(crate) fn new(width: f32, height: f32, zoom: f32) -> Result<Self, String> {
        let mut pixels = Pixmap::new((width * zoom).round() as u32, (height * zoom).round() as u32)
            .ok_or("a picture of that size cannot be made")?;
        pixels.fill(Color::WHITE);
        Ok(Self {
            pixels,
            zoom,
            down: 0.0,
            clip: None,
            fonts: Fonts::load()?,
        })
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// A sentence, if encoding fails.
    pub(crate) fn to_png(&self) -> Result<Vec<u8>, String> {
        self.pixels.encode_png().map_err(|e| e.to_string())
    }

    /// Width in its own pixels.
    pub(crate) fn width(&self) -> u32 {
        self.pixels.width()
    }

    /// Height in its own pixels.
    pub(crate) fn height(&self) -> u32 {
        self.pixels.height()
    }

    /// The letters that it writes with.
    pub(crate) fn fonts(&self) -> &Fonts {
        &self.fonts
    }

    /// Its pixels, row by row. They are all opaque, as the ground is.
    pub(crate) fn to_rgb(&self) -> Vec<[u8; 3]> {
        let pixels = self.pixels.pixels().iter();
        pixels
            .map(|pixel| [pixel.red(), pixel.green(), pixel.blue()])
            .collect()
    }

    /// Lets another picture of the same size shine through: it alone is left at `t` 1.
    pub(crate) fn blend(&mut self, other: &Self, t: f32) {
        let paint = PixmapPaint {
            opacity: t,
            ..PixmapPaint::default()
        };
        let (other, transform) = (other.pixels.as_ref(), Transform::identity());
        self.pixels.draw_pixmap(0, 0, other, &paint, transform, None);
    }

    /// Draws everything lower from now on.
    pub(crate) fn move_down(&mut self, by: f32) {
        self.down += by;
    }

    /// Draws only within a rectangle from now on, given by its upper left corner and its size; with
    /// none everywhere.
    pub(crate) fn clip(&mut self, to: Option<(Point, Point)>) {
        self.clip = to.and_then(|(corner, size)| {
            let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
            let rect = tiny_skia::Rect::from_xywh(corner.x, corner.y, size.x, size.y)?;
            let path = PathBuilder::from_rect(rect);
            mask.fill_path(&path, FillRule::Winding, true, self.transform());
            Some(mask)
        });
    }

    /// A filled polygon with a line around it.
    pub(crate) fn polygon(&mut self, corners: &[Point], fill: Ink, line: Ink, width: f32) {
        let [first, rest @ ..] = corners else { return };
        let mut path = PathBuilder::new();
        path.move_to(first.x, first.y);
        rest.iter().for_each(|p| path.line_to(p.x, p.y));
        path.close();
        let Some(path) = path.finish() else { return };
        self.fill(&path, fill);
        let stroke = Stroke {
            width,
            line_join: tiny_skia::LineJoin::Round,
            ..Stroke::default()
        };
        let transform = self.transform();
        self.pixels
            .stroke_path(&path, &line.paint(), &stroke, transform, self.clip.as_ref());
    }

    /// A filled polygon.
    pub(crate) fn shape(&mut self, corners: &[Point], ink: Ink) {
        let [first, rest @ ..] = corners else { return };
        let mut path = PathBuilder::new();
        path.move_to(first.x, first.y);
        rest.iter().for_each(|p| path.line_to(p.x, p.y));
        path.close();
        if let Some(path) = path.finish() {
            self.fill(&path, ink);
        }
    }

    fn fill(&mut self, path: &tiny_skia::Path, ink: Ink) {
        let transform = self.transform();
        self.pixels.fill_path(
            path,
            &ink.paint(),
            FillRule::Winding,
            transform,
            self.clip.as_ref(),
        );
    }

    /// A line through points, with round ends and corners.
    pub(crate) fn line(&mut self, points: &[Point], width: f32, ink: Ink) {
        self.stroke(points, width, ink, None);
    }

    /// A dashed line through points.
    pub(crate) fn dashed(&mut self, points: &[Point], width: f32, dash: [f32; 2], ink: Ink) {
        self.stroke(points, width, ink, StrokeDash::new(dash.to_vec(), 0.0));
    }

    fn stroke(&mut self, points: &[Point], width: f32, ink: Ink, dash: Option<StrokeDash>) {
        let [first, rest @ ..] = points else { return };
        let mut path = PathBuilder::new();
        path.move_to(first.x, first.y);
        rest.iter().for_each(|p| path.line_to(p.x, p.y));
        let Some(path) = path.finish() else { return };
        let stroke = Stroke {
            width,
            line_cap: LineCap::Round,
            line_join: tiny_skia::LineJoin::Round,
            dash,
            ..Stroke::default()
        };
        let transform = self.transform();
        self.pixels
            .stroke_path(&path, &ink.paint(), &stroke, transform, self.clip.as_ref());
    }

    /// A filled disc.
    pub(crate) fn disc(&mut self, centre: Point, radius: f32, ink: Ink) {
        if let Some(path) = PathBuilder::from_circle(centre.x, centre.y, radius) {
            self.fill(&path, ink);
        }
    }

    /// A filled rectangle with round corners, from its upper left corner.
    pub(crate) fn panel(&mut self, corner: Point, size: Point, radius: f32, ink: Ink) {
        let (Point { x, y }, far) = (corner, corner + size);
        let mut path = PathBuilder::new();
        path.move_to(x + radius, y);
        path.line_to(far.x - radius, y);
        path.quad_to(far.x, y, far.x, y + radius);
        path.line_to(far.x, far.y - radius);
        path.quad_to(far.x, far.y, far.x - radius, far.y);
        path.line_to(x + radius, far.y);
        path.quad_to(x, far.y, x, far.y - radius);
        path.line_to(x, y + radius);
        path.quad_to(x, y, x + radius, y);
        path.close();
        if let Some(path) = path.finish() {
            self.fill(&path, ink);
        }
    }

    /// A line of text whose baseline starts, or has its middle at `at`.
    pub(crate) fn text(&mut self, text: &str, at: Point, set: Type) {
        let mut pen = match set.align {
            Align::Left => at.x,
            Align::Centre => at.x - self.fonts.width(text, set) / 2.0,
        };
        let font = self.fonts.of(set.weight);
        let scaled = font.as_scaled(scale(font, set.size));
        let unit = scaled.h_scale_factor();
        let mut path = PathBuilder::new();
        for letter in text.chars() {
            let glyph = font.glyph_id(letter);
            outline(font, glyph, Point::new(pen, at.y), unit, &mut path);
            pen += scaled.h_advance(glyph);
        }
        if let Some(path) = path.finish() {
            self.fill(&path, set.ink);
        }
    }

    fn transform(&self) -> Transform {
        Transform::from_translate(0.0, self.down).post_scale(self.zoom, self.zoom)
    }
}

/// The scale at which an em is `size` high; `ab_glyph` counts a line's height instead.
fn scale(font: &FontRef<'_>, size: f32) -> PxScale {
    let em = font.units_per_em().unwrap_or_else(|| font.height_unscaled());
    PxScale::from(size * font.height_unscaled() / em)
}

/// Adds a letter's outline, which comes as a run of curves with a jump between contours.
fn outline(font: &FontRef<'_>, glyph: GlyphId, pen: Point, unit: f32, path: &mut PathBuilder) {
    let Some(outline) = font.outline(glyph) else {
        return;
    };
    let place = |p: ab_glyph::Point| Point::new(pen.x + p.x * unit, pen.y - p.y * unit);
    let mut last = None;
    for curve in outline.curves {
        let (from, to) = match curve {
            OutlineCurve::Line(a, b) | OutlineCurve::Quad(a, _, b) | OutlineCurve::Cubic(a, _, _, b) => {
                (place(a), place(b))
            }
        };
        if last != Some(from) {
            path.move_to(from.x, from.y);
        }
        match curve {
            OutlineCurve::Line(..) => path.line_to(to.x, to.y),
            OutlineCurve::Quad(_, c, _) => path.quad_to(place(c).x, place(c).y, to.x, to.y),
            OutlineCurve::Cubic(_, c, d, _) => {
                path.cubic_to(place(c).x, place(c).y, place(d).x, place(d).y, to.x, to.y);
            }
        }
        last = Some(to);
    }
}
