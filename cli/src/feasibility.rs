//! What an answer says of its own motion, in words.

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

/// One line: whether a motion is feasible, and by which figure it is farthest from it or nearest to its limit.
pub(crate) fn verdict(found: &Feasibility) -> String {
    let word = if found.feasible {
        "feasible"
    } else {
        "not feasible"
    };
    let all = figures(found).into_iter();
    let named = all.filter_map(|(name, unit, figure)| Some((name, unit, figure?)));
    match named.into_iter().find(|(name, ..)| *name == found.worst) {
        Some((name, unit, figure)) => format!(
            "{word}: {name} is {:.2} {unit} in frame {}, {:.2} times its limit of {:.2}",
            figure.value, figure.frame, found.ratio, figure.limit
        ),
        None => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_names_the_worst_figure() {
        let figure = |value: f32, limit: f32, frame| {
            Some(FeasibilityFigure {
                value,
                limit,
                frame,
                joint: None,
            })
        };
        let found = Feasibility {
            feasible: false,
            worst: "root_acceleration".to_owned(),
            ratio: 12.0,
            root_speed: figure(3.0, 6.0, 4),
            root_acceleration: figure(264.0, 22.0, 31),
            ..Feasibility::default()
        };
        assert_eq!(
            verdict(&found),
            "not feasible: root_acceleration is 264.00 m/s² in frame 31, 12.00 times its limit of 22.00"
        );
        let unknown = Feasibility {
            feasible: true,
            worst: "of a newer server".to_owned(),
            ..Feasibility::default()
        };
        assert_eq!(verdict(&unknown), "feasible");
    }
}
