//! What an answer says of its own motion, in words.

use troupe_motion::Skeleton;
use troupe_proto::v1::{Feasibility, FeasibilityFigure};

/// The figures of an answer by name, with their units.
pub(crate) fn figures(found: &Feasibility) -> [(&'static str, &'static str, Option<FeasibilityFigure>); 12] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::doll;

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
}
