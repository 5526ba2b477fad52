//! Robots of every kind of description.

use glam::{Quat, Vec3};

use super::{BuildOptions, Built, DescriptionError, build, read};
use crate::fk::world_transforms;
use crate::robot::{Fitted, Mimic, RobotDoc};
use crate::rotation::angle_between;

/// A URDF of links in a tree: `name parent kind x y z axis more`.
fn urdf(joints: &[&str]) -> String {
    let mut text = "<robot name=\"made\">\n<link name=\"base\"/>\n".to_owned();
    for joint in joints {
        let words: Vec<&str> = joint.split_whitespace().collect();
        let [name, parent, kind, x, y, z, axis, more @ ..] = &words[..] else {
            panic!("{joint}")
        };
        let axis = ["1 0 0", "0 1 0", "0 0 1"]["xyz".find(axis).unwrap()];
        let parent = if *parent == "base" {
            "base".to_owned()
        } else {
            format!("{parent}_link")
        };
        let solid = "<collision><geometry><box size=\"0.2 0.1 0.04\"/></geometry></collision>";
        text += &format!(
            "<link name=\"{name}_link\">{solid}</link>\n<joint name=\"{name}_joint\" type=\"{kind}\">"
        );
        text +=
            &format!("<parent link=\"{parent}\"/><child link=\"{name}_link\"/><origin xyz=\"{x} {y} {z}\"/>");
        text += &format!(
            "<axis xyz=\"{axis}\"/><limit lower=\"-1\" upper=\"2\" velocity=\"9\"/>{}</joint>\n",
            more.join(" ")
        );
    }
    text + "</robot>"
}

const LEGS: [&str; 7] = [
    "left_leg_1 base revolute 0 0.1 -0.3 y",
    "left_leg_2 left_leg_1 revolute 0 0 -0.3 y",
    "left_leg_3 left_leg_2 revolute 0 0 -0.3 y",
    "right_leg_1 base revolute 0 -0.1 -0.3 y",
    "right_leg_2 right_leg_1 revolute 0 0 -0.3 y",
    "right_leg_3 right_leg_2 revolute 0 0 -0.3 y",
    "head_pitch base revolute 0 0.03 0.3 y",
];

fn made(text: &str, options: &BuildOptions) -> Result<Built, DescriptionError> {
    build(&read(text, &|_| None)?, options)
}

