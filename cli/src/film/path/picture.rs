//! The picture: the path in space with poses on it, the path from above, and the poses one by one.

use std::ops::RangeInclusive;

use glam::{Vec2, Vec3};
use troupe_motion::fk::WorldMotion;

use crate::graphics::canvas::{Align, Canvas, Fonts, Ink, Point};
use crate::graphics::figure::{Camera, Figure};
use crate::graphics::header::{Entry, Header, Mark};
use crate::graphics::theme::{DARK, MARGIN, MUTED, PANEL, STYLE_INKS, draw_scale, heading, ramp, regular};
use crate::scenery::{Scenery, Solid, Thing};
use crate::take::Take;

/// Width of the layout; pictures of other sizes scale it.
pub(super) const WIDTH: f32 = 1600.0;

const SCENE_CORNER: Point = Vec2::new(MARGIN, 104.0);
const SCENE_WIDTH: f32 = 1068.0;
/// Margin around the contents of the scene, because heads reach above their joints.
const SCENE_RIM: Point = Vec2::new(10.0, 30.0);
const PLAN_CORNER: Point = Vec2::new(1140.0, 104.0);
const PLAN_WIDTH: f32 = 420.0;
const PLAN_RIM: Point = Vec2::new(54.0, 68.0);
/// Heights of scene and plan. A way straight ahead needs little.
const HEIGHTS: RangeInclusive<f32> = 236.0..=476.0;
/// From scene to strip, and the height of one of its rows.
const STRIP_GAP: f32 = 24.0;
const ROW: f32 = 288.0;
/// Most poses of a row. In a scene they need room for the things around them.
const ROW_POSES: usize = 20;
const SCENE_POSES: usize = 6;
/// Things nearer to the way than this are shown, metres, with this much of them around the way.
const NEAR_M: f32 = 0.4;
const AROUND_M: f32 = 0.8;
/// Poses that stand nearer to each other than this hide each other, metres.
const APART_M: f32 = 0.3;
/// Pitch of the camera of the scene, down, radians.
const PITCH: f32 = 0.5;

/// The picture of a take.
pub(super) struct PathPicture<'a> {
    pub(super) title: String,
    pub(super) subtitle: String,
    pub(super) take: &'a Take,
    /// The scene of the take.
    pub(super) scenery: Option<Scenery>,
    /// Number of poses, at equal steps of time.
    pub(super) poses: usize,
    /// Frames of the first and the last pose.
    pub(super) range: RangeInclusive<usize>,
    /// Layout to pixels.
    pub(super) zoom: f32,
}

/// What all parts of the picture share.
pub(super) struct Parts {
    pub(super) motion: WorldMotion,
    pub(super) figure: Figure,
    camera: Camera,
    /// Frames of the poses.
    frames: Vec<usize>,
    /// Styles in the order in which they come.
    pub(super) styles: Vec<String>,
    /// Height of the surface under the character in every frame, metres.
    pub(super) levels: Vec<f32>,
    /// Height of scene and plan.
    height: f32,
}

