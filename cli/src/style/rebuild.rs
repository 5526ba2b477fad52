//! From a gait in a clip to key poses that the pack's own networks make.

use troupe_client::{Client, Pack};
use troupe_motion::clip::Clip;
use troupe_motion::gait::ClosedCycle;
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::{to_wxyz, yaw};
use troupe_proto::v1;

use crate::failure::Failure;
use crate::rebuild::{KEY, SEGMENT, distance};

/// A gait with its keyframes.
pub(super) struct Rebuilt {
    pub(super) gait: v1::Gait,
    /// Mean distance of the key poses' joints to the clip's, metres.
    pub(super) distance_m: f32,
}

/// Has the pack rebuild `keys` poses of a cycle, or one pose of each of several stands. At least
/// one cycle.
pub(super) async fn rebuild(
    client: &Client,
    pack: &Pack,
    name: &str,
    cycles: &[&ClosedCycle],
    keys: usize,
) -> Result<Rebuilt, Failure> {
    let moments = moments(cycles, keys);
    let sources = moments
        .iter()
        .map(|(cycle, at)| cycle.clip(at - KEY as f32, SEGMENT))
        .collect::<Result<Vec<Clip>, _>>()
        .map_err(|e| Failure::Other(e.to_string()))?;
    let answers = crate::rebuild::rebuild(client, pack, &sources).await?;
    let mut distance_m = 0.0;
    let mut keys = Vec::with_capacity(moments.len());
    for ((answer, source), (cycle, at)) in answers.iter().zip(&sources).zip(&moments) {
        distance_m += distance(answer, source) / moments.len() as f32;
        keys.push(v1::GaitKey {
            // The networks may be a centimetre or two off, which the feet would show at every step.
            height: source.root_at(KEY).position.y,
            ..key(answer, cycle.heading_at(*at))
        });
    }
    let (left, forward, turn) = cycles[0].velocity();
    centre(&mut keys, |k| &mut k.left, left);
    centre(&mut keys, |k| &mut k.forward, forward);
    centre(&mut keys, |k| &mut k.turn, turn);
    let stands = cycles[0].stands();
    if stands {
        // What is left is the networks' unrest.
        keys.iter_mut()
            .for_each(|k| (k.left, k.forward, k.turn) = (0.0, 0.0, 0.0));
    }
    let gait = v1::Gait {
        name: name.to_owned(),
        left,
        forward,
        turn,
        period_frames: if stands { 0.0 } else { cycles[0].frames() as f32 },
        key_count: u32::try_from(keys.len()).unwrap_or(u32::MAX),
        height: keys.iter().map(|k| k.height).sum::<f32>() / keys.len().max(1) as f32,
        keys,
    };
    Ok(Rebuilt { gait, distance_m })
}

/// The cycles and times of the keys: equal steps through one cycle, or each of several stands.
fn moments<'a>(cycles: &[&'a ClosedCycle], keys: usize) -> Vec<(&'a ClosedCycle, f32)> {
    match cycles {
        [cycle] if !cycle.stands() => (0..keys)
            .map(|k| (*cycle, (k * cycle.frames()) as f32 / keys as f32))
            .collect(),
        stands => stands.iter().map(|stand| (*stand, 0.0)).collect(),
    }
}

/// The key of a generated segment whose heading line points along `line` there.
fn key(clip: &Clip, line: f32) -> v1::GaitKey {
    let [before, root, after] = [KEY - 1, KEY, KEY + 1].map(|f| clip.root_at(f));
    let velocity = yaw(-line) * (after.position - before.position) * (0.5 * clip.fps);
    let mut rotations = clip.rotations_at(KEY).to_vec();
    rotations[0] = yaw(-root.heading) * rotations[0];
    v1::GaitKey {
        rotations: rotations.into_iter().flat_map(to_wxyz).collect(),
        height: root.position.y,
        left: velocity.x,
        forward: velocity.z,
        turn: wrap_angle(after.heading - before.heading) * 0.5 * clip.fps,
    }
}

/// Shifts a value of all keys so that its mean is the gait's.
fn centre(keys: &mut [v1::GaitKey], of: impl Fn(&mut v1::GaitKey) -> &mut f32, wanted: f32) {
    let count = keys.len().max(1) as f32;
    let mean = keys.iter_mut().map(|k| *of(k)).sum::<f32>() / count;
    keys.iter_mut().for_each(|k| *of(k) += wanted - mean);
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use glam::{Quat, Vec3};
    use troupe_motion::root::heading_of;

    use super::*;
    use crate::testing::lone_hips;

    /// A lone pelvis that goes ahead at 1 m/s, sways once in 20 frames and turns by 0.5 rad/s.
    fn clip(frames: usize) -> Clip {
        let at = |f: usize| f as f32 / 30.0;
        let sway = |f: usize| 0.2 * (TAU * f as f32 / 20.0).sin();
        let roots = (0..frames).map(|f| Vec3::new(0.0, 0.9, at(f))).collect();
        let turns = (0..frames).map(|f| yaw(0.5 * at(f) + sway(f))).collect();
        Clip::new(lone_hips(), 30.0, roots, turns).unwrap()
    }

    #[test]
    fn a_key_is_seen_along_the_heading_line() {
        let line = 0.5 * KEY as f32 / 30.0;
        let key = key(&clip(SEGMENT), line);
        let pelvis = Quat::from_xyzw(
            key.rotations[1],
            key.rotations[2],
            key.rotations[3],
            key.rotations[0],
        );
        assert!(
            heading_of(pelvis, Vec3::X).abs() < 1e-5,
            "the pose's own heading is out"
        );
        assert!(
            (key.forward - line.cos()).abs() < 1e-4 && (key.left + line.sin()).abs() < 1e-4,
            "{key:?}"
        );
        // sin is steepest half a period on: 0.2 * TAU / 20 frames * 30, here at frame 11.
        let sway = 0.2 * TAU / 20.0 * 30.0 * (TAU * KEY as f32 / 20.0).cos();
        assert!((key.turn - 0.5 - sway).abs() < 0.05, "{key:?}");
        assert_eq!(key.height, 0.9);
    }

    #[test]
    fn keys_lie_at_equal_steps_and_stands_one_by_one() {
        let still = ClosedCycle::stand(&clip(2), 0);
        let times =
            |cycles: &[&ClosedCycle]| moments(cycles, 12).iter().map(|(_, at)| *at).collect::<Vec<_>>();
        assert_eq!(times(&[&still]), [0.0]);
        assert_eq!(times(&[&still, &still]), [0.0, 0.0]);
    }

    #[test]
    fn the_mean_of_the_keys_is_the_gaits() {
        let with = |left| v1::GaitKey {
            left,
            ..v1::GaitKey::default()
        };
        let mut keys = vec![with(1.0), with(2.0)];
        centre(&mut keys, |k| &mut k.left, 0.5);
        assert_eq!(keys.iter().map(|k| k.left).collect::<Vec<_>>(), [0.0, 1.0]);
    }
}
