//! The picture: a strip of generated poses, a strip of the clip's own poses below, and the path of
//! the root from above.

use glam::{Vec2, Vec3};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;

use crate::graphics::canvas::{Align, Canvas, Fonts, Ink, Point};
use crate::graphics::figure::{Camera, Figure};
use crate::graphics::header::{Entry, Header, Mark};
use crate::graphics::theme::{MARGIN, MUTED, PANEL, RULE, draw_scale, heading, ramp, regular};

/// Size of the layout; pictures of other sizes scale it.
pub(super) const WIDTH: f32 = 1600.0;
pub(super) const HEIGHT: f32 = 720.0;

const STRIP_END: f32 = 1236.0;
const PLAN_CORNER: Point = Vec2::new(1268.0, 104.0);
const PLAN_SIZE: Point = Vec2::new(292.0, 590.0);

const CONTEXT: Ink = Ink::hex(0x6b_75_80);
const TARGET: Ink = Ink::hex(0xf0_8c_00);
const TRUTH: Ink = Ink::hex(0xb4_be_ca);

/// The kind of a frame of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
enum FrameKind {
    Context,
    /// With the part of the gap before it, 0 to 1.
    Generated(f32),
    Target,
}

impl FrameKind {
    fn ink(self) -> Ink {
        match self {
            Self::Context => CONTEXT,
            Self::Generated(t) => ramp(t),
            Self::Target => TARGET,
        }
    }
}

/// A segment: context frames, gap, target frames.
pub(super) struct Segment<'a> {
    pub(super) clip: &'a Clip,
    pub(super) context_frames: usize,
    pub(super) target_frames: usize,
    /// Number of the first frame in the whole clip.
    pub(super) first_frame: usize,
}

impl Segment<'_> {
    fn kind(&self, frame: usize) -> FrameKind {
        let end = self.clip.frames() - self.target_frames;
        if frame < self.context_frames {
            FrameKind::Context
        } else if frame >= end {
            FrameKind::Target
        } else {
            let steps = (end - self.context_frames).saturating_sub(1).max(1);
            FrameKind::Generated((frame - self.context_frames) as f32 / steps as f32)
        }
    }

    /// The frames in each slot of the strip: all context frames, `poses` of the gap, all target
    /// frames.
    fn slots(&self, poses: usize) -> Vec<Vec<usize>> {
        let (from, end) = (self.context_frames - 1, self.clip.frames() - self.target_frames);
        let mut slots = vec![(0..self.context_frames).collect::<Vec<_>>()];
        let mut last = from;
        for pose in 1..=poses {
            let frame = from + ((end - from) * pose * 2 + poses + 1) / (2 * poses + 2);
            if frame > last && frame < end {
                slots.push(vec![frame]);
                last = frame;
            }
        }
        slots.push((end..self.clip.frames()).collect());
        slots
    }
}

/// The picture of a gap.
pub(super) struct GapPicture<'a> {
    pub(super) title: String,
    pub(super) subtitle: String,
    /// Text above the generated strip.
    pub(super) caption: String,
    pub(super) generated: Segment<'a>,
    pub(super) truth: Segment<'a>,
    /// Generated poses in a strip.
    pub(super) poses: usize,
    /// Layout to pixels.
    pub(super) zoom: f32,
}

/// A strip of poses.
struct Strip<'a> {
    segment: &'a Segment<'a>,
    caption: [&'a str; 2],
    /// Height of the ground line in the layout.
    ground: f32,
    /// Colour of the poses in the gap. None: each has the colour of its kind.
    ghost: Option<Ink>,
}

