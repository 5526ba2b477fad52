//! The moving picture: a ground with a grid, and characters on it.

use glam::Vec3;
use troupe_motion::fk::WorldMotion;

use super::mannequin::Mannequin;
use super::view::{Look, View};
use crate::graphics::animation::Animation;
use crate::graphics::canvas::{Align, Canvas, Fonts, Ink, Point};
use crate::graphics::header::Header;
use crate::graphics::theme::{DARK, MARGIN, PANEL, RULE, STYLE_INKS, regular};
use crate::scenery::{Scenery, Thing};
use crate::take::{CrowdTake, Recorded};

/// Width of the layout; pictures of other sizes scale it.
pub(super) const WIDTH: f32 = 1000.0;
/// Heights of a header of two lines, of the ground, and of the margin below.
const TOP: f32 = 92.0;
const GROUND_HEIGHT: f32 = 430.0;
const BELOW: f32 = 20.0;
const CORNERS: f32 = 12.0;
/// Frames a second of the take.
const TAKE_FPS: usize = 60;
/// Time of the fade from the end into the beginning.
const FADE_S: f32 = 0.3;
/// Reach of the grid. Its lines are a metre apart.
const GRID_M: i16 = 9;
/// From the middle of a head up to its label, metres.
const LABEL_M: f32 = 0.24;
const LABEL_SIZE: f32 = 13.0;
/// A thing counts as farther away by this, so that a character on it is drawn later, metres.
const SEAT_M: f32 = 0.3;

/// The moving picture of a cast.
pub(super) struct CastPicture<'a> {
    pub(super) title: String,
    pub(super) take: &'a CrowdTake,
    pub(super) scenery: Option<Scenery>,
    pub(super) from_s: f32,
    pub(super) seconds: f32,
    pub(super) fps: u16,
    /// Layout to pixels.
    pub(super) zoom: f32,
}

/// A character, ready to be drawn.
struct Actor<'a> {
    motion: WorldMotion,
    mannequin: Mannequin,
    recorded: &'a Recorded,
    ink: Ink,
}

