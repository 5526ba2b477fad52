//! An object in a character's hand: its place from frame to frame, and how it is put down.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::fk::joint_transform;
use troupe_motion::ik::Posed;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::super::{FailReason, World};
use crate::object::{Definition, Socket};
use crate::scene::{MAX_COORDINATE_M, ScaledScene, Scene, SceneError, Transform};

/// Frames over which an object turns in the hand before it is put down.
const REST_FRAMES: f32 = 10.0;

/// The object that a character holds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Hand {
    pub(super) instance: Arc<str>,
    #[serde(with = "crate::saved::definition")]
    pub(super) definition: Arc<Definition>,
    /// Index of the variant that took the object.
    pub(super) variant: usize,
    /// Index of the socket in the definition.
    socket: usize,
    /// The frame at which the object was attached.
    since: i64,
    /// The object's place in the joint's frame of reference when it was attached.
    from: Transform,
    /// Its place in the socket, in the joint's frame of reference.
    held: Transform,
    /// The frame at which it is put down, and its place in the joint's frame of reference then.
    rest: Option<(i64, Transform)>,
}

/// Why an object could not be taken or put down.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Refused {
    pub(super) reason: FailReason,
    pub(super) message: String,
}

impl Hand {
    /// Takes the object `instance` into socket `socket`, at frame `frame`, which shows the pose
    /// `posed`.
    ///
    /// # Errors
    /// [`Refused`] if the object is not in the scene, or somebody else has it.
    pub(super) fn take(
        world: &World,
        skeleton: &Skeleton,
        instance: &Arc<str>,
        (definition, variant): (&Arc<Definition>, usize),
        socket: usize,
        frame: i64,
        posed: Posed<'_>,
    ) -> Result<Self, Refused> {
        let of = definition.sockets.get(socket).ok_or_else(|| Refused {
            reason: FailReason::Removed,
            message: format!("the definition {:?} has no socket {socket}", definition.name),
        })?;
        let taken = world.scene.update(|scene| {
            scene.hold(instance, &world.holder)?;
            scene
                .instance(instance)
                .map(|there| there.transform)
                .ok_or_else(|| SceneError::Unknown {
                    what: "object",
                    id: instance.to_string(),
                })
        });
        let there = taken.map_err(|error| Refused {
            reason: match error {
                SceneError::Unknown { .. } => FailReason::Removed,
                _ => FailReason::Taken,
            },
            message: error.to_string(),
        })?;
        let from = joint(skeleton, of, posed).inverse() * there.scaled(1.0 / world.scale);
        Ok(Self {
            instance: Arc::clone(instance),
            definition: Arc::clone(definition),
            variant,
            socket,
            since: frame,
            from,
            held: of.offset(from.rotation),
            rest: None,
        })
    }

    pub(super) fn socket(&self) -> Option<&Socket> {
        self.definition.sockets.get(self.socket)
    }

    /// The object's place in the world in a frame that shows `posed`. The frame may lie between two
    /// of the timeline.
    pub(super) fn transform(&self, skeleton: &Skeleton, frame: f64, posed: Posed<'_>) -> Transform {
        let Some(socket) = self.socket() else {
            return self.from;
        };
        let at = joint(skeleton, socket, posed) * self.offset(socket, frame);
        // It turns upright on its way into the socket, and is put down by its rule.
        let since = (frame - self.since as f64) as f32;
        let rest = self.rest.map_or(0.0, |(end, _)| rest_share(end, frame));
        self.raised(socket, at, socket.share(since) * (1.0 - rest))
    }

    /// An object at `at` turned upright about its middle by `share` of its tilt, if the socket
    /// keeps it upright.
    fn raised(&self, socket: &Socket, at: Transform, share: f32) -> Transform {
        if !socket.upright {
            return at;
        }
        let upright = Quat::from_rotation_arc(at.rotation * Vec3::Y, Vec3::Y) * at.rotation;
        let rotation = at.rotation.slerp(upright, share);
        let middle = self.definition.middle_m;
        Transform::new(at.point(middle) - rotation * middle, rotation)
    }

    /// The object's place in the joint's frame of reference. Frames are `f64`: a long session has
    /// more than an `f32` counts exactly.
    fn offset(&self, socket: &Socket, frame: f64) -> Transform {
        let since = (frame - self.since as f64) as f32;
        let held = socket.offset_at(self.from, self.held, since);
        let Some((end, rest)) = self.rest else {
            return held;
        };
        let share = rest_share(end, frame);
        Transform::new(
            held.position.lerp(rest.position, share),
            held.rotation.slerp(rest.rotation, share),
        )
    }

    /// How far up the object's middle moves when it is put down in a frame, metres (negative:
    /// down), and its place in the joint's frame of reference then. `None` if there is no place for
    /// it.
    pub(super) fn on_release(
        &self,
        scene: &ScaledScene,
        skeleton: &Skeleton,
        posed: Posed<'_>,
    ) -> Option<(f32, Transform)> {
        let socket = self.socket()?;
        let joint = joint(skeleton, socket, posed);
        let at = self.raised(socket, joint * self.held, 1.0);
        let found = (self.definition).place(scene.scene(), &self.instance, at.scaled(scene.scale()));
        let placed = found.ok()?.transform.scaled(1.0 / scene.scale());
        let middle = self.definition.middle_m;
        let lift = placed.point(middle).y - at.point(middle).y;
        Some((lift, joint.inverse() * placed))
    }

    /// Has the object turn in the hand to its final place: `rest.1` at frame `rest.0`, in the
    /// joint's frame of reference.
    pub(super) fn comes_to_rest(&mut self, rest: (i64, Transform)) {
        self.rest = Some(rest);
    }