fn plain(text: &str) -> Built {
    made(text, &BuildOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn mimics(built: &Built) -> &[Mimic] {
    built.skeleton.robot.as_ref().unwrap().mimics()
}

fn names(built: &Built) -> Vec<&str> {
    built.skeleton.joints.iter().map(|joint| &*joint.name).collect()
}

#[test]
fn two_legs_get_toes_and_hinges_in_the_trees_order() {
    let built = plain(&urdf(&LEGS));
    let expected = [
        "base",
        "left_leg_1",
        "left_leg_2",
        "left_leg_3",
        "right_leg_1",
        "right_leg_2",
        "right_leg_3",
        "head_pitch",
        "left_toe",
        "right_toe",
    ];
    assert_eq!(names(&built), expected);
    assert_eq!(
        built.contacts,
        ["left_leg_3", "left_toe", "right_leg_3", "right_toe"]
    );
    let robot = built.skeleton.robot.as_ref().unwrap();
    assert_eq!((robot.name(), robot.hinges().len()), ("made", 7));
    let knee = robot.hinges()[1];
    assert_eq!(
        (knee.lower_rad, knee.upper_rad, knee.max_speed_rad_per_s),
        (-1.0, 2.0, 9.0)
    );
    // ROS' Y is to the left: native X.
    assert_eq!(knee.axis, Vec3::X);
    assert_eq!(built.skeleton.joints[1].offset_m, Vec3::new(0.1, -0.3, 0.0));
    // The middle of the front edge of the sole.
    assert!(
        built.skeleton.joints[8]
            .offset_m
            .abs_diff_eq(Vec3::new(0.0, -0.02, 0.1), 1e-6)
    );
    assert_eq!(built.skeleton.left_axis, Vec3::X);
}

#[test]
fn fixed_links_become_part_of_those_that_carry_them() {
    // A quarter turn about Z between two fixed links.
    let text = urdf(
        &[
            &LEGS[..6],
            &[
                "arm base fixed 0.2 0 0 x",
                "left_wrist arm revolute 0.1 0 0 x",
                "right_wrist arm revolute -0.1 0 0 x",
                "hand left_wrist fixed 0.3 0 0 x",
            ],
        ]
        .concat(),
    );
    let turned = "<origin xyz=\"0.2 0 0\" rpy=\"0 0 1.5707963267948966\"/>";
    let built = plain(&text.replace("<origin xyz=\"0.2 0 0\"/>", turned));
    let joint = |name: &str| &built.skeleton.joints[built.skeleton.joint_index(name).unwrap()];
    // 0.2 ahead, then 0.1 along the turned X, which is left.
    assert!(
        joint("left_wrist")
            .offset_m
            .abs_diff_eq(Vec3::new(0.1, 0.0, 0.2), 1e-6)
    );
    assert!(
        joint("left_hand")
            .offset_m
            .abs_diff_eq(Vec3::new(0.0, 0.0, 0.3), 1e-6)
    );
    let robot = built.skeleton.robot.as_ref().unwrap();
    let wrist = robot.hinges()[6];
    assert!(angle_between(wrist.rest, Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)) < 1e-6);
    assert!(!names(&built).contains(&"arm"));
}

#[test]
fn legs_are_found_by_the_names_of_many_makers_or_by_option() {
    let renamed = |left: &str, right: &str| {
        urdf(&LEGS)
            .replace("left_leg_", left)
            .replace("right_leg_", right)
    };
    for (left, right) in [("leg_l", "leg_r"), ("L_leg", "R_leg"), ("leftLeg", "rightLeg")] {
        let built = plain(&renamed(left, right));
        assert_eq!(built.contacts.len(), 4, "{left}");
        assert!(built.contacts[0].starts_with(left), "{:?}", built.contacts);
    }
    let odd = renamed("one_", "two_");
    let error = made(&odd, &BuildOptions::default()).unwrap_err().to_string();
    assert!(
        error.contains("--legs LEFT,RIGHT") && error.contains("one_3, two_3, head_pitch"),
        "{error}"
    );
    let options = BuildOptions {
        legs: vec!["one_3".to_owned(), "two_3_joint".to_owned()],
        ..BuildOptions::default()
    };
    assert_eq!(
        made(&odd, &options).unwrap().contacts,
        ["one_3", "left_toe", "two_3", "right_toe"]
    );
    let wrong = BuildOptions {
        legs: vec!["tail".to_owned()],
        ..BuildOptions::default()
    };
    assert!(
        made(&odd, &wrong)
            .unwrap_err()
            .to_string()
            .contains("--legs: no joint \"tail\"; the robot has base")
    );
    let given = BuildOptions {
        end_effectors: vec![("left_toe".to_owned(), "left_leg_3".to_owned(), [0.3, 0.0, 0.0])],
        ..BuildOptions::default()
    };
    let built = made(&urdf(&LEGS), &given).unwrap();
    let toe = built.skeleton.joint_index("left_toe").unwrap();
    assert_eq!(built.skeleton.joints[toe].offset_m, Vec3::new(0.0, 0.0, 0.3));
    assert_eq!(built.contacts.len(), 4);
}

#[test]
fn four_legs_stand_on_their_ends() {
    let mut joints = Vec::new();
    for (leg, x, y) in [
        ("FL", 0.2, 0.1),
        ("FR", 0.2, -0.1),
        ("RL", -0.2, 0.1),
        ("RR", -0.2, -0.1),
    ] {
        joints.push(format!("{leg}_thigh base revolute {x} {y} 0 y"));
        joints.push(format!("{leg}_calf {leg}_thigh revolute 0 0 -0.2 y"));
        joints.push(format!("{leg}_foot {leg}_calf fixed 0 0 -0.2 y"));
    }
    let joints: Vec<&str> = joints.iter().map(|joint| &**joint).collect();
    let built = plain(&urdf(&joints));
    assert_eq!(
        built.contacts,
        ["FL_calf_end", "FR_calf_end", "RL_calf_end", "RR_calf_end"]
    );
    let end = built.skeleton.joint_index("RR_calf_end").unwrap();
    assert!(
        built.skeleton.joints[end]
            .offset_m
            .abs_diff_eq(Vec3::new(0.0, -0.2, 0.0), 1e-6)
    );
}

#[test]
fn joints_that_mimic_follow_their_hinge() {
    let mimic = "left_leg_2 left_leg_1 revolute 0 0 -0.3 y <mimic joint=\"left_leg_1_joint\" multiplier=\"-2\" offset=\"0.1\"/>";
    let joints = [&LEGS[..1], &[mimic], &LEGS[2..]].concat();
    let built = plain(&urdf(&joints));
    assert_eq!(mimics(&built).len(), 1);
    let robot = built.skeleton.robot.as_ref().unwrap();
    assert_eq!(robot.hinges().len(), 6, "it has no number of its own");
    let joint = built.skeleton.joint_index("left_leg_2").unwrap();
    let mut pose = vec![Quat::IDENTITY; built.skeleton.joint_count()];
    let angles = [0.4, 0.0, 0.0, 0.0, 0.0, 0.0];
    robot.pose(Quat::IDENTITY, &angles, &mut pose);
    assert!(angle_between(pose[joint], Quat::from_rotation_x(-0.7)) < 1e-6);
    // A pose that it cannot make comes back to what the hinge says.
    let mut fitted = Fitted::default();
    let before = pose.clone();
    pose[joint] = Quat::IDENTITY;
    robot.fit(&mut pose, &mut fitted);
    assert!(angle_between(pose[joint], before[joint]) < 1e-5);
    assert!((fitted.angles[0] - 0.4).abs() < 1e-5 && fitted.residual_rad > 0.6);
    let mut places = vec![Vec3::ZERO; pose.len()];
    let mut turns = pose.clone();
    world_transforms(&built.skeleton, Vec3::ZERO, &before, &mut places, &mut turns);
    assert!(places.iter().all(|place| place.is_finite()));
    // A manifest carries them, and says nothing of them if there are none.
    let doc = RobotDoc::from((robot, &built.skeleton));
    let written = toml::to_string(&doc).unwrap();
    assert_eq!(toml::from_str::<RobotDoc>(&written).unwrap(), doc);
    let again = built.skeleton.clone().with_robot(&doc).unwrap();
    assert_eq!(again.robot.as_ref(), Some(robot));
    let free = plain(&urdf(&LEGS)).skeleton;
    let free = RobotDoc::from((free.robot.as_ref().unwrap(), &free));
    assert!(!toml::to_string(&free).unwrap().contains("mimics"));
    let late = mimic.replace("left_leg_1_joint", "right_leg_3_joint");
    let joints = [&LEGS[..1], &[&*late], &LEGS[2..]].concat();
    let error = made(&urdf(&joints), &BuildOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("\"left_leg_2\" cannot follow a hinge: it follows \"right_leg_3\""),
        "{error}"
    );
}

#[test]
fn mistakes_name_line_and_element() {
    let legs = urdf(&LEGS);
    for (from, to, expected) in [
        ("<robot name", "<sdf name", "no XML"),
        (
            "type=\"revolute\"",
            "type=\"planar\"",
            "line 4, joint left_leg_1_joint: type \"planar\"; allowed: revolute",
        ),
        (
            "<child link=\"left_leg_1_link\"/>",
            "",
            "line 4, joint left_leg_1_joint: a joint needs <parent link> and <child link>",
        ),
        (
            "<child link=\"left_leg_1_link\"/>",
            "<child link=\"tail\"/>",
            "there is no link \"tail\"",
        ),
        (
            "lower=\"-1\"",
            "lower=\"low\"",
            "line 4, limit left_leg_1_joint: lower \"low\" must be 1 finite numbers",
        ),
        (
            "lower=\"-1\"",
            "lower=\"3\"",
            "its lower limit 3 is not below the upper 2",
        ),
        (
            "<axis xyz=\"0 1 0\"/>",
            "<axis xyz=\"0 0 0\"/>",
            "its axis has no length",
        ),
        (
            "<link name=\"base\"/>",
            "<link name=\"base\"/><link name=\"base\"/>",
            "another link of this name",
        ),
        (
            "<link name=\"base\"/>",
            "<link name=\"base\"/><link name=\"lost\"/>",
            "this has 2: base, lost",
        ),
    ] {
        assert!(legs.contains(from), "{from}");
        let error = made(&legs.replacen(from, to, 1), &BuildOptions::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
    let root = made("<sdf/>", &BuildOptions::default()).unwrap_err();
    assert_eq!(root, DescriptionError::Root("sdf".to_owned()));
    let fixed = urdf(&["a base fixed 0 0 0 x"]);
    assert!(
        made(&fixed, &BuildOptions::default())
            .unwrap_err()
            .to_string()
            .contains("no joint turns")
    );
}

/// The legs of [`LEGS`] as MuJoCo has them.
#[test]
fn names_have_256_bytes_at_most() {
    let lone = |bytes: usize| format!(r#"<robot name="r"><link name="{}"/></robot>"#, "x".repeat(bytes));
    assert!(read(&lone(256), &|_| None).is_ok());
    let error = read(&lone(257), &|_| None).unwrap_err().to_string();
    assert!(
        error.contains("…\" is 257 bytes long; allowed: up to 256 bytes"),
        "{error}"
    );
}

fn mjcf() -> String {
    let leg = |side: &str, y: &str| {
        let body = |nth: usize, inside: String| {
            let y = if nth == 1 { y } else { "0" };
            format!(
                "<body name=\"{side}_leg_{nth}_link\" pos=\"0 {y} -0.3\"><joint name=\"{side}_leg_{nth}_joint\" class=\"leg\"/>\
                 <geom type=\"box\" size=\"0.1 0.05 0.02\"/>{inside}</body>\n"
            )
        };
        body(1, body(2, body(3, String::new())))
    };
    let head = "<body name=\"head\" pos=\"0 0.03 0.3\"><joint name=\"head_pitch_joint\" axis=\"0 1 0\" range=\"-1 2\" limited=\"true\"/></body>";
    format!(
        "<mujoco model=\"made\"><compiler angle=\"radian\"/><default><joint axis=\"1 0 0\"/><default class=\"leg\">\
         <joint axis=\"0 1 0\" range=\"-1 2\"/></default></default>\n<worldbody><geom type=\"plane\"/><body name=\"base\">\
         <freejoint name=\"root\"/>{}{}{head}</body></worldbody></mujoco>",
        leg("left", "0.1"),
        leg("right", "-0.1")
    )
}

#[test]
fn mjcf_makes_the_same_robot() {
    let (a, b) = (plain(&urdf(&LEGS)), plain(&mjcf()));
    assert_eq!((names(&a), &a.contacts), (names(&b), &b.contacts));
    for (a, b) in a.skeleton.joints.iter().zip(&b.skeleton.joints) {
        assert!(
            a.offset_m.abs_diff_eq(b.offset_m, 1e-6) && a.parent == b.parent,
            "{}",
            a.name
        );
    }
    let hinges = |built: &Built| built.skeleton.robot.clone().unwrap().hinges().to_vec();
    for (a, b) in hinges(&a).iter().zip(hinges(&b)) {
        assert_eq!(
            (a.joint, a.axis, a.lower_rad, a.upper_rad),
            (b.joint, b.axis, b.lower_rad, b.upper_rad)
        );
    }
    // Degrees are what MuJoCo takes unless the file says otherwise.
    let degrees = mjcf()
        .replace(" angle=\"radian\"", "")
        .replace("\"-1 2\"", "\"-90 180\"");
    let hinge = hinges(&plain(&degrees))[0];
    assert!((hinge.lower_rad + std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    let bound = mjcf().replace(
        "</worldbody>",
        "</worldbody><equality><joint joint1=\"left_leg_2_joint\" joint2=\"left_leg_1_joint\" polycoef=\"0.1 -2 0 0 0\"/></equality>",
    );
    let built = plain(&bound);
    let mimics = mimics(&built);
    assert_eq!((mimics.len(), mimics[0].multiplier), (1, -2.0));
}

#[test]
fn groups_without_parts_of_a_robot_are_left_out() {
    let lamp = mjcf().replace(
        "<worldbody>",
        "<worldbody><frame pos=\"0 0 1\"><light/><geom type=\"plane\"/></frame>",
    );
    let site = mjcf().replace(
        "<freejoint name",
        "<frame><site name=\"imu\"/></frame><freejoint name",
    );
    for text in [lamp, site] {
        assert_eq!(plain(&text).skeleton, plain(&mjcf()).skeleton);
    }
    let said = mjcf().replace("angle=\"radian\"", "angle=\"radian\" autolimits=\"false\"");
    let said = said.replace("range=\"-1 2\"/>", "range=\"-1 2\" limited=\"true\" ref=\"0\"/>");
    assert_eq!(plain(&said).skeleton, plain(&mjcf()).skeleton);
}

#[test]
fn frames_of_mjcf_are_read_in_every_form() {
    let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    for form in [
        "quat=\"0.7071068 0 0 0.7071068\"",
        "euler=\"0 0 1.5707963\"",
        "axisangle=\"0 0 1 1.5707963\"",
        "xyaxes=\"0 1 0 -1 0 0\"",
    ] {
        let text = mjcf().replace("name=\"head\"", &format!("name=\"head\" {form}"));
        let built = plain(&text);
        let robot = built.skeleton.robot.as_ref().unwrap();
        assert!(angle_between(robot.hinges()[6].rest, quarter) < 1e-5, "{form}");
    }
    for (from, to, expected) in [
        (
            "<freejoint name=\"root\"/>",
            "<joint name=\"a\"/>",
            "only a free joint may carry it",
        ),
        (
            "<worldbody>",
            "<include file=\"x\"/><worldbody>",
            "files that include others",
        ),
        (
            "range=\"-1 2\" limited",
            "type=\"ball\" limited",
            "type \"ball\" below the root",
        ),
        (
            "<body name=\"base\">",
            "<body name=\"tree\"/><body name=\"base\">",
            "it has 2 bodies",
        ),
        (
            "<body name=\"head\" pos=\"0 0.03 0.3\">",
            "<frame><body name=\"hat\"/></frame><body name=\"head\" pos=\"0 0.03 0.3\">",
            "frame base: parts of a robot in it are not read",
        ),
        (
            "<geom type=\"box\"",
            "<replicate count=\"2\"><geom type=\"box\" size=\"1 1 1\"/></replicate><geom type=\"box\"",
            "replicate left_leg_1_link: parts of a robot in it are not read",
        ),
        (
            "<freejoint name=\"root\"/>",
            "<freejoint name=\"root\"/><attach model=\"hand\"/>",
            "attach base: parts of a robot in it are not read",
        ),
        (
            "range=\"-1 2\" limited",
            "ref=\"0.5\" range=\"-1 2\" limited",
            "ref other than 0 is not read",
        ),
        (
            "<joint axis=\"0 1 0\"",
            "<joint ref=\"-0.5\" axis=\"0 1 0\"",
            "ref other than 0 is not read",
        ),
        (
            "angle=\"radian\"",
            "angle=\"radian\" autolimits=\"false\"",
            "limited must say whether the range counts",
        ),
    ] {
        let error = made(&mjcf().replacen(from, to, 1), &BuildOptions::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}
