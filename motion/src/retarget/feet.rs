//! How feet stand flat on the ground in a clip.

use glam::Quat;

use crate::anatomy::{Limb, Parts};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::rotation::{align_sign, yaw};

/// Ankle and toe of a flat foot are within this of their lowest places, by the length of the shin.
const FLAT_SHARE: f32 = 0.04;
/// Share of the lowest heights that is left out: jumps and faults of the recording.
const LOWEST_SHARE: f32 = 0.02;

/// Turns the feet of a neutral pose, and what hangs on them, as they stand flat in the clip. A foot
/// that never does keeps its rotation. Returns the mean height of the toes over the ground while
/// they are flat, metres, if one is.
pub(super) fn stand(clip: &Clip, parts: &Parts, neutral: &mut [Quat]) -> Option<f32> {
    let world = WorldMotion::from_clip(clip);
    let mut heights = Vec::new();
    for leg in &parts.legs {
        let Some((flat, height_m)) = flat(clip, &world, leg) else {
            continue;
        };
        heights.push(height_m);
        let turn = flat * neutral[leg.end].conjugate();
        let skeleton = &clip.skeleton;
        for (joint, rotation) in neutral.iter_mut().enumerate().skip(leg.end) {
            let mut line = std::iter::successors(Some(joint), |&joint| skeleton.joints[joint].parent);
            if line.any(|above| above == leg.end) {
                *rotation = (turn * *rotation).normalize();
            }
        }
    }
    (!heights.is_empty()).then(|| heights.iter().sum::<f32>() / heights.len() as f32)
}

/// The mean rotation of an ankle while its foot is flat, relative to the body's heading, and the
/// mean height of the toes over the ground.
fn flat(clip: &Clip, world: &WorldMotion, leg: &Limb) -> Option<(Quat, f32)> {
    let toe = leg.toe.unwrap_or(leg.end);
    let heights = |joint: usize| (0..world.frames()).map(move |frame| world.positions_at(frame)[joint].y);
    let lowest = |joint: usize| {
        let mut sorted: Vec<f32> = heights(joint).collect();
        sorted.sort_by(f32::total_cmp);
        sorted.get((LOWEST_SHARE * sorted.len() as f32) as usize).copied()
    };
    let (low_end, low_toe) = (lowest(leg.end)?, lowest(toe)?);
    let shin_m = clip.skeleton.joints[leg.end].offset_m.length();
    let room = FLAT_SHARE * shin_m;
    let mut sum = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let (mut height_m, mut count) = (0.0, 0);
    for frame in 0..world.frames() {
        let places = world.positions_at(frame);
        if places[leg.end].y > low_end + room || places[toe].y > low_toe + room {
            continue;
        }
        let heading = clip.root_at(frame).heading;
        let rotation = yaw(-heading) * world.rotations_at(frame)[leg.end];
        sum = sum + align_sign(rotation, sum);
        height_m += places[toe].y - clip.skeleton.ground_y_m;
        count += 1;
    }
    (sum.length() > 1e-3).then(|| (sum.normalize(), height_m / count as f32))
}
