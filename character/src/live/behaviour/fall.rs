//! Falling: if the ground ends, the character follows the path of a projectile and lands.

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;
use troupe_motion::ballistic::{self, Drop, MAX_FALL_S, Throw, fall_motion};
use troupe_motion::ik::Posed;

use super::super::buffer::Frames;
use super::super::{CROSSFADE_FRAMES, EventKind, FailReason};
use super::carry::RAMP_FRAMES;
use super::footing::DEEPEST_M;
use super::hand::Refused;
use super::{Behaviour, CharacterParts, Doing, Next};
use crate::primitives::recipe::STANDING_MPS;
use crate::scene::{RayHit, ScaledScene};

/// Frames over which the velocity at the edge is measured.
const VELOCITY_FRAMES: i64 = 3;

/// Hips must be at this share of their standing height before a landed character moves on: the
/// networks do not know lower poses.
const UP_SHARE: f32 = 0.85;

/// A surface whose normal points up by less than this is a wall, and no place to land.
const LEAST_UP: f32 = 0.6;
/// Distance that the root keeps from a wall that it falls against, metres.
const OFF_WALL_M: f32 = 0.25;
/// How far beyond the landing, and how high, walls are looked for, metres: the body needs some way
/// to come to rest.
const WAY_OUT_M: f32 = 0.8;
const SHIN_M: f32 = 0.3;

/// A fall, from the frame after the edge until the character is upright again.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Fall {
    /// First frame with the feet on the ground.
    touches: i64,
    landed: bool,
    /// First frame after the landing with the hips as high as the networks know them. A character
    /// that is to move goes on from here.
    up: i64,
    /// Last frame: locomotion goes on from here in any case.
    upright: i64,
    height_m: f32,
    impact_mps: f32,
}

impl Behaviour {
    /// Writes the fall into the buffer from frame `frame` on. Answers whether the character falls:
    /// not without anything to land on.
    pub(super) fn begin_fall(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) -> bool {
        // In the metres of a large body things fall more slowly. The fall is worked out in a time
        // of its own, in which they fall at the usual rate: one of its seconds lasts `second_s`.
        let second_s = scene.scale().sqrt();
        let (fps, level) = (parts.rig.fps * second_s, parts.post.footing.level());
        let shown = parts.shown(frame);
        let velocity = parts.velocity(frame, VELOCITY_FRAMES) * second_s;
        let Some(landing) = landing(scene, shown.root.with_y(level), velocity, fps) else {
            return false;
        };
        let floor = landing.floor_m;
        let style = &parts.locomotion.command().style;
        let idle = style.idle();
        // Joints fade over from the motion under way, as with any plan. The root keeps its
        // velocity.
        let goes_on = (1..=CROSSFADE_FRAMES as i64).flat_map(|step| parts.shown(frame + step).rotations);
        let under_way: Vec<_> = goes_on.collect();
        let drop = Drop {
            velocity,
            floor_m: floor,
            wall_s: landing.wall_s,
            standing: Posed {
                root: Vec3::Y * idle.height_m,
                rotations: &idle.rotations,
            },
            under_way: &under_way,
            air: None,
            fps,
        };
        let legs = parts.post.footing.legs();
        let mut fall = fall_motion(&parts.rig.skeleton, legs, shown.posed(), &drop);
        if fall.motion.roots.is_empty() {
            return false;
        }
        for root in &mut fall.motion.roots {
            root.y -= floor;
        }
        self.fall_on_the_way(frame, parts);
        let frames = Frames {
            roots: &fall.motion.roots,
            rotations: &fall.motion.rotations,
            contacts: &fall.motion.contacts,
        };
        parts.timeline.forget_flight();
        parts.timeline.put(frame, frames, false);
        parts.post.footing.level_from(frame, floor);
        parts.post.carry.rest(frame, RAMP_FRAMES);
        let height_m = level - floor;
        let up = up_again(&fall);
        self.events.push(
            frame,
            EventKind::Fell {
                height_m: Some(height_m),
            },
        );
        self.doing = Doing::Falling(Fall {
            touches: frame + 1 + fall.touch_down as i64,
            landed: false,
            up: frame + 1 + up as i64,
            upright: frame + fall.motion.roots.len() as i64,
            height_m,
            impact_mps: fall.impact_mps / second_s,
        });
        parts.hold(frame.max(self.upright() - parts.timeline.look_ahead()));
        true
    }

