//! Headers of robots' CSV.

use super::robots::{on_g1, rows, same, timed, topics, walk, with, with_header};
use crate::read::{JointOrder, Options, QuaternionOrder};
use crate::robot::write_csv;

/// Unitree's rows under a header of names that are changed.
fn renamed(rows: &str, change: impl Fn(&str) -> String) -> String {
    let text = with_header(rows);
    let (header, rows) = text.split_once('\n').unwrap();
    let names: Vec<String> = header.split(',').map(change).collect();
    format!("{}\n{rows}", names.join(","))
}

#[test]
fn names_of_columns_have_usual_prefixes_and_suffixes() {
    let truth = walk(40, 30.0, 0.8);
    let reversed = rows(&write_csv(&truth).unwrap(), |row| row[7..].reverse());
    let header = with_header("");
    let names: Vec<&str> = header.trim().split(',').skip(7).collect();
    for form in [
        "dof_{}",
        "joint:{}",
        "joint_{}",
        "{}_joint",
        "{}_dof",
        "{}_joint_dof",
        "{}_link",
        "DOF_{}",
    ] {
        let of_hinges: Vec<String> = names.iter().rev().map(|name| form.replace("{}", name)).collect();
        let text = format!("x,y,z,qx,qy,qz,qw,{}\n{reversed}", of_hinges.join(","));
        let found = with("walk.csv", text.as_bytes(), &on_g1()).unwrap_or_else(|e| panic!("{form}: {e}"));
        assert!(same(&truth, &found.clip), "{form}");
    }
    // Columns that are only numbered are in the robot's order, as without a header.
    let nth = std::cell::Cell::new(0);
    let text = renamed(&write_csv(&truth).unwrap(), |name| match name.len() < 3 {
        true => name.to_owned(),
        false => format!("j{}", nth.replace(nth.get() + 1)),
    });
    assert!(text.contains("qw,j0,j1,") && text.contains("j28\n"));
    assert!(same(
        &truth,
        &with("walk.csv", text.as_bytes(), &on_g1()).unwrap().clip
    ));
}

#[test]
fn names_that_no_hinge_has_are_refused() {
    let truth = walk(40, 30.0, 0.8);
    let plain = write_csv(&truth).unwrap();
    let misspelt = renamed(&plain, |name| name.replace("right_knee", "right_kneee"));
    let twice = renamed(&plain, |name| name.replace("right_knee", "left_knee_joint"));
    let empty = renamed(&plain, |name| name.replace("right_knee", ""));
    for (text, name) in [(misspelt, "right_kneee"), (twice, "left_knee_joint"), (empty, "")] {
        let error = with("walk.csv", text.as_bytes(), &on_g1())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(&format!(
                "the name of column 17 is {name:?}; allowed: the joints of robot g1"
            )) && error.contains("--joint-order says which hinges"),
            "{error}"
        );
        let options = Options {
            joint_order: Some(JointOrder::Tree),
            ..on_g1()
        };
        let found = with("walk.csv", text.as_bytes(), &options).unwrap();
        assert!(same(&truth, &found.clip));
        let counted = timed("frame", &text, &|row| format!("{row}"));
        let error = with("walk.csv", counted.as_bytes(), &on_g1())
            .unwrap_err()
            .to_string();
        assert!(error.contains("column 18"), "{error}");
    }
}

#[test]
fn names_of_the_roots_columns_give_their_order() {
    let truth = walk(40, 30.0, 0.8);
    let plain = write_csv(&truth).unwrap();
    let head = |names: &str, rows: &str| {
        let text = with_header(rows);
        text.replacen("x,y,z,qx,qy,qz,qw", names, 1)
    };
    let turned = rows(&plain, |row| row[..7].reverse());
    let swapped = rows(&plain, |row| row.swap(0, 1));
    let wxyz = rows(&plain, |row| row[3..7].rotate_right(1));
    for (names, rows) in [
        ("qw,qz,qy,qx,z,y,x", &turned),
        ("y,x,z,qx,qy,qz,qw", &swapped),
        (
            "root_pos_x,root_pos_y,root_pos_z,root_quat_w,root_quat_x,root_quat_y,root_quat_z",
            &wxyz,
        ),
        ("pos_x,pos_y,pos_z,rot_w,rot_x,rot_y,rot_z", &wxyz),
        ("root_x,root_y,root_z,root_qw,root_qx,root_qy,root_qz", &wxyz),
    ] {
        let found = with("walk.csv", head(names, rows).as_bytes(), &on_g1()).unwrap();
        assert!(same(&truth, &found.clip), "{names}");
        assert_eq!(topics(&found), []);
    }
    for (names, column, name) in [
        ("x,y,z,qx,qy,qz,up", 7, "up"),
        ("x,x,z,qx,qy,qz,qw", 2, "x"),
        ("a,b,c,d,e,f,g", 1, "a"),
    ] {
        let text = head(names, &plain);
        let error = with("walk.csv", text.as_bytes(), &on_g1())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(&format!(
                "the name of column {column} is {name:?}; allowed: x y z, qx qy qz qw"
            )) && error.contains("--quaternion xyzw or --quaternion wxyz reads"),
            "{error}"
        );
        let options = Options {
            quaternion: Some(QuaternionOrder::Xyzw),
            ..on_g1()
        };
        assert!(same(
            &truth,
            &with("walk.csv", text.as_bytes(), &options).unwrap().clip
        ));
    }
    // BONES-SEED: centimetres, and the root's rotation as angles.
    let names =
        "Frame,root_translateX,root_translateY,root_translateZ,root_rotateX,root_rotateY,root_rotateZ";
    let error = with("walk.csv", head(names, &plain).as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("root_rotateX, root_rotateY, root_rotateZ are the root's rotation as three angles"),
        "{error}"
    );
    let names = "x,y,z,root_roll,root_pitch,root_yaw";
    let six = rows(&plain, |row| {
        row.remove(6);
    });
    let error = with("walk.csv", head(names, &six).as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(error.contains("root_roll, root_pitch, root_yaw are"), "{error}");
}
