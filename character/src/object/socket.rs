//! An object in a socket, where it moves with a joint.

use troupe_motion::Quat;
use troupe_motion::interpolate::smoothstep;

use super::Socket;
use crate::scene::Transform;

impl Socket {
    /// The object's place in the joint's frame of reference, once it is in the socket. It had the
    /// rotation `taken` in that frame when it was taken.
    pub fn offset(&self, taken: Quat) -> Transform {
        Transform::new(self.position_m, self.rotation.unwrap_or(taken))
    }

    /// The object's place in the joint's frame of reference, `frames` after it was attached. It
    /// moves from `from` to `to`, its place in the socket ([`Socket::offset`]), over
    /// [`Socket::blend_frames`], starting and ending slowly.
    pub fn offset_at(&self, from: Transform, to: Transform, frames: f32) -> Transform {
        let eased = self.share(frames);
        Transform::new(
            from.position.lerp(to.position, eased),
            from.rotation.slerp(to.rotation, eased),
        )
    }

    /// Share of the way into the socket, `frames` after an object was attached: 0 to 1, starting
    /// and ending slowly.
    pub fn share(&self, frames: f32) -> f32 {
        smoothstep(match self.blend_frames {
            0 => 1.0,
            blend => (frames / blend as f32).clamp(0.0, 1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::any_transform;
    use proptest::prelude::*;
    use troupe_motion::Vec3;

    fn grip(blend_frames: u32) -> Socket {
        Socket {
            name: "grip".to_owned(),
            joint: 1,
            position_m: Vec3::new(0.02, -0.1, 0.0),
            rotation: Some(Quat::from_rotation_z(0.5)),
            blend_frames,
            swings: false,
            upright: false,
        }
    }

    proptest! {
        #[test]
        fn it_keeps_its_rotation_if_the_socket_has_none(from in any_transform(0.5)) {
            let given = grip(8);
            let free = Socket { rotation: None, ..given.clone() };
            let (to, kept) = (given.offset(from.rotation), free.offset(from.rotation));
            prop_assert!(to.rotation == Quat::from_rotation_z(0.5) && kept.rotation == from.rotation);
            for frames in [0.0, 3.5, 8.0, 20.0] {
                let (a, b) = (given.offset_at(from, to, frames), free.offset_at(from, kept, frames));
                prop_assert!(a.position == b.position);
                prop_assert!(b.rotation.dot(from.rotation).abs() > 0.99999);
            }
        }

        #[test]
        fn it_moves_into_the_socket_without_a_pop(from in any_transform(0.5)) {
            let socket = grip(8);
            let to = socket.offset(from.rotation);
            let mut before = socket.offset_at(from, to, 0.0);
            prop_assert!((before.position - from.position).length() < 1e-5);
            let way = from.position.distance(socket.position_m);
            for frame in 1..=8 {
                let now = socket.offset_at(from, to, frame as f32);
                prop_assert!(now.position.distance(before.position) <= way * 0.2 + 1e-5);
                before = now;
            }
            prop_assert!(before.position.distance(socket.position_m) < 1e-5);
            prop_assert!(before.rotation.dot(to.rotation).abs() > 0.99999);
            prop_assert!((grip(0).offset_at(from, to, 0.0).position - socket.position_m).length() < 1e-6);
        }
    }
}