impl PathPicture<'_> {
    /// Draws the picture as a PNG file.
    ///
    /// # Errors
    /// A sentence, if no picture can have this size.
    pub(super) fn to_png(&self) -> Result<Vec<u8>, String> {
        let clip = &self.take.clip;
        let frames = self.frames();
        let in_row = if self.scenery.is_some() {
            SCENE_POSES
        } else {
            ROW_POSES
        };
        let rows = frames.len().div_ceil(in_row);
        let mut styles = Vec::new();
        for order in &self.take.orders {
            if !styles.contains(&order.style) {
                styles.push(order.style.clone());
            }
        }
        let motion = WorldMotion::from_clip(clip);
        let mut parts = Parts {
            levels: self.levels(&motion),
            motion,
            figure: Figure::new(&clip.skeleton),
            camera: self.camera(),
            frames,
            styles,
            height: *HEIGHTS.end(),
        };
        parts.height = self.height(&parts);
        let strip_top = SCENE_CORNER.y + parts.height + STRIP_GAP;
        let entries = self.legend(&parts.styles);
        let header = Header::new(
            &Fonts::load()?,
            WIDTH - MARGIN,
            (&self.title, &self.subtitle),
            &entries,
        );
        let height = header.extra_height() + strip_top + ROW * rows as f32 + 4.0;
        let mut canvas = Canvas::new(WIDTH, height, self.zoom)?;
        header.draw(&mut canvas);
        self.draw_scene(&mut canvas, &parts);
        self.draw_plan(&mut canvas, &parts);
        for (row, frames) in parts.frames.chunks(parts.frames.len().div_ceil(rows)).enumerate() {
            self.draw_row(&mut canvas, &parts, strip_top + ROW * row as f32, frames);
        }
        canvas.to_png()
    }

    /// Frames at equal steps of time, from the first of the range to its last.
    fn frames(&self) -> Vec<usize> {
        let (first, last) = (*self.range.start(), *self.range.end());
        let length = last.saturating_sub(first);
        let steps = (self.poses.max(2) - 1).min(length.max(1));
        let nth = |i| first + (length * i + steps / 2) / steps;
        (0..=steps).map(nth).collect()
    }

    /// Height of the surface under the character in every frame, metres.
    fn levels(&self, motion: &WorldMotion) -> Vec<f32> {
        let clip = &self.take.clip;
        let level = |frame: usize| {
            let Some(scenery) = &self.scenery else {
                return clip.skeleton.ground_y_m;
            };
            let joints = motion.positions_at(frame).iter();
            let root = clip.root_positions[frame];
            let feet = joints.fold(root, |least, p| if p.y < least.y { *p } else { least });
            scenery.level(Vec3::new(root.x, feet.y, root.z))
        };
        (0..clip.frames()).map(level).collect()
    }

    /// The things of the scene at a frame.
    pub(super) fn things(&self, frame: usize) -> Vec<Thing<'_>> {
        let stage = self.scenery.as_ref();
        stage
            .map(|stage| stage.things(frame).collect())
            .unwrap_or_default()
    }

    /// A camera that looks across the longest extent of the way.
    fn camera(&self) -> Camera {
        let ground = self.take.clip.root_positions.iter().map(|p| Vec2::new(p.x, p.z));
        let ground = ground
            .chain(self.take.commanded.iter().copied())
            .collect::<Vec<_>>();
        let mean = ground.iter().sum::<Vec2>() / ground.len().max(1) as f32;
        let (mut xx, mut xz, mut zz) = (0.0, 0.0, 0.0);
        for p in ground.iter().map(|p| *p - mean) {
            (xx, xz, zz) = (xx + p.x * p.x, xz + p.x * p.y, zz + p.y * p.y);
        }
        // Direction of the larger principal axis, as a heading from +z to +x.
        let mut across = 0.5 * (2.0 * xz).atan2(zz - xx);
        // The clip should begin to go from left to right.
        let (first, way) = (
            ground.first().copied().unwrap_or_default(),
            Vec2::new(across.sin(), across.cos()),
        );
        let middle = ground
            .iter()
            .find(|p| p.distance(first) > 0.5)
            .copied()
            .unwrap_or(first);
        if (middle - first).dot(way) < 0.0 {
            across += std::f32::consts::PI;
        }
        Camera::new(across, 0.0, PITCH)
    }

    /// The colour of a frame: that of its style if there are several, else of its time.
    pub(super) fn ink(&self, parts: &Parts, frame: usize) -> Ink {
        if parts.styles.len() > 1 {
            let style = self.take.order_at(frame).map(|order| &order.style);
            let nth = parts
                .styles
                .iter()
                .position(|s| Some(s) == style)
                .unwrap_or_default();
            return STYLE_INKS[nth % STYLE_INKS.len()];
        }
        let (first, last) = (*self.range.start(), *self.range.end());
        ramp(((frame as f32 - first as f32) / (last - first).max(1) as f32).clamp(0.0, 1.0))
    }

    /// Names of the styles, or the meaning of the colours of one style, and the commanded way.
    fn legend<'s>(&self, styles: &'s [String]) -> Vec<Entry<'s>> {
        let mut entries: Vec<Entry<'s>> = match styles {
            [_, _, ..] => {
                let inks = STYLE_INKS.iter().cycle();
                let entry = |(name, ink): (&'s String, &Ink)| Entry {
                    mark: Mark::Discs(vec![*ink]),
                    name,
                };
                styles.iter().zip(inks).map(entry).collect()
            }
            _ => vec![Entry {
                mark: Mark::Discs((0..7).map(|i| ramp(i as f32 / 6.0)).collect()),
                name: "from start to end",
            }],
        };
        if !self.take.commanded.is_empty() {
            entries.push(Entry {
                mark: Mark::Dotted(MUTED),
                name: "commanded",
            });
        }
        entries
    }

    /// The root's way on the ground as pieces of one colour.
    fn draw_way(&self, canvas: &mut Canvas, parts: &Parts, width: f32, pixel: impl Fn(Vec3) -> Point) {
        let way = self.take.clip.root_positions.iter().zip(&parts.levels);
        let way = way
            .map(|(p, &level)| pixel(Vec3::new(p.x, level, p.z)))
            .collect::<Vec<_>>();
        for (frame, pair) in way.windows(2).enumerate() {
            canvas.line(pair, width, self.ink(parts, frame + 1));
        }
    }

    /// The commanded way, at the ground's height.
    fn commanded(&self) -> impl Iterator<Item = Vec3> {
        let stage = self.scenery.as_ref();
        let ground_y = stage.map_or(self.take.clip.skeleton.ground_y_m, |stage| stage.ground_m);
        self.take
            .commanded
            .iter()
            .map(move |p| Vec3::new(p.x, ground_y, p.y))
    }

    /// Corners of the things beside the way, as far as they are near it.
    fn surroundings(&self) -> Vec<Vec3> {
        let way = &self.take.clip.root_positions;
        let (least, most) = way
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, m), p| {
                (l.min(*p), m.max(*p))
            });
        let around = Vec3::new(AROUND_M, 100.0, AROUND_M);
        let mut corners = Vec::new();
        for thing in self.things(*self.range.end()) {
            let is_near = || way.iter().any(|p| thing.solid.distance(*p) < NEAR_M);
            if thing.is_used || is_near() {
                corners.extend(
                    thing
                        .solid
                        .corners()
                        .map(|p| p.clamp(least - around, most + around)),
                );
            }
        }
        corners
    }

    /// All points of the scene in the plane of the picture, metres.
    fn scene(&self, parts: &Parts) -> impl Iterator<Item = Vec2> {
        let joints = parts.frames.iter().flat_map(|&f| parts.motion.positions_at(f));
        let seen = joints.copied().chain(self.commanded()).chain(self.surroundings());
        seen.map(|p| parts.camera.project(p))
    }

    /// All points of the plan, metres.
    fn plan(&self, parts: &Parts) -> impl Iterator<Item = Vec2> {
        let roots = self.take.clip.root_positions.iter().copied();
        let seen = roots.chain(self.commanded()).chain(self.surroundings());
        seen.map(|p| parts.camera.plan(p))
    }

    /// The height that scene and plan need for the largest scale that their widths allow.
    fn height(&self, parts: &Parts) -> f32 {
        let needed =
            |extent: Vec2, width: f32, rim: Point| extent.y * (width - 2.0 * rim.x) / extent.x + 2.0 * rim.y;
        let scene = needed(extent(self.scene(parts)).1, SCENE_WIDTH, SCENE_RIM);
        let plan = needed(extent(self.plan(parts)).1, PLAN_WIDTH, PLAN_RIM);
        scene.max(plan).clamp(*HEIGHTS.start(), *HEIGHTS.end())
    }

    /// Draws the whole way in space, with poses on it.
    fn draw_scene(&self, canvas: &mut Canvas, parts: &Parts) {
        let camera = &parts.camera;
        let size = Point::new(SCENE_WIDTH, parts.height);
        let fit = Fit::new(
            self.scene(parts),
            SCENE_CORNER + SCENE_RIM,
            size - 2.0 * SCENE_RIM,
            150.0,
        );
        let pixel = |p: Vec3| fit.pixel(camera.project(p));

        canvas.clip(self.scenery.is_some().then_some((SCENE_CORNER, size)));
        let mut things = self.things(*self.range.end());
        things.sort_by(|a, b| nearness(camera, &a.solid).total_cmp(&nearness(camera, &b.solid)));
        let (above, below): (Vec<_>, Vec<_>) = things.iter().partition(|thing| thing.id.is_some());
        for thing in below {
            let is_seen = |normal| camera.nearness(normal) > 0.0;
            thing.solid.draw(canvas, thing.paint, is_seen, pixel);
        }
        let commanded = self.commanded().map(pixel).collect::<Vec<_>>();
        canvas.dashed(&commanded, 3.0, [1.0, 7.0], MUTED);
        let mut figures = self.apart(parts);
        let stands = |frame: usize| self.take.clip.root_at(frame).projected();
        figures.sort_by(|&a, &b| camera.nearness(stands(a)).total_cmp(&camera.nearness(stands(b))));
        for &frame in &figures {
            let (places, at) = on_level(parts, frame, &fit);
            parts.figure.draw_shadow(canvas, camera, &places, at, fit.scale);
        }
        self.draw_way(canvas, parts, 4.0, pixel);
        let mut above = above.into_iter().peekable();
        let mut draw_things = |canvas: &mut Canvas, until: f32| {
            while let Some(thing) = above.next_if(|thing| nearness(camera, &thing.solid) < until) {
                thing
                    .solid
                    .draw(canvas, thing.paint, |normal| camera.nearness(normal) > 0.0, pixel);
            }
        };
        for frame in figures {
            draw_things(canvas, camera.nearness(stands(frame)));
            let (places, at) = on_level(parts, frame, &fit);
            let ink = self.ink(parts, frame);
            parts.figure.draw(canvas, camera, &places, at, fit.scale, ink);
        }
        draw_things(canvas, f32::INFINITY);
        canvas.clip(None);
    }

    /// The frames to draw in the scene. With things around it the character may stay long in a
    /// place, so only frames that stand apart are drawn.
    fn apart(&self, parts: &Parts) -> Vec<usize> {
        let mut drawn = Vec::<usize>::new();
        for &frame in &parts.frames {
            let roots = &self.take.clip.root_positions;
            let is_apart = drawn
                .iter()
                .all(|&before| roots[before].distance(roots[frame]) > APART_M);
            if self.scenery.is_none() || is_apart {
                drawn.push(frame);
            }
        }
        drawn
    }

    /// The root's path from above.
    fn draw_plan(&self, canvas: &mut Canvas, parts: &Parts) {
        let size = Point::new(PLAN_WIDTH, parts.height);
        canvas.panel(PLAN_CORNER, size, 12.0, PANEL);
        let camera = &parts.camera;
        let fit = Fit::new(
            self.plan(parts),
            PLAN_CORNER + PLAN_RIM,
            size - 2.0 * PLAN_RIM,
            200.0,
        );
        let pixel = |p: Vec3| fit.pixel(camera.plan(p));

        canvas.clip(self.scenery.is_some().then_some((PLAN_CORNER, size)));
        let things = self.things(*self.range.end());
        for thing in &things {
            thing
                .solid
                .draw(canvas, thing.paint, |normal| normal.y > 0.01, pixel);
        }
        let commanded = self.commanded().map(pixel).collect::<Vec<_>>();
        canvas.dashed(&commanded, 3.0, [1.0, 7.0], MUTED);
        self.draw_way(canvas, parts, 4.5, pixel);
        canvas.clip(None);
        let way = self.take.clip.root_positions.iter().map(|&p| pixel(p));
        let mut labels = Labels {
            taken: way.chain(commanded).collect(),
            placed: Vec::new(),
        };
        let figures = self.apart(parts);
        for &frame in &parts.frames {
            let root = self.take.clip.root_at(frame);
            let (at, ink) = (pixel(root.projected()), self.ink(parts, frame));
            canvas.line(&[at, at + camera.plan(root.forward()) * 17.0], 2.5, ink);
            canvas.disc(at, 6.5, PANEL);
            canvas.disc(at, 5.0, ink);
            // Where it stays, one time is enough.
            if !figures.contains(&frame) {
                continue;
            }
            if let Some(place) = labels.place(at) {
                let digits = usize::from(self.scenery.is_some());
                let text = format!("{:.digits$} s", frame as f32 / self.take.clip.fps);
                canvas.text(
                    &text,
                    place + Point::new(0.0, 4.5),
                    regular(13.0, MUTED, Align::Centre),
                );
            }
        }
        for thing in things.iter().filter(|thing| thing.is_used) {
            let corners = thing.solid.corners().map(pixel);
            let (least, size) = extent(corners);
            let at = least + Point::new(size.x / 2.0, size.y + 16.0);
            canvas.text(
                thing.id.unwrap_or_default(),
                at,
                regular(13.0, DARK, Align::Centre),
            );
        }
        canvas.text("From above", PLAN_CORNER + Point::new(22.0, 36.0), heading(18.0));
        let bar = PLAN_CORNER + Point::new(22.0, size.y - 22.0);
        draw_scale(canvas, bar, fit.scale);
    }
}

