//! Foot contacts from height and speed.

use crate::features::velocities;
use crate::fk::WorldMotion;
use crate::skeleton::ContactParams;

/// Contact labels, `frames * contact joints`: true if the joint is lower than `max_height_m` over
/// the ground **and** slower ([`velocities`], in 3D) than `max_speed_mps`.
///
/// `ground_y_m` is the height of the ground plane in the world.
///
/// # Panics
/// If `params` names a joint that `motion` does not have.
pub fn detect(motion: &WorldMotion, params: &ContactParams, ground_y_m: f32, fps: f32) -> Vec<bool> {
    let velocities = velocities(motion, fps);
    let joints = motion.joints.max(1);
    let mut out = Vec::with_capacity(motion.frames() * params.len());
    for (positions, velocities) in motion
        .positions
        .chunks_exact(joints)
        .zip(velocities.chunks_exact(joints))
    {
        for (&joint, &max_height) in params.joints.iter().zip(&params.max_height_m) {
            let height = positions[joint].y - ground_y_m;
            out.push(height < max_height && velocities[joint].length() < params.max_speed_mps);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::testing::stand;
    use glam::Vec3;

    fn detect_in(clip: &Clip) -> Vec<bool> {
        let skeleton = &clip.skeleton;
        let params = skeleton.contacts.as_ref().unwrap();
        detect(
            &WorldMotion::from_clip(clip),
            params,
            skeleton.ground_y_m,
            clip.fps,
        )
    }

    #[test]
    fn a_standing_biped_is_in_contact() {
        assert_eq!(detect_in(&stand(4)), [true; 16]);
        assert_eq!(detect_in(&stand(1)), [true; 4]);
    }

    #[test]
    fn height_and_speed_both_end_it() {
        // Frame 2 is 5 cm higher: ankles at 12 cm (limit 12), toes at 7 (limit 6). The lift is too
        // fast for all of them.
        let mut clip = stand(6);
        for f in 2..6 {
            clip.root_positions[f] += Vec3::new(0.0, 0.0499, 0.0);
        }
        // Frame 5 slides by 2 cm: 0.6 m/s, and the limit is 0.4.
        clip.root_positions[5].x += 0.02;
        let found = detect_in(&clip);
        let (yes, no) = ([true; 4], [false; 4]);
        let ankles = [true, false, true, false];
        assert_eq!(found, [yes, yes, no, ankles, ankles, no].concat());
    }

    #[test]
    fn the_first_frame_takes_the_speed_of_the_second() {
        let mut clip = stand(2);
        clip.root_positions[1].z += 0.02;
        let found = detect_in(&clip);
        assert_eq!(found, [false; 8]);
    }

    #[test]
    fn heights_are_over_the_ground() {
        let clip = stand(2);
        let params = clip.skeleton.contacts.clone().unwrap();
        let motion = WorldMotion::from_clip(&clip);
        assert_eq!(detect(&motion, &params, -0.2, 30.0), [false; 8]);
    }
}
