//! Requests that no body can fulfil, made from windows of clips.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Quat, Vec3};
use troupe_client::{CONTEXT_FRAMES, InBetween, Key, RequestError, SegmentLength};
use troupe_motion::clip::Clip;
use troupe_motion::root::heading_of;

/// A kind of request that no body can fulfil.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A target 10 m away in 30 frames.
    Far,
    /// A target 3 m away in 15 frames.
    Sprint,
    /// The target faces the other way in 8 frames.
    AboutTurn,
    /// The target lies on its back in 8 frames.
    Lying,
    /// The target stands on its head in 30 frames.
    OnTheHead,
    /// The target is 0.5 m lower than it was captured.
    UnderGround,
    /// The target is 1.5 m higher than it was captured.
    InTheAir,
    /// Three limbs of the target are turned by 150° more than they were captured.
    Contorted,
    /// Four targets of consecutive frames, every other one 0.5 m aside.
    Apart,
    /// Two targets of consecutive frames with poses of distant frames that face opposite ways.
    Mixed,
    /// The target is to move at 6 m/s against the way that leads to it.
    Backwards,
}

impl Kind {
    pub(super) const ALL: [Self; 11] = [
        Self::Far,
        Self::Sprint,
        Self::AboutTurn,
        Self::Lying,
        Self::OnTheHead,
        Self::UnderGround,
        Self::InTheAir,
        Self::Contorted,
        Self::Apart,
        Self::Mixed,
        Self::Backwards,
    ];

    /// The kind as reports name it.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Far => "10 m away in 30 frames",
            Self::Sprint => "3 m away in 15 frames",
            Self::AboutTurn => "turned about in 8 frames",
            Self::Lying => "lying in 8 frames",
            Self::OnTheHead => "on the head in 30 frames",
            Self::UnderGround => "0.5 m under the ground",
            Self::InTheAir => "1.5 m in the air",
            Self::Contorted => "three limbs 150° off",
            Self::Apart => "targets 0.5 m apart in a frame",
            Self::Mixed => "targets of other poses in a frame",
            Self::Backwards => "moving backwards at 6 m/s",
        }
    }

    /// Frames of the gap.
    pub(super) fn gap(self) -> usize {
        match self {
            Self::Sprint => 14,
            Self::AboutTurn | Self::Lying => 7,
            _ => 29,
        }
    }

    /// A request of the kind for a window of a clip: four context frames, the gap, and the frame
    /// that the target is made of. Its random parts follow from `chance`.
    pub(super) fn request(self, window: &Clip, chance: u64) -> Result<InBetween, RequestError> {
        let at = CONTEXT_FRAMES + self.gap();
        let angle = TAU * (chance % 360) as f32 / 360.0;
        let aside = Quat::from_rotation_y(angle) * Vec3::Z;
        let start = window.root_positions[CONTEXT_FRAMES - 1];
        let (mut root, mut pose) = (window.root_positions[at], window.rotations_at(at).to_vec());
        let mut targets = Vec::new();
        match self {
            Self::Far => root = (start + 10.0 * aside).with_y(root.y),
            Self::Sprint => {
                // Against the way of the context, so that the body is not under way already.
                let came = (start - window.root_positions[0]).with_y(0.0);
                let back = came.try_normalize().map_or(aside, |way| -way);
                root = (start + 3.0 * back).with_y(root.y);
            }
            Self::AboutTurn => {
                let context = window.rotations_at(CONTEXT_FRAMES - 1);
                let left = window.skeleton.left_axis;
                let turn = heading_of(context[0], left) + PI - heading_of(pose[0], left);
                pose[0] = Quat::from_rotation_y(turn) * pose[0];
            }
            Self::Lying => {
                let across = pose[0] * window.skeleton.left_axis;
                let across = across.with_y(0.0).normalize_or(Vec3::X);
                pose[0] = Quat::from_axis_angle(across, -FRAC_PI_2) * pose[0];
                root.y = window.skeleton.ground_y_m + 0.12;
            }
            Self::OnTheHead => pose[0] = Quat::from_axis_angle(aside, PI) * pose[0],
            Self::UnderGround => root.y -= 0.5,
            Self::InTheAir => root.y += 1.5,
            Self::Contorted => {
                for (nth, joint) in limbs(window, chance).into_iter().enumerate() {
                    let axis = [Vec3::X, Vec3::Y, Vec3::Z][(chance as usize + nth) % 3];
                    pose[joint] *= Quat::from_axis_angle(axis, 150_f32.to_radians());
                }
            }
            Self::Apart => {
                for nth in 0..3 {
                    let shift = if nth % 2 == 0 { 0.5 * aside } else { Vec3::ZERO };
                    targets.push(Key::default().root(root + shift, None).pose(&pose));
                }
            }
            Self::Mixed => {
                let mut other = window.rotations_at(0).to_vec();
                other[0] = Quat::from_rotation_y(PI) * pose[0];
                targets.push(Key::default().root(root, None).pose(&other));
            }
            Self::Backwards => {
                let went = (root - start).with_y(0.0);
                let back = -6.0 * went.try_normalize().unwrap_or(aside);
                targets.push(
                    Key::default()
                        .root(root, None)
                        .pose(&pose)
                        .velocity(back.x, back.z, 0.0),
                );
            }
        }
        if self != Self::Backwards {
            targets.push(Key::default().root(root, None).pose(&pose));
        }
        let mut context = [const { None }; CONTEXT_FRAMES];
        for (frame, key) in context.iter_mut().enumerate() {
            *key = Some(Key::from_clip(window, frame)?);
        }
        let frames = (CONTEXT_FRAMES + self.gap() + 1) as u32;
        let context = context.map(Option::unwrap_or_default);
        Ok(InBetween::new(context, targets).length(SegmentLength::Frames(frames)))
    }
}

/// Three joints that have a parent and a child, spread over the body.
fn limbs(window: &Clip, chance: u64) -> Vec<usize> {
    let joints = &window.skeleton.joints;
    let inner = |joint: &usize| joints.iter().any(|other| other.parent == Some(*joint));
    let all: Vec<usize> = (1..joints.len()).filter(inner).collect();
    let count = all.len().min(3);
    (0..count)
        .map(|nth| all[(chance as usize + nth * all.len() / count) % all.len()])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::lone_hips;

    #[test]
    fn every_kind_makes_a_request_of_its_length() {
        let frames = CONTEXT_FRAMES + 29 + 1;
        let roots = (0..frames)
            .map(|f| Vec3::new(0.0, 0.9, 0.03 * f as f32))
            .collect();
        let clip = Clip::new(lone_hips(), 30.0, roots, vec![Quat::IDENTITY; frames]).unwrap();
        for kind in Kind::ALL {
            let request = kind.request(&clip, 90).unwrap();
            assert_ne!(request, kind.request(&clip, 90).unwrap().seed(1));
            let text = format!("{request:?}");
            let wanted = format!("frame_count: Some({})", CONTEXT_FRAMES + kind.gap() + 1);
            assert!(text.contains(&wanted), "{kind:?}: {text}");
        }
        // 90° from +Z is +X.
        let far = format!("{:?}", Kind::Far.request(&clip, 90).unwrap());
        assert!(far.contains("x: 10.0") || far.contains("x: 9.99"), "{far}");
    }
}