/// How near a solid's middle is.
fn nearness(camera: &Camera, solid: &Solid) -> f32 {
    let (least, most) = solid.bounds();
    camera.nearness((least + most) / 2.0)
}

/// A pose's joints over what it stands on, and where on the picture that is.
fn on_level(parts: &Parts, frame: usize, fit: &Fit) -> (Vec<Vec3>, Point) {
    let level = Vec3::Y * parts.levels[frame];
    let places = parts.motion.positions_at(frame).iter().map(|&p| p - level);
    (places.collect(), fit.pixel(parts.camera.project(level)))
}

/// Middles of short texts beside a line.
struct Labels {
    /// The line's points.
    taken: Vec<Point>,
    placed: Vec<Point>,
}

impl Labels {
    /// Where a text beside a point of the line is farthest from the line and from other texts; none
    /// where it would lie on another.
    fn place(&mut self, at: Point) -> Option<Point> {
        let around = (0..8).map(|i| {
            let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            at + Point::new(cos * 27.0, sin * 19.0)
        });
        let room = |p: Point| {
            let from = |q: &Point| (p - *q).length();
            let line = self.taken.iter().map(from).fold(30.0, f32::min);
            self.placed.iter().map(from).fold(line, f32::min)
        };
        let best = around.max_by(|&a, &b| room(a).total_cmp(&room(b)))?;
        let free = self.placed.iter().all(|p| (best - *p).length() > 26.0);
        free.then(|| {
            self.placed.push(best);
            best
        })
    }
}

/// The least corner of points and their extent, which is never nothing.
fn extent(points: impl Iterator<Item = Vec2>) -> (Vec2, Vec2) {
    let (mut least, mut greatest) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for point in points {
        (least, greatest) = (least.min(point), greatest.max(point));
    }
    (least, (greatest - least).max(Vec2::splat(0.05)))
}

/// From metres on a plane to pixels in a box, as large as fits.
struct Fit {
    scale: f32,
    middle: Vec2,
    centre: Point,
}

impl Fit {
    /// Fits points into a box; at most `most` pixels make a metre.
    fn new(points: impl Iterator<Item = Vec2>, corner: Point, size: Point, most: f32) -> Self {
        let (least, extent) = extent(points);
        Self {
            scale: (size / extent).min_element().min(most),
            middle: least + extent / 2.0,
            centre: corner + size / 2.0,
        }
    }

    fn pixel(&self, point: Vec2) -> Point {
        self.centre + (point - self.middle) * self.scale
    }
}
