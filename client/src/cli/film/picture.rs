//! The picture: the path with its poses in space, the path from above, and the poses one by one.

use glam::{Vec2, Vec3};
use troupe_motion::fk::WorldMotion;

use crate::cli::draw::canvas::{Align, Canvas, Ink, Point};
use crate::cli::draw::figure::{Camera, Figure};
use crate::cli::draw::house::{
    DARK, MARGIN, MUTED, PANEL, RULE, draw_legend, draw_scale, draw_title, heading, ramp, regular,
};
use crate::cli::drive::Take;

/// Width of the layout; pictures of other sizes scale it.
pub(super) const WIDTH: f32 = 1600.0;

const SCENE_CORNER: Point = Vec2::new(MARGIN, 104.0);
const SCENE_WIDTH: f32 = 1068.0;
/// Around what is in the scene: heads reach above their joints.
const SCENE_RIM: Point = Vec2::new(10.0, 30.0);
const PLAN_CORNER: Point = Vec2::new(1140.0, 104.0);
const PLAN_WIDTH: f32 = 420.0;
const PLAN_RIM: Point = Vec2::new(54.0, 68.0);
/// Heights of scene and plan: a way that goes straight ahead needs little.
const HEIGHTS: std::ops::RangeInclusive<f32> = 236.0..=476.0;
/// From scene to strip, and the height of one of its rows.
const STRIP_GAP: f32 = 24.0;
const ROW: f32 = 288.0;
/// Poses of a row at most.
const ROW_POSES: usize = 20;
/// Height of a standing figure in the strip, pixels.
const TALL: f32 = 200.0;
/// How far the camera of the scene looks down, radians.
const PITCH: f32 = 0.5;

/// Colours of styles, in the order in which they come.
const STYLE_INKS: [Ink; 8] = [
    Ink::hex(0x1b_6f_d8),
    Ink::hex(0xd8_43_8c),
    Ink::hex(0xf0_8c_00),
    Ink::hex(0x2f_9e_44),
    Ink::hex(0x7a_4d_d8),
    Ink::hex(0x0c_85_99),
    Ink::hex(0xe0_31_31),
    Ink::hex(0x86_8e_20),
];

/// What to draw.
pub(super) struct Film<'a> {
    pub(super) title: String,
    pub(super) subtitle: String,
    pub(super) take: &'a Take,
    /// Poses at equal steps of time.
    pub(super) poses: usize,
    /// Layout to pixels.
    pub(super) zoom: f32,
}

/// What all parts of the picture share.
struct Parts {
    motion: WorldMotion,
    figure: Figure,
    camera: Camera,
    /// The frames that are drawn.
    frames: Vec<usize>,
    /// Styles in the order in which they come.
    styles: Vec<String>,
    ground_y: f32,
    /// Height of scene and plan.
    height: f32,
}

