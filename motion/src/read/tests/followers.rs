//! Joints that follow hinges, in rows of numbers.

use std::sync::Arc;

use super::robots::{same, with};
use crate::read::Options;

/// MJCF of a robot whose head follows its torso, and whose last hinge comes after the head.
const FOLLOWING: &str = r#"<mujoco model="t"><compiler angle="radian"/><worldbody><body name="base" pos="0 0 1"><freejoint/>
<body name="l1" pos="0 .1 0"><joint name="left_hip" axis="0 1 0" range="-2 2"/>
<body name="l2" pos="0 0 -.5"><joint name="left_knee" axis="0 1 0" range="-2 2"/><geom size=".1 .1 .1" type="box"/></body></body>
<body name="r1" pos="0 -.1 0"><joint name="right_hip" axis="0 1 0" range="-2 2"/>
<body name="r2" pos="0 0 -.5"><joint name="right_knee" axis="0 1 0" range="-2 2"/><geom size=".1 .1 .1" type="box"/></body></body>
<body name="chest" pos="0 0 .3"><joint name="torso" axis="0 0 1" range="-2 2"/>
<body name="skull" pos="0 0 .3"><joint name="head" axis="0 1 0" range="-2 2"/></body>
<body name="arm" pos="0 .2 0"><joint name="elbow" axis="0 1 0" range="-2 2"/></body></body>
</body></worldbody><equality><joint joint1="head" joint2="torso" polycoef=".1 2 0 0 0"/></equality></mujoco>"#;

#[test]
fn columns_of_joints_that_follow_are_taken_out() {
    use crate::robot::description::{BuildOptions, build, read};
    let described = read(FOLLOWING, &|_| None).unwrap();
    let options = Options {
        skeleton: Some(Arc::new(
            build(&described, &BuildOptions::default()).unwrap().skeleton,
        )),
        ..Options::default()
    };
    // x y z w x y z, four of the legs, torso, head, elbow.
    let row = |head: f32| {
        [
            0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, head, 0.7,
        ]
    };
    let array = |numbers: &[f32], columns: usize| {
        let mut bytes = Vec::new();
        crate::files::npz::write_array(&mut bytes, &[numbers.len() / columns, columns], numbers).unwrap();
        bytes
    };
    let without: Vec<f32> = row(1.1)
        .into_iter()
        .enumerate()
        .filter(|(at, _)| *at != 12)
        .map(|(_, n)| n)
        .collect();
    let truth = with("t.npy", &array(&without.repeat(3), 13), &options).unwrap();
    let found = with("t.npy", &array(&row(1.1).repeat(3), 14), &options).unwrap();
    assert!(same(&truth.clip, &found.clip) && found.report.oddities == truth.report.oddities);
    let found = with("t.npy", &array(&row(0.9).repeat(3), 14), &options).unwrap();
    assert!(same(&truth.clip, &found.clip));
    let odd = &found.report.oddities;
    let wanted = "joint \"head\" follows \"torso\", but its numbers are up to 0.20 rad from that";
    assert!(odd.iter().any(|note| note.text.starts_with(wanted)), "{odd:?}");
    let csv = |row: &[f32]| -> String {
        let mut row = row.to_vec();
        row[3..7].rotate_left(1);
        let row: Vec<String> = row.iter().map(f32::to_string).collect();
        format!("{}\n", row.join(",")).repeat(3)
    };
    let found = with("t.csv", csv(&row(1.1)).as_bytes(), &options).unwrap();
    assert!(same(&truth.clip, &found.clip));
    let error = with("t.npy", &array(&row(1.1), 7), &options)
        .unwrap_err()
        .to_string();
    assert!(
        error.ends_with("has 13: 7 of the root and 6 angles; joints that follow others have no column: head"),
        "{error}"
    );
}