    fn upright(&self) -> i64 {
        match &self.doing {
            Doing::Falling(fall) => fall.upright,
            _ => i64::MIN,
        }
    }

    /// Fails an approach that a fall breaks off.
    fn fall_on_the_way(&mut self, frame: i64, parts: &mut CharacterParts<'_>) {
        let message = "the ground ended on the way".to_owned();
        let reason = FailReason::NotReached;
        self.fail(frame, parts, Refused { reason, message });
    }

    /// Asks for no plan before the character is upright, or nearly so if it is to move. Then
    /// locomotion goes on with its command, and with any command that came during the fall.
    pub(super) fn settle_fall(&mut self, frame: i64, parts: &mut CharacterParts<'_>) -> Next {
        let Doing::Falling(fall) = &mut self.doing else {
            return Next::Locomotion;
        };
        let lands = !fall.landed && frame >= fall.touches;
        fall.landed |= lands;
        let fall = *fall;
        if lands {
            let (height_m, speed_mps) = (fall.height_m, fall.impact_mps);
            self.events
                .push(fall.touches, EventKind::Landed { height_m, speed_mps });
        }
        let command = parts.locomotion.command();
        let moves = command.velocity.length() >= STANDING_MPS && self.waiting.is_none();
        let until = if moves && fall.landed {
            fall.up
        } else {
            fall.upright
        };
        if frame + parts.timeline.look_ahead() < until {
            return Next::Wait;
        }
        self.doing = Doing::Locomotion;
        let command = command.clone();
        parts.move_on(frame, command, false);
        if let Some(intent) = self.waiting.take() {
            self.take_up(intent, frame, parts);
        }
        Next::Locomotion
    }
}

/// The frame of a fall at which the hips are up again, or nearly so.
fn up_again(fall: &ballistic::Fall) -> usize {
    let roots = &fall.motion.roots;
    let last = roots.len() - 1;
    let is_up = |&frame: &usize| roots[frame].y >= UP_SHARE * roots[last].y;
    (fall.lowest..last).find(is_up).unwrap_or(last)
}

/// The end of a fall.
struct Landing {
    floor_m: f32,
    /// As in [`Drop`], seconds.
    wall_s: Option<f32>,
}

/// Where a body that leaves from `foot`, the ground point under its root, lands. At a wall it falls
/// straight down, and stands on whatever is there, however steep.
fn landing(scene: &ScaledScene, foot: Vec3, velocity: Vec3, fps: f32) -> Option<Landing> {
    let throw = Throw {
        position: foot,
        velocity,
    };
    let mut wall = None;
    let ground = |a: Vec3, b: Vec3| {
        let hit = scene.cast_ray(a, b - a, a.distance(b), None)?;
        if hit.is_inside() {
            return None;
        }
        wall = is_wall(&hit).then_some(hit.point);
        Some(hit.point.y)
    };
    let met = throw.lands(fps, MAX_FALL_S, ground)?;
    let over_ground = velocity.with_y(0.0);
    let speed = over_ground.length();
    // Seconds of travel over the ground that keep it off a wall at `point`.
    let stops_s = |point: Vec3| {
        let far = (point - foot).with_y(0.0).length();
        (far - OFF_WALL_M).max(0.0) / speed.max(STANDING_MPS)
    };
    if let Some(point) = wall {
        let wall_s = stops_s(point);
        let below = scene.support(throw.at(wall_s), DEEPEST_M / scene.scale(), None)?;
        return (!below.is_inside()).then_some(Landing {
            floor_m: below.point.y,
            wall_s: Some(wall_s),
        });
    }
    let ahead = scene.cast_ray(met.place + Vec3::Y * SHIN_M, over_ground, WAY_OUT_M, None);
    Some(Landing {
        floor_m: met.place.y,
        wall_s: ahead.filter(is_wall).map(|hit| stops_s(hit.point)),
    })
}

fn is_wall(hit: &RayHit) -> bool {
    !hit.is_inside() && hit.normal.y < LEAST_UP
}