impl GapPicture<'_> {
    /// Draws the picture as a PNG file.
    ///
    /// # Errors
    /// A sentence, if no picture can have this size.
    pub(super) fn to_png(&self) -> Result<Vec<u8>, String> {
        let entries = Self::legend();
        let header = Header::new(
            &Fonts::load()?,
            WIDTH - MARGIN,
            (&self.title, &self.subtitle),
            &entries,
        );
        let mut canvas = Canvas::new(WIDTH, HEIGHT + header.extra_height(), self.zoom)?;
        let camera = self.camera();
        let motions = [&self.generated, &self.truth].map(|s| WorldMotion::from_clip(s.clip));
        let top = motions
            .iter()
            .flat_map(|m| &m.positions)
            .fold(1.2_f32, |top, p| top.max(p.y));
        let scale = 208.0 / (top + 0.15);

        header.draw(&mut canvas);
        let strips = [
            Strip {
                segment: &self.generated,
                caption: ["Troupe", &self.caption],
                ground: 346.0,
                ghost: None,
            },
            Strip {
                segment: &self.truth,
                caption: ["Ground truth", "the same frames of the clip"],
                ground: 656.0,
                ghost: Some(TRUTH),
            },
        ];
        for (strip, motion) in strips.iter().zip(&motions) {
            self.draw_strip(&mut canvas, &camera, strip, motion, scale);
        }
        self.draw_plan(&mut canvas, &camera);
        canvas.to_png()
    }

    /// A camera that looks along the way of the clip, or along its facing if it stays.
    fn camera(&self) -> Camera {
        let clip = self.truth.clip;
        let roots = clip.roots();
        let (Some(first), Some(last)) = (roots.first(), roots.last()) else {
            return Camera::new(0.0, 0.0, 0.0);
        };
        let way = last.projected() - first.projected();
        if way.length() > 0.6 {
            return Camera::new(way.x.atan2(way.z), 0.5, 0.16);
        }
        let facing = roots.iter().map(|r| r.forward()).sum::<Vec3>();
        Camera::new(facing.x.atan2(facing.z), 0.85, 0.16)
    }

    /// The meaning of the colours.
    fn legend() -> [Entry<'static>; 3] {
        let generated = (0..7)
            .map(|i| FrameKind::Generated(i as f32 / 6.0).ink())
            .collect();
        [
            ("context frames", vec![CONTEXT]),
            ("generated", generated),
            ("target keyframe", vec![TARGET]),
        ]
        .map(|(name, inks)| Entry {
            mark: Mark::Discs(inks),
            name,
        })
    }

    fn draw_strip(
        &self,
        canvas: &mut Canvas,
        camera: &Camera,
        strip: &Strip<'_>,
        motion: &WorldMotion,
        scale: f32,
    ) {
        let segment = strip.segment;
        let head = heading(18.0);
        let caption = Point::new(MARGIN, strip.ground - 232.0);
        canvas.text(strip.caption[0], caption, head);
        let after = Point::new(canvas.fonts().width(strip.caption[0], head) + 12.0, 0.0);
        canvas.text(
            strip.caption[1],
            caption + after,
            regular(16.0, MUTED, Align::Left),
        );

        let figure = Figure::new(&segment.clip.skeleton);
        let ground_y = segment.clip.skeleton.ground_y_m;
        let slots = segment.slots(self.poses);
        let width = (STRIP_END - MARGIN) / slots.len() as f32;
        let place = |slot: usize| Point::new(MARGIN + width * (slot as f32 + 0.5), strip.ground);
        let pose = |frame: usize| {
            let root = segment.clip.root_positions[frame];
            let origin = Vec3::new(root.x, ground_y, root.z);
            motion
                .positions_at(frame)
                .iter()
                .map(|&p| p - origin)
                .collect::<Vec<_>>()
        };

        canvas.line(
            &[
                Point::new(MARGIN, strip.ground),
                Point::new(STRIP_END, strip.ground),
            ],
            1.0,
            RULE,
        );
        for (slot, frames) in slots.iter().enumerate() {
            let Some(&last) = frames.last() else { continue };
            figure.draw_shadow(canvas, camera, &pose(last), place(slot), scale);
        }
        for (slot, frames) in slots.iter().enumerate() {
            for (nth, &frame) in frames.iter().enumerate() {
                let kind = segment.kind(frame);
                let ink = match (kind, strip.ghost) {
                    (FrameKind::Generated(_), Some(ghost)) => ghost,
                    _ => kind.ink(),
                };
                // Earlier context frames are pale behind the last one.
                let fade = if nth + 1 == frames.len() { 1.0 } else { 0.25 };
                figure.draw(canvas, camera, &pose(frame), place(slot), scale, ink.alpha(fade));
            }
            let Some(&frame) = frames.last() else { continue };
            let number = segment.first_frame + frame;
            let label = if slot == 0 {
                format!("frame {number}")
            } else {
                number.to_string()
            };
            let ink = if strip.ghost.is_some() {
                MUTED
            } else {
                segment.kind(frame).ink()
            };
            canvas.text(
                &label,
                place(slot) + Point::new(0.0, 38.0),
                regular(15.0, ink, Align::Centre),
            );
        }
    }

    /// The root's path from above, generated over ground truth.
    fn draw_plan(&self, canvas: &mut Canvas, camera: &Camera) {
        canvas.panel(PLAN_CORNER, PLAN_SIZE, 12.0, PANEL);
        let head = heading(18.0);
        canvas.text("Root path from above", PLAN_CORNER + Point::new(22.0, 36.0), head);

        let paths = [&self.truth, &self.generated].map(|segment| {
            segment
                .clip
                .root_positions
                .iter()
                .map(|&p| camera.plan(p))
                .collect::<Vec<_>>()
        });
        let (mut least, mut most) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for point in paths.iter().flatten() {
            (least, most) = (least.min(*point), most.max(*point));
        }
        let room = PLAN_SIZE - Point::new(72.0, 190.0);
        let extent = (most - least).max(Vec2::splat(0.05));
        let scale = (room / extent).min_element().min(room.x / 0.8);
        let middle = PLAN_CORNER + Point::new(PLAN_SIZE.x / 2.0, 60.0 + room.y / 2.0);
        let pixel = |p: Vec2| middle + (p - (least + most) / 2.0) * scale;

        let truth = paths[0].iter().map(|&p| pixel(p)).collect::<Vec<_>>();
        canvas.dashed(&truth, 3.0, [1.0, 7.0], MUTED);
        let generated = paths[1].iter().map(|&p| pixel(p)).collect::<Vec<_>>();
        for (frame, pair) in generated.windows(2).enumerate() {
            canvas.line(pair, 4.5, self.generated.kind(frame + 1).ink());
        }
        self.draw_headings(canvas, camera, &generated);
        draw_plan_legend(canvas, scale);
    }

    /// A dot on the path for each drawn pose, with its heading.
    fn draw_headings(&self, canvas: &mut Canvas, camera: &Camera, path: &[Point]) {
        for frames in self.generated.slots(self.poses) {
            let Some(&frame) = frames.last() else { continue };
            let (at, ink) = (path[frame], self.generated.kind(frame).ink());
            let facing = camera.plan(self.generated.clip.root_at(frame).forward());
            canvas.line(&[at, at + facing * 19.0], 2.5, ink);
            canvas.disc(at, 7.5, PANEL);
            canvas.disc(at, 6.0, ink);
        }
    }
}

/// The scale of the plan, and the meaning of its lines.
fn draw_plan_legend(canvas: &mut Canvas, scale: f32) {
    let corner = PLAN_CORNER + Point::new(22.0, PLAN_SIZE.y - 88.0);
    let label = regular(15.0, MUTED, Align::Left);
    for (row, (name, solid)) in [("generated", true), ("ground truth", false)]
        .into_iter()
        .enumerate()
    {
        let at = corner + Point::new(0.0, row as f32 * 24.0);
        let line = [at - Point::new(0.0, 5.0), at + Point::new(34.0, -5.0)];
        if solid {
            canvas.line(&line, 4.5, ramp(0.5));
        } else {
            canvas.dashed(&line, 3.0, [1.0, 7.0], MUTED);
        }
        canvas.text(name, at + Point::new(46.0, 0.0), label);
    }
    draw_scale(canvas, corner + Point::new(0.0, 62.0), scale);
}