impl Film<'_> {
    /// Draws the picture as a PNG file.
    ///
    /// # Errors
    /// A sentence, where the size is not one that a picture can have.
    pub(super) fn to_png(&self) -> Result<Vec<u8>, String> {
        let clip = &self.take.clip;
        let frames = self.frames();
        let rows = frames.len().div_ceil(ROW_POSES);
        let mut styles = Vec::new();
        for order in &self.take.told {
            if !styles.contains(&order.style) {
                styles.push(order.style.clone());
            }
        }
        let mut parts = Parts {
            motion: WorldMotion::from_clip(clip),
            figure: Figure::new(&clip.skeleton),
            camera: self.camera(),
            frames,
            styles,
            ground_y: clip.skeleton.ground_y_m,
            height: *HEIGHTS.end(),
        };
        parts.height = self.height(&parts);
        let strip_top = SCENE_CORNER.y + parts.height + STRIP_GAP;
        let mut canvas = Canvas::new(WIDTH, strip_top + ROW * rows as f32 + 4.0, self.zoom)?;
        draw_title(&mut canvas, &self.title, &self.subtitle);
        self.draw_legend(&mut canvas, &parts);
        self.draw_scene(&mut canvas, &parts);
        self.draw_plan(&mut canvas, &parts);
        for (row, frames) in parts.frames.chunks(parts.frames.len().div_ceil(rows)).enumerate() {
            let ground = strip_top + ROW * row as f32 + 226.0;
            self.draw_row(&mut canvas, &parts, ground, frames);
        }
        canvas.to_png()
    }

    /// Frames at equal steps of time, from the first to the last.
    fn frames(&self) -> Vec<usize> {
        let last = self.take.clip.frames() - 1;
        let steps = (self.poses.max(2) - 1).min(last.max(1));
        (0..=steps).map(|i| (last * i + steps / 2) / steps).collect()
    }

    /// Looks across the way's longest extent.
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
        // Direction of the greater principal axis, as a heading from +z to +x.
        let mut across = 0.5 * (2.0 * xz).atan2(zz - xx);
        // From left to right as the clip begins to go.
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

    /// The colour of a frame: of its style where there are several, else of its time.
    fn ink(&self, parts: &Parts, frame: usize) -> Ink {
        if parts.styles.len() > 1 {
            let style = self.take.order_at(frame).map(|order| &order.style);
            let nth = parts
                .styles
                .iter()
                .position(|s| Some(s) == style)
                .unwrap_or_default();
            return STYLE_INKS[nth % STYLE_INKS.len()];
        }
        ramp(frame as f32 / (self.take.clip.frames() - 1).max(1) as f32)
    }

    fn draw_legend(&self, canvas: &mut Canvas, parts: &Parts) {
        let label = regular(16.0, DARK, Align::Left);
        let mut pen = WIDTH - MARGIN;
        let name = "commanded";
        pen -= canvas.text_width(name, label);
        canvas.text(name, Point::new(pen, 50.0), label);
        canvas.dashed(
            &[Point::new(pen - 46.0, 44.5), Point::new(pen - 12.0, 44.5)],
            3.0,
            [1.0, 7.0],
            MUTED,
        );
        pen -= 72.0;
        let styled = parts.styles.iter().enumerate().rev();
        let entries: Vec<_> = if parts.styles.len() > 1 {
            styled
                .map(|(i, style)| (style.as_str(), vec![STYLE_INKS[i % STYLE_INKS.len()]]))
                .collect()
        } else {
            let inks = (0..7).map(|i| ramp(i as f32 / 6.0)).collect();
            vec![("from start to end", inks)]
        };
        draw_legend(canvas, pen, 16.0, entries);
    }

    /// The root's way on the ground as pieces of one colour.
    fn draw_way(&self, canvas: &mut Canvas, parts: &Parts, width: f32, pixel: impl Fn(Vec3) -> Point) {
        let way = self.take.clip.root_positions.iter();
        let way = way
            .map(|p| pixel(Vec3::new(p.x, parts.ground_y, p.z)))
            .collect::<Vec<_>>();
        for (frame, pair) in way.windows(2).enumerate() {
            canvas.line(pair, width, self.ink(parts, frame + 1));
        }
    }

    /// The commanded way, at the ground's height.
    fn commanded(&self, parts: &Parts) -> impl Iterator<Item = Vec3> {
        let ground_y = parts.ground_y;
        self.take
            .commanded
            .iter()
            .map(move |p| Vec3::new(p.x, ground_y, p.y))
    }

    /// All that is in the scene, on the picture's plane, metres.
    fn scene(&self, parts: &Parts) -> impl Iterator<Item = Vec2> {
        let joints = parts.frames.iter().flat_map(|&f| parts.motion.positions_at(f));
        let seen = joints.copied().chain(self.commanded(parts));
        seen.map(|p| parts.camera.project(p))
    }

    /// All that is on the plan, metres.
    fn plan(&self, parts: &Parts) -> impl Iterator<Item = Vec2> {
        let roots = self.take.clip.root_positions.iter().copied();
        roots.chain(self.commanded(parts)).map(|p| parts.camera.plan(p))
    }

    /// The height that scene and plan need for the largest scale that their widths allow.
    fn height(&self, parts: &Parts) -> f32 {
        let needed =
            |extent: Vec2, width: f32, rim: Point| extent.y * (width - 2.0 * rim.x) / extent.x + 2.0 * rim.y;
        let scene = needed(extent(self.scene(parts)).1, SCENE_WIDTH, SCENE_RIM);
        let plan = needed(extent(self.plan(parts)).1, PLAN_WIDTH, PLAN_RIM);
        scene.max(plan).clamp(*HEIGHTS.start(), *HEIGHTS.end())
    }

    /// The whole way in space, with the poses where they are.
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

        let commanded = self.commanded(parts).map(pixel).collect::<Vec<_>>();
        canvas.dashed(&commanded, 3.0, [1.0, 7.0], MUTED);
        let at = fit.pixel(Vec2::ZERO);
        for &frame in &parts.frames {
            parts
                .figure
                .draw_shadow(canvas, camera, parts.motion.positions_at(frame), at, fit.scale);
        }
        self.draw_way(canvas, parts, 4.0, pixel);
        let mut far_first = parts.frames.clone();
        let nearness = |frame: usize| camera.nearness(self.take.clip.root_at(frame).projected());
        far_first.sort_by(|&a, &b| nearness(a).total_cmp(&nearness(b)));
        for frame in far_first {
            let ink = self.ink(parts, frame);
            parts.figure.draw(
                canvas,
                camera,
                parts.motion.positions_at(frame),
                at,
                fit.scale,
                ink,
            );
        }
    }

    /// The root's path from above.
    fn draw_plan(&self, canvas: &mut Canvas, parts: &Parts) {
        let size = Point::new(PLAN_WIDTH, parts.height);
        canvas.panel(PLAN_CORNER, size, 12.0, PANEL);
        canvas.text("From above", PLAN_CORNER + Point::new(22.0, 36.0), heading(18.0));
        let camera = &parts.camera;
        let fit = Fit::new(
            self.plan(parts),
            PLAN_CORNER + PLAN_RIM,
            size - 2.0 * PLAN_RIM,
            200.0,
        );
        let pixel = |p: Vec3| fit.pixel(camera.plan(p));

        let commanded = self.commanded(parts).map(pixel).collect::<Vec<_>>();
        canvas.dashed(&commanded, 3.0, [1.0, 7.0], MUTED);
        self.draw_way(canvas, parts, 4.5, pixel);
        let way = self.take.clip.root_positions.iter().map(|&p| pixel(p));
        let mut labels = Labels {
            taken: way.chain(commanded).collect(),
            placed: Vec::new(),
        };
        for &frame in &parts.frames {
            let root = self.take.clip.root_at(frame);
            let (at, ink) = (pixel(root.projected()), self.ink(parts, frame));
            canvas.line(&[at, at + camera.plan(root.forward()) * 17.0], 2.5, ink);
            canvas.disc(at, 6.5, PANEL);
            canvas.disc(at, 5.0, ink);
            if let Some(place) = labels.place(at) {
                let text = format!("{:.0} s", frame as f32 / self.take.clip.fps);
                canvas.text(
                    &text,
                    place + Point::new(0.0, 4.5),
                    regular(13.0, MUTED, Align::Centre),
                );
            }
        }
        let bar = PLAN_CORNER + Point::new(22.0, size.y - 22.0);
        draw_scale(canvas, bar, fit.scale);
    }

    /// Some of the poses side by side, seen as in the scene.
    fn draw_row(&self, canvas: &mut Canvas, parts: &Parts, ground: f32, frames: &[usize]) {
        let clip = &self.take.clip;
        let tops = parts.motion.positions.iter().map(|p| p.y - parts.ground_y);
        let scale = TALL / (tops.fold(1.2_f32, f32::max) + 0.15);
        let slot = (WIDTH - 2.0 * MARGIN) / frames.len() as f32;
        let line = [Point::new(MARGIN, ground), Point::new(WIDTH - MARGIN, ground)];
        canvas.line(&line, 1.0, RULE);
        let mut before = None;
        for (nth, &frame) in frames.iter().enumerate() {
            let at = Point::new(MARGIN + slot * (nth as f32 + 0.5), ground);
            let root = clip.root_positions[frame];
            let origin = Vec3::new(root.x, parts.ground_y, root.z);
            let places = parts
                .motion
                .positions_at(frame)
                .iter()
                .map(|&p| p - origin)
                .collect::<Vec<_>>();
            let camera = Camera::new(self.side(), 0.35, 0.16);
            let ink = self.ink(parts, frame);
            parts.figure.draw_shadow(canvas, &camera, &places, at, scale);
            parts.figure.draw(canvas, &camera, &places, at, scale, ink);
            let time = format!("{:.1} s", frame as f32 / clip.fps);
            canvas.text(
                &time,
                at + Point::new(0.0, 34.0),
                regular(15.0, DARK, Align::Centre),
            );
            let style = self.take.order_at(frame).map(|order| order.style.as_str());
            if style != before {
                canvas.text(
                    style.unwrap_or_default(),
                    at + Point::new(0.0, 53.0),
                    regular(14.0, ink, Align::Centre),
                );
            }
            before = style;
        }
    }

    /// The heading that faces right in the strip: where it goes first.
    fn side(&self) -> f32 {
        let roots = &self.take.clip.root_positions;
        let first = roots.first().copied().unwrap_or_default();
        let away = roots.iter().find(|p| p.distance(first) > 0.5);
        away.map_or_else(
            || self.take.clip.root_at(0).heading,
            |p| (p.x - first.x).atan2(p.z - first.z),
        )
    }
}

/// Middles of short texts beside a line.
struct Labels {
    /// The line's points.
    taken: Vec<Point>,
    placed: Vec<Point>,
}

impl Labels {
    /// Where a text beside a point of the line is farthest from the line and from other texts; none where it would lie on
    /// another.
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
