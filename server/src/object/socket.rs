//! An object in a socket: it moves with a joint.

use troupe_motion::interpolate::smoothstep;
use troupe_motion::{Quat, Vec3};

use super::Socket;
use crate::scene::Transform;

impl Socket {
    /// Where the object ends up in the joint's frame.
    pub fn offset(&self) -> Transform {
        Transform::new(self.position_m, self.rotation)
    }

    /// Where the object is in the joint's frame, `frames` after it was attached. `from` is where it was then, in that frame
    /// too; it moves into the socket over [`Socket::blend_frames`], starting and ending slowly.
    pub fn offset_at(&self, from: Transform, frames: f32) -> Transform {
        let share = match self.blend_frames {
            0 => 1.0,
            blend => (frames / blend as f32).clamp(0.0, 1.0),
        };
        let eased = smoothstep(share);
        Transform::new(
            from.position.lerp(self.position_m, eased),
            from.rotation.slerp(self.rotation, eased),
        )
    }

    /// The object in the world when its socket's joint is at `joint_position`, turned by `joint_rotation`.
    pub fn object(&self, joint_position: Vec3, joint_rotation: Quat) -> Transform {
        Transform::new(joint_position, joint_rotation) * self.offset()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::any_transform;
    use proptest::prelude::*;

    fn grip(blend_frames: u32) -> Socket {
        Socket {
            name: "grip".to_owned(),
            joint: 1,
            position_m: Vec3::new(0.02, -0.1, 0.0),
            rotation: Quat::from_rotation_z(0.5),
            blend_frames,
        }
    }

    proptest! {
        #[test]
        fn an_object_goes_with_its_joint(joint in any_transform(3.0), then in any_transform(3.0)) {
            let socket = grip(4);
            let (a, b) = (socket.object(joint.position, joint.rotation), socket.object(then.position, then.rotation));
            let moved = then * joint.inverse() * a;
            prop_assert!((moved.position - b.position).length() < 1e-4);
            prop_assert!(moved.rotation.dot(b.rotation).abs() > 0.9999);
        }

        #[test]
        fn it_moves_into_the_socket_without_a_pop(from in any_transform(0.5)) {
            let socket = grip(8);
            let mut before = socket.offset_at(from, 0.0);
            prop_assert!((before.position - from.position).length() < 1e-5);
            let way = from.position.distance(socket.position_m);
            for frame in 1..=8 {
                let now = socket.offset_at(from, frame as f32);
                prop_assert!(now.position.distance(before.position) <= way * 0.2 + 1e-5);
                before = now;
            }
            prop_assert!(before.position.distance(socket.position_m) < 1e-5);
            prop_assert!((grip(0).offset_at(from, 0.0).position - socket.position_m).length() < 1e-6);
        }
    }
}