impl CastPicture<'_> {
    /// Number of frames in the animation.
    pub(super) fn frame_count(&self) -> usize {
        (self.seconds * f32::from(self.fps)).round() as usize
    }

    /// Draws the animation as a PNG file, and calls `drawn` after each frame.
    ///
    /// # Errors
    /// A sentence, if no picture can have this size.
    pub(super) fn to_png(&self, drawn: impl Fn()) -> Result<Vec<u8>, String> {
        let actors: Vec<Actor<'_>> = (self.take.members.iter().zip(STYLE_INKS.iter().cycle()))
            .map(|(recorded, ink)| Actor {
                motion: WorldMotion::from_clip(&recorded.clip),
                mannequin: Mannequin::new(&recorded.clip.skeleton),
                recorded,
                ink: *ink,
            })
            .collect();
        let (ground, view) = self.ground()?;
        let count = self.frame_count();
        let fade = ((FADE_S * f32::from(self.fps)) as usize).min(count / 2);
        let step = TAKE_FPS / usize::from(self.fps);
        let first = (self.from_s * TAKE_FPS as f32) as usize;
        let draw = |at: usize| {
            let mut canvas = ground.clone();
            self.draw_all(&mut canvas, &view, &actors, at);
            canvas
        };
        let mut animation = Animation::new(ground.width(), ground.height(), self.fps);
        for nth in 0..count {
            let at = first + nth * step;
            let mut canvas = draw(at);
            // The last frames fade into those before the first.
            if let Some(into) = (nth + fade).checked_sub(count) {
                let before = draw(at - count * step);
                canvas.blend(&before, (into + 1) as f32 / (fade + 1) as f32);
            }
            animation.push(canvas.to_rgb());
            drawn();
        }
        animation.to_png()
    }

    /// Characters by pack, and plans.
    fn subtitle(&self) -> String {
        let packs: Vec<String> = (self.take.members.chunk_by(|a, b| a.pack == b.pack))
            .map(|of| format!("{} {}", of.len(), of[0].pack))
            .collect();
        format!(
            "{} sessions of one server: {} · {} plans in {:.0} s",
            self.take.members.len(),
            packs.join(", "),
            self.take.plans,
            self.from_s + self.seconds,
        )
    }

    /// The parts that do not move, and the camera.
    fn ground(&self) -> Result<(Canvas, View), String> {
        let subtitle = self.subtitle();
        let header = Header::new(&Fonts::load()?, WIDTH - MARGIN, (&self.title, &subtitle), &[]);
        let height = header.extra_height() + TOP + GROUND_HEIGHT + BELOW;
        let mut canvas = Canvas::new(WIDTH, height, self.zoom)?;
        header.draw(&mut canvas);
        let corner = Point::new(MARGIN / 2.0, TOP);
        let size = Point::new(WIDTH - MARGIN, GROUND_HEIGHT);
        let view = View::new(Look {
            at: Vec3::new(0.0, 0.5, 0.0),
            distance_m: 15.0,
            heading: std::f32::consts::PI + 0.4,
            pitch: 0.5,
            scale: 82.0,
            centre: corner + size / 2.0,
        });
        canvas.panel(corner, size, CORNERS, PANEL);
        canvas.clip(Some((corner, size)));
        draw_grid(&mut canvas, &view);
        Ok((canvas, view))
    }

    /// Characters and things at a frame of the take, the farthest first.
    fn draw_all(&self, canvas: &mut Canvas, view: &View, actors: &[Actor<'_>], at: usize) {
        let things: Vec<Thing<'_>> = self
            .scenery
            .iter()
            .flat_map(|scenery| scenery.things(at))
            .collect();
        let shadow = PANEL.mix(DARK, 0.12);
        for actor in actors {
            let places = actor.motion.positions_at(at);
            actor.mannequin.draw_shadow(canvas, view, places, shadow);
        }
        let mut order: Vec<(f32, Piece<'_, '_>)> = Vec::new();
        order.extend(actors.iter().map(|actor| {
            let depth = view.depth(actor.motion.positions_at(at)[0].with_y(0.0));
            (depth, Piece::Actor(actor))
        }));
        order.extend(things.iter().map(|thing| {
            let (least, most) = thing.solid.bounds();
            let depth = view.depth(((least + most) / 2.0).with_y(0.0));
            (depth + SEAT_M, Piece::Thing(thing))
        }));
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, piece) in &order {
            match piece {
                Piece::Actor(actor) => {
                    let places = actor.motion.positions_at(at);
                    actor.mannequin.draw(canvas, view, places, actor.ink, PANEL);
                }
                Piece::Thing(thing) => {
                    let is_seen = |normal: Vec3| view.sees(normal);
                    thing
                        .solid
                        .draw(canvas, thing.paint, is_seen, |place| view.pixel(place));
                }
            }
        }
        for actor in actors {
            actor.draw_label(canvas, view, at);
        }
    }
}

/// Something that hides things behind it.
enum Piece<'a, 'b> {
    Actor(&'a Actor<'b>),
    Thing(&'a Thing<'a>),
}

impl Actor<'_> {
    /// Writes the style above the head, or the sentence that it acts out.
    fn draw_label(&self, canvas: &mut Canvas, view: &View, at: usize) {
        let labels = &self.recorded.labels;
        let after = labels.partition_point(|(frame, _)| *frame <= at);
        let Some((_, label)) = after.checked_sub(1).map(|nth| &labels[nth]) else {
            return;
        };
        let head = self.mannequin.head(self.motion.positions_at(at));
        let above = view.pixel(head + Vec3::Y * LABEL_M);
        let ink = self.ink.mix(DARK, 0.3);
        let letters = regular(LABEL_SIZE, ink, Align::Centre);
        let size = Point::new(canvas.fonts().width(label, letters) + 8.0, LABEL_SIZE + 3.0);
        let corner = above.round() - Point::new(size.x / 2.0, LABEL_SIZE - 1.0);
        canvas.panel(corner, size, 4.0, PANEL.alpha(0.8));
        canvas.text(label, above.round(), letters);
    }
}

/// Draws lines a metre apart, which fade with their distance from the middle.
fn draw_grid(canvas: &mut Canvas, view: &View) {
    let reach = f32::from(GRID_M);
    let ground = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    for nth in -GRID_M..=GRID_M {
        let across = f32::from(nth);
        for piece in -GRID_M..GRID_M {
            let along = f32::from(piece);
            let ends = [
                [ground(across, along), ground(across, along + 1.0)],
                [ground(along, across), ground(along + 1.0, across)],
            ];
            for [from, to] in ends {
                let far = ((from + to) / 2.0).length() / reach;
                let ink = PANEL.mix(RULE, (1.2 - 1.3 * far).clamp(0.0, 1.0));
                canvas.line(&[view.pixel(from), view.pixel(to)], 1.0, ink);
            }
        }
    }
}
