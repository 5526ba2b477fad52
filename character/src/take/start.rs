//! How a motion starts: with given keyframes, at rest, or in motion.

use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use super::request::{Prompt, Take};
use super::track::Track;
use super::way::{STANDING_MPS, Way};
use crate::live::CONTEXT_FRAMES;

/// Frames that are made before the start of a motion that begins on its way.
const BEFORE: usize = 36;

/// The frames that a motion starts with, and the number of them before its first frame.
pub(super) fn start(take: &Take, way: &mut Way) -> (Track, usize) {
    let mut track = Track::default();
    if let Some(past) = &take.past {
        let joints = take.subject.rig.skeleton.joint_count();
        for (root, pose) in past.roots.iter().zip(past.rotations.chunks_exact(joints)) {
            track.push(*root, pose, 0);
        }
        return (track, CONTEXT_FRAMES);
    }
    let keys = &take.wanted.keys;
    let given = keys.iter().take(CONTEXT_FRAMES).enumerate();
    let given = given.map_while(|(nth, key)| {
        let root = key.root.filter(|_| key.frame == nth)?;
        Some((root, key.whole()?))
    });
    let given: Vec<(Vec3, Vec<Quat>)> = given.collect();
    if given.len() == CONTEXT_FRAMES {
        for (root, pose) in given {
            track.push(root, &pose, 0);
        }
        return (track, 0);
    }
    let place = |frame: f32, y: f32, way: &Way| {
        let [x, z] = way.place(frame);
        Vec3::new(x, y, z)
    };
    let (rest, height_m) = (&take.subject.rest, take.subject.rest_height_m);
    if let Some((key, pose)) = keys
        .first()
        .filter(|key| key.frame == 0)
        .and_then(|key| Some((key, key.whole()?)))
    {
        let root = key.root.unwrap_or_else(|| place(0.0, height_m, way));
        (0..CONTEXT_FRAMES).for_each(|_| track.push(root, &pose, 0));
        return (track, CONTEXT_FRAMES - 1);
    }
    // A segment may be shorter than a frame of the body.
    let begins = take.segments.iter().find(|segment| segment.end > 0);
    if begins.is_some_and(|segment| segment.prompt != Prompt::Free) {
        return (track, 0);
    }
    let [x, z] = way.start_mps();
    let before = if x.hypot(z) > STANDING_MPS { BEFORE } else { 0 };
    if before > 0 {
        way.begin_before(before);
    }
    // The pose at rest faces +Z.
    let mut pose = match &take.look.style {
        Some(style) => style.idle().rotations.clone(),
        None => rest.clone(),
    };
    let height_m = take
        .look
        .style
        .as_ref()
        .map_or(height_m, |style| style.idle().height_m);
    pose[0] = yaw(way.first_heading()) * pose[0];
    let root = place(-(before as f32), height_m, way);
    (0..CONTEXT_FRAMES).for_each(|_| track.push(root, &pose, 0));
    (track, CONTEXT_FRAMES - 1 + before)
}