    /// Keeps the object after all: from `frame` on it goes back to its socket.
    pub(super) fn stays(&mut self, frame: i64) {
        if let (Some(socket), Some(_)) = (self.socket(), self.rest) {
            self.from = self.offset(socket, frame as f64);
            (self.since, self.rest) = (frame, None);
        }
    }

    /// Puts the object down from `at` by its definition's rule, and returns its new place.
    ///
    /// # Errors
    /// [`Refused`] if there is no place for it, or it is no longer in the scene.
    pub(super) fn put_down(&self, world: &World, at: Transform) -> Result<Transform, Refused> {
        let scene = world.scene.snapshot();
        let placement = self
            .definition
            .place(&scene, &self.instance, at.scaled(world.scale))
            .map_err(|error| Refused {
                reason: FailReason::NoPlace,
                message: error.to_string(),
            })?;
        self.release(world, placement.transform)
    }

    /// Lets go of the object: puts it down by its rule, or, if there is no place for it, on
    /// whatever is below.
    pub(super) fn let_go(&self, world: &World, at: Transform) -> Option<Transform> {
        if let Ok(transform) = self.put_down(world, at) {
            return Some(transform);
        }
        let scene = world.scene.snapshot();
        let at = at.scaled(world.scale);
        let from = at.position + Vec3::Y * self.definition.release.lift_m;
        let below = scene.support(from, super::footing::DEEPEST_M, Some(&self.instance));
        let upright = Transform::upright(at.position, at.heading());
        let transform = match below {
            Some(hit) if !hit.is_inside() => {
                let lowest = self.definition.body.volume.lowest_along(upright, Vec3::Y);
                let lift = lowest.map_or(0.0, |lowest| upright.position.y - lowest);
                Transform::new(hit.point + Vec3::Y * lift, upright.rotation)
            }
            _ => upright,
        };
        self.release(world, transform).ok()
    }

    /// Frees the object in the scene, at `transform` in metres of the scene. If that is beyond the
    /// edge of the world, which a scene would refuse, it is freed at the edge. Returns its place in
    /// the character's metres.
    fn release(&self, world: &World, mut transform: Transform) -> Result<Transform, Refused> {
        let edge = Vec3::splat(MAX_COORDINATE_M);
        transform.position = transform.position.clamp(-edge, edge);
        let release = |scene: &mut Scene| scene.release(&self.instance, &world.holder, transform);
        world.scene.update(release).map_err(|error| Refused {
            reason: FailReason::Removed,
            message: error.to_string(),
        })?;
        Ok(transform.scaled(1.0 / world.scale))
    }
}

/// How far an object has turned towards being put down at frame `end`, 0 to 1.
fn rest_share(end: i64, frame: f64) -> f32 {
    let share = 1.0 + (frame - end as f64) as f32 / REST_FRAMES;
    smoothstep(share.clamp(0.0, 1.0))
}

/// The socket's joint in the world.
fn joint(skeleton: &Skeleton, socket: &Socket, posed: Posed<'_>) -> Transform {
    let (position, rotation) = joint_transform(skeleton, posed.root, posed.rotations, socket.joint);
    Transform::new(position, rotation)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{definitions, doll_rig};
    use super::*;

    /// A hand that has taken the doll's cup, into a socket that keeps it upright or not.
    fn hand(since: i64, upright: bool) -> Hand {
        let mut definition = (*definitions(&doll_rig()).get("cup").unwrap().definition).clone();
        definition.sockets[0].upright = upright;
        Hand {
            instance: "cup".into(),
            definition: Arc::new(definition),
            variant: 0,
            socket: 0,
            since,
            from: Transform::new(Vec3::X, Quat::IDENTITY),
            held: Transform::IDENTITY,
            rest: None,
        }
    }

    #[test]
    fn an_upright_object_turns_about_its_middle() {
        let rig = doll_rig();
        let joints = rig.skeleton.joint_count();
        let mut rotations = vec![Quat::IDENTITY; joints];
        rotations[0] = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.4);
        let posed = Posed {
            root: Vec3::Y,
            rotations: &rotations,
        };
        let at = |upright: bool, frame: f64| hand(0, upright).transform(&rig.skeleton, frame, posed);
        let tilt = |at: Transform| (at.rotation * Vec3::Y).angle_between(Vec3::Y);
        let (leans, stands) = (at(false, 60.0), at(true, 60.0));
        assert!((tilt(leans) - 0.7).abs() < 1e-3 && tilt(stands) < 1e-3);
        let middle = hand(0, true).definition.body.volume.center();
        assert!(leans.point(middle).distance(stands.point(middle)) < 1e-5);
        // It is taken as it lies, and turns upright on its way into the socket.
        assert!(at(true, 0.0).rotation.angle_between(at(false, 0.0).rotation) < 1e-3);
        let coming: Vec<f32> = (0..6).map(|frame| tilt(at(true, f64::from(frame)))).collect();
        assert!(
            coming.windows(2).all(|pair| pair[1] <= pair[0] + 1e-4),
            "{coming:?}"
        );
    }

    #[test]
    fn a_held_object_moves_smoothly_after_days() {
        let at = |since: i64| {
            let hand = Hand {
                rest: Some((since + 20, Transform::new(Vec3::Y, Quat::IDENTITY))),
                ..hand(since, false)
            };
            let socket = hand.socket().unwrap();
            let parts = (0..80).map(|quarter| since as f64 + 0.25 * f64::from(quarter));
            parts.map(|frame| hand.offset(socket, frame)).collect::<Vec<_>>()
        };
        assert_eq!(at(0), at(1 << 40));
    }
}
