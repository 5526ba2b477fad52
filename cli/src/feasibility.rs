//! What an answer says of its own motion, in words.

use troupe_motion::Skeleton;
use troupe_motion::clip::Clip;
use troupe_motion::robot::{Fitted, HingeRates};
use troupe_proto::v1::{Feasibility, FeasibilityFigure};

/// The figures of an answer by name, with their units.
pub(crate) fn figures(found: &Feasibility) -> [(&'static str, &'static str, Option<FeasibilityFigure>); 14] {
    [
        ("root_speed", "m/s", found.root_speed),
        ("root_acceleration", "m/s²", found.root_acceleration),
        ("turning", "rad/s", found.turning),
        ("joint_speed", "m/s", found.joint_speed),
        ("joint_acceleration", "m/s²", found.joint_acceleration),
        ("below_ground", "m", found.below_ground),
        ("off_ground", "m", found.off_ground),
        ("tilt", "rad", found.tilt),
        ("bend", "rad", found.bend),
        ("root_reach", "m", found.root_reach),
        ("turn_reach", "rad", found.turn_reach),
        ("pose_reach", "m", found.pose_reach),
        ("hinge_speed", "rad/s", found.hinge_speed),
        ("hinge_acceleration", "rad/s²", found.hinge_acceleration),
    ]
}

/// One line: whether the motion of a skeleton is feasible, and by which figure it is farthest from
/// it or nearest to its limit.
pub(crate) fn verdict(found: &Feasibility, skeleton: &Skeleton) -> String {
    let word = if found.feasible {
        "feasible"
    } else {
        "not feasible"
    };
    let all = figures(found).into_iter();
    let named = all.filter_map(|(name, unit, figure)| Some((name, unit, figure?)));
    match named.into_iter().find(|(name, ..)| *name == found.worst) {
        Some((name, unit, figure)) => {
            let joint = figure.joint.and_then(|joint| skeleton.joints.get(joint as usize));
            let of = joint.map_or_else(String::new, |joint| format!(" of {}", joint.name));
            format!(
                "{word}: {name}{of} is {:.2} {unit} in frame {}, {:.2} times its limit of {:.2}",
                figure.value, figure.frame, found.ratio, figure.limit
            )
        }
        None => word.to_owned(),
    }
}

/// One line on the hinge of a robot's clip that is farthest beyond its highest speed. None if none
/// is, and for other bodies.
pub(crate) fn too_fast(clip: &Clip) -> Option<String> {
    let robot = clip.skeleton.robot.as_ref()?;
    let (mut fitted, mut rates) = (Fitted::default(), HingeRates::default());
    let (mut worst, mut beyond) = ((0, 0, 1.0), 0);
    for frame in 0..clip.frames() {
        let mut pose = clip.rotations_at(frame).to_vec();
        robot.fit(&mut pose, &mut fitted);
        let rate = rates.push(robot, &fitted.angles, clip.fps.recip());
        beyond += usize::from(rate.speed_ratio > 1.0);
        if rate.speed_ratio > worst.2 {
            worst = (frame, rate.fastest, rate.speed_ratio);
        }
    }
    let (frame, hinge, ratio) = worst;
    let joint = &clip.skeleton.joints[robot.hinges()[hinge].joint].name;
    (beyond > 0).then(|| {
        format!(
            "hinges: {beyond} of {} frames are too fast for the robot; {joint} would have to turn at {ratio:.2} times its \
             highest speed in frame {frame}",
            clip.frames()
        )
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use troupe_client::Pack;
    use troupe_motion::{Quat, Vec3};

    use super::*;
    use crate::testing::{doll, hopper};

    #[test]
    fn a_verdict_names_the_worst_figure_and_its_joint() {
        let figure = |value: f32, limit: f32, frame, joint| {
            Some(FeasibilityFigure {
                value,
                limit,
                frame,
                joint,
            })
        };
        let mut found = Feasibility {
            feasible: false,
            worst: "root_acceleration".to_owned(),
            ratio: 12.0,
            root_speed: figure(3.0, 6.0, 4, None),
            root_acceleration: figure(264.0, 22.0, 31, None),
            bend: figure(2.5, 1.0, 7, Some(4)),
            ..Feasibility::default()
        };
        let doll = doll();
        assert_eq!(
            verdict(&found, &doll),
            "not feasible: root_acceleration is 264.00 m/s² in frame 31, 12.00 times its limit of 22.00"
        );
        (found.worst, found.ratio) = ("bend".to_owned(), 2.5);
        assert_eq!(
            verdict(&found, &doll),
            "not feasible: bend of Foot_R is 2.50 rad in frame 7, 2.50 times its limit of 1.00"
        );
        found.bend = figure(2.5, 1.0, 7, Some(5));
        assert!(
            verdict(&found, &doll).starts_with("not feasible: bend is 2.50 rad"),
            "no such joint"
        );
        let unknown = Feasibility {
            feasible: true,
            worst: "of a newer server".to_owned(),
            ..Feasibility::default()
        };
        assert_eq!(verdict(&unknown, &doll), "feasible");
    }

    /// A hopper at 30 frames a second whose foot is at these angles.
    fn hops(angles: &[f32]) -> Clip {
        let skeleton = Arc::clone(Pack::try_from(hopper()).unwrap().skeleton());
        let pose = |&angle: &f32| [Quat::IDENTITY, Quat::from_rotation_x(angle)];
        let rotations = angles.iter().flat_map(pose).collect();
        Clip::new(skeleton, 30.0, vec![Vec3::Y; angles.len()], rotations).unwrap()
    }

    #[test]
    fn a_clip_that_is_too_fast_for_its_robot_is_noted() {
        // 15 and 12 rad/s of 10, then 9.
        assert_eq!(
            too_fast(&hops(&[0.0, 0.5, 0.1, 0.4])).unwrap(),
            "hinges: 2 of 4 frames are too fast for the robot; Foot would have to turn at 1.50 times its highest speed \
             in frame 1"
        );
        assert_eq!(too_fast(&hops(&[0.0, 0.3, 0.1, 0.4])), None);
        let doll = doll();
        let still = vec![Quat::IDENTITY; doll.joint_count()];
        let clip = Clip::new(doll, 30.0, vec![Vec3::Y], still).unwrap();
        assert_eq!(too_fast(&clip), None);
    }
}
