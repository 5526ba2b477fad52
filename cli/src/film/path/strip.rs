//! The strip: poses side by side, each with the things around it.

use glam::Vec3;
use troupe_proto::v1::session_event::Kind;

use super::picture::{Parts, PathPicture, WIDTH};
use crate::graphics::canvas::{Align, Canvas, Point};
use crate::graphics::figure::Camera;
use crate::graphics::theme::{DARK, MARGIN, RULE, regular};
use crate::scenery::Thing;
use crate::take::Event;

/// Height of a standing figure, pixels.
const TALL: f32 = 200.0;
/// From the upper edge of a row to its ground line.
const GROUND: f32 = 226.0;
/// Things farther from the character than this are not drawn beside it, metres: objects, and
/// colliders.
const FAR_M: [f32; 2] = [1.5, 0.8];
/// Pixels below the ground line for things before the character. Labels follow there.
const BELOW: f32 = 19.0;
/// Turn of the camera away from a side view, and its pitch down, radians.
const TURN: f32 = 0.35;
const PITCH: f32 = 0.16;

impl PathPicture<'_> {
    /// Draws poses side by side, in a row below `top`.
    pub(super) fn draw_row(&self, canvas: &mut Canvas, parts: &Parts, top: f32, frames: &[usize]) {
        let ground = top + GROUND;
        let slot = (WIDTH - 2.0 * MARGIN) / frames.len() as f32;
        let line = [Point::new(MARGIN, ground), Point::new(WIDTH - MARGIN, ground)];
        canvas.line(&line, 1.0, RULE);
        let mut before = None;
        for (nth, &frame) in frames.iter().enumerate() {
            let corner = Point::new(MARGIN + slot * nth as f32, top);
            self.draw_pose(canvas, parts, (corner, slot), frame);
            let at = Point::new(corner.x + slot / 2.0, ground);
            let time = format!("{:.1} s", frame as f32 / self.take.clip.fps);
            canvas.text(
                &time,
                at + Point::new(0.0, 34.0),
                regular(15.0, DARK, Align::Centre),
            );
            let label = self.label(frame);
            if label != before {
                let ink = self.ink(parts, frame);
                canvas.text(
                    label.unwrap_or_default(),
                    at + Point::new(0.0, 53.0),
                    regular(14.0, ink, Align::Centre),
                );
            }
            before = label;
        }
    }

    /// The label of a pose: in a scene the set of keyframes that the character goes through, else
    /// its style.
    fn label(&self, frame: usize) -> Option<&str> {
        if self.scenery.is_some() {
            let after = self.take.events.partition_point(|event| event.frame <= frame);
            return self.take.events[..after].iter().rev().find_map(phase);
        }
        self.take.order_at(frame).map(|order| order.style.as_str())
    }

    /// Draws one pose on its surface, with the things around it.
    fn draw_pose(&self, canvas: &mut Canvas, parts: &Parts, (corner, slot): (Point, f32), frame: usize) {
        let (heading, turn) = self.side();
        let camera = Camera::new(heading, turn, PITCH);
        let scale = self.scale(parts);
        let at = corner + Point::new(slot / 2.0, GROUND);
        let root = self.take.clip.root_positions[frame];
        let origin = Vec3::new(root.x, parts.levels[frame], root.z);
        let places = parts.motion.positions_at(frame);
        let places = places.iter().map(|&p| p - origin).collect::<Vec<_>>();
        let pixel = |p: Vec3| at + camera.project(p - origin) * scale;

        let mut things = self.things(frame);
        things.retain(|thing| {
            let [objects, others] = FAR_M;
            let far_m = if thing.id.is_some() { objects } else { others };
            thing.in_hand || thing.solid.distance(root) < far_m
        });
        let nearness = |thing: &Thing<'_>| {
            let (least, most) = thing.solid.bounds();
            camera.nearness(((least + most) / 2.0 - root).with_y(0.0))
        };
        things.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
        // Things under it and beyond it are behind it.
        let is_behind = |thing: &Thing<'_>| {
            !thing.in_hand && (nearness(thing) < 0.0 || thing.solid.bounds().1.y < origin.y + 0.05)
        };
        let (behind, mut before): (Vec<_>, Vec<_>) = things.into_iter().partition(is_behind);
        // No other thing hides an object in the hand.
        before.sort_by_key(|thing| thing.in_hand);
        let room = (corner, Point::new(slot, GROUND + BELOW));
        let draw = |canvas: &mut Canvas, things: &[Thing<'_>], opacity: f32| {
            canvas.clip((!things.is_empty()).then_some(room));
            for thing in things {
                let opacity = if thing.in_hand { 1.0 } else { opacity };
                let paint = thing.paint.alpha(opacity);
                thing
                    .solid
                    .draw(canvas, paint, |normal| camera.nearness(normal) > 0.0, pixel);
            }
            canvas.clip(None);
        };
        draw(canvas, &behind, 1.0);
        parts.figure.draw_shadow(canvas, &camera, &places, at, scale);
        let ink = self.ink(parts, frame);
        parts.figure.draw(canvas, &camera, &places, at, scale, ink);
        draw(canvas, &before, 0.45);
    }

    /// Pixels of a metre.
    fn scale(&self, parts: &Parts) -> f32 {
        let joints = parts.motion.joints;
        let heights = parts.levels[self.range.clone()].iter().zip(self.range.clone());
        let top = heights.fold(1.2_f32, |top, (level, frame)| {
            let places = &parts.motion.positions[frame * joints..(frame + 1) * joints];
            places.iter().map(|p| p.y - level).fold(top, f32::max)
        });
        TALL / (top + 0.15)
    }

    /// The heading that is to the right in the strip, and the turn of the camera. The heading is
    /// that of the first keyframe that the character reaches, or else of its first steps. The turn
    /// puts the object that it uses there behind it.
    fn side(&self) -> (f32, f32) {
        let clip = &self.take.clip;
        let reached =
            |event: &&Event| matches!(event.kind, Kind::Reached(_)) && self.range.contains(&event.frame);
        if let Some(event) = self.take.events.iter().find(reached) {
            let root = clip.root_at(event.frame);
            let ahead = self
                .things(event.frame)
                .into_iter()
                .filter(|thing| thing.is_used)
                .any(|thing| {
                    let (least, most) = thing.solid.bounds();
                    root.forward().dot((least + most) / 2.0 - root.position) > 0.0
                });
            return (root.heading, if ahead { -TURN } else { TURN });
        }
        let roots = &clip.root_positions;
        let first = roots.first().copied().unwrap_or_default();
        let away = roots.iter().find(|p| p.distance(first) > 0.5);
        let heading = away.map_or_else(
            || clip.root_at(0).heading,
            |p| (p.x - first.x).atan2(p.z - first.z),
        );
        (heading, TURN)
    }
}

/// The label from an event on. Empty if an activity ends, None if the event changes nothing.
fn phase(event: &Event) -> Option<&str> {
    match &event.kind {
        Kind::Started(_) => Some("approach"),
        Kind::Entered(of) => Some(&of.set),
        Kind::Fell(_) => Some("fall"),
        Kind::Performing(of) => Some(&of.text),
        Kind::Done(_) | Kind::Failed(_) | Kind::Interrupted(_) | Kind::Landed(_) | Kind::Performed(_) => {
            Some("")
        }
        Kind::Reached(_) | Kind::Attached(_) | Kind::Released(_) | Kind::Arrived(_) | Kind::Bounded(_) => {
            None
        }
    }
}
