//! Poses of a clip as a pack's networks make them from the motion around them.

use glam::{Quat, Vec3};
use troupe_client::{CONTEXT_FRAMES, Client, InBetween, Pack, RequestError};
use troupe_motion::clip::Clip;
use troupe_motion::fk::world_transforms;
use troupe_motion::rotation::yaw;
use troupe_motion::skeleton::ContactParams;

use crate::failure::Failure;

/// Generated frames on either side of a key. The server fades a given pose out over as many, so the
/// key is the networks' own.
const MARGIN: usize = 8;
/// Consecutive target keyframes: as many as context frames, so that both ends fix the motion.
const TARGETS: usize = 4;
/// The generated frame that becomes the key.
pub(crate) const KEY: usize = CONTEXT_FRAMES - 1 + MARGIN;
/// Frames of the segment around a key.
pub(crate) const SEGMENT: usize = KEY + MARGIN + TARGETS;

/// Has the pack make the motion of each segment of [`SEGMENT`] frames from its ends; frame [`KEY`]
/// of each is the networks' own.
pub(crate) async fn rebuild(client: &Client, pack: &Pack, segments: &[Clip]) -> Result<Vec<Clip>, Failure> {
    if !pack.segment_frames().contains(&SEGMENT) {
        return Err(Failure::Input(format!(
            "pack `{}` cannot fill the {SEGMENT} frames around a key pose",
            pack.name()
        )));
    }
    let tasks: Vec<InBetween> = segments.iter().map(task).collect::<Result<_, _>>()?;
    let answers = client.in_between_many(pack, &tasks).await?;
    Ok((answers.characters.into_iter())
        .map(|answer| answer.clip)
        .collect())
}

/// The segment around a key as a task.
fn task(clip: &Clip) -> Result<InBetween, RequestError> {
    InBetween::from_clip_range(clip, CONTEXT_FRAMES - 1, SEGMENT - TARGETS..=SEGMENT - 1)
}

/// Mean distance of the joints at the key, each seen from its root's place on the ground along its
/// heading, metres.
pub(crate) fn distance(generated: &Clip, source: &Clip) -> f32 {
    let [a, b] = [generated, source].map(|clip| {
        let joints = clip.skeleton.joint_count();
        let (mut positions, mut turned) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        let root = clip.root_at(KEY);
        let mut pose = clip.rotations_at(KEY).to_vec();
        pose[0] = yaw(-root.heading) * pose[0];
        let height = root.position * Vec3::Y;
        world_transforms(&clip.skeleton, height, &pose, &mut positions, &mut turned);
        positions
    });
    a.iter().zip(&b).map(|(p, q)| p.distance(*q)).sum::<f32>() / a.len().max(1) as f32
}

/// Height of the root at the key with which the generated pose comes as near to the ground as the
/// clip's, and not below it, metres. Where the clip's own pose is far from what the networks make,
/// its height would lift or sink them.
pub(crate) fn grounded(generated: &Clip, source: &Clip) -> f32 {
    let lowest = |clip: &Clip| {
        let skeleton = &clip.skeleton;
        let joints = skeleton.joint_count();
        let (mut positions, mut turned) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        let root = clip.root_positions[KEY];
        world_transforms(
            skeleton,
            root,
            clip.rotations_at(KEY),
            &mut positions,
            &mut turned,
        );
        let contacts = skeleton.contacts.as_ref();
        let clearance = |joint: usize| {
            let contact = |of: &ContactParams| {
                let nth = of.joints.iter().position(|&other| other == joint)?;
                of.clearance_m.get(nth).copied()
            };
            contacts.and_then(contact).unwrap_or(0.0)
        };
        let heights = positions.iter().enumerate();
        let heights = heights.map(|(joint, place)| place.y - skeleton.ground_y_m - clearance(joint));
        heights.fold(f32::INFINITY, f32::min)
    };
    generated.root_positions[KEY].y + lowest(source).max(0.0) - lowest(generated)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::lone_hips;

    #[test]
    fn distances_do_not_see_where_it_stands_or_faces() {
        let at = |f: usize| f as f32 / 30.0;
        let roots = (0..SEGMENT).map(|f| Vec3::new(0.0, 0.9, at(f))).collect();
        let turns = (0..SEGMENT).map(|f| yaw(0.5 * at(f))).collect();
        let here = Clip::new(lone_hips(), 30.0, roots, turns).unwrap();
        let mut there = here.clone();
        for f in 0..SEGMENT {
            there.root_positions[f] += Vec3::new(3.0, 0.0, -2.0);
            there.rotations_at_mut(f)[0] = yaw(1.0) * here.rotations_at(f)[0];
        }
        assert!(distance(&there, &here) < 1e-5);
        there.root_positions[KEY].y += 0.05;
        assert!((distance(&there, &here) - 0.05).abs() < 1e-5);
    }

    #[test]
    fn a_pose_is_as_near_to_the_ground_as_the_clips_and_not_below_it() {
        let lying = |height| {
            let roots = vec![Vec3::Y * height; SEGMENT];
            Clip::new(lone_hips(), 30.0, roots, vec![Quat::IDENTITY; SEGMENT]).unwrap()
        };
        for (generated, source, height) in [(0.5, 0.3, 0.3), (-0.2, 0.3, 0.3), (0.5, -0.1, 0.0)] {
            assert!((grounded(&lying(generated), &lying(source)) - height).abs() < 1e-6);
        }
    }
}
