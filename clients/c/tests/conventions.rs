//! The table of known poses agrees with the conventions of the server, and with those of Godot.

use std::path::Path;

use glam::{Quat, Vec3};
use serde_json::Value;
use troupe_motion::conventions::Convention;

/// The conversions of the Godot extension, whose own tests take minutes to compile.
#[path = "../../godot/src/axes.rs"]
mod godot;

fn numbers(of: &Value) -> Vec<f32> {
    let numbers = of.as_array().expect("an array").iter();
    numbers
        .map(|number| number.as_f64().expect("a number") as f32)
        .collect()
}

fn pose(row: &Value, frame: &str) -> (Vec3, Quat) {
    let [position, rotation] = ["position", "rotation"].map(|part| numbers(&row[frame][part]));
    (Vec3::from_slice(&position), Quat::from_slice(&rotation))
}

#[test]
fn conventions_give_the_poses_of_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../conventions/poses.json");
    let table: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    assert!(table.len() >= 8);
    for row in &table {
        let (position, rotation) = pose(row, "troupe");
        for (frame, convention) in [("unity", Convention::Unity), ("unreal", Convention::Unreal)] {
            let (there, turned) = pose(row, frame);
            let near = convention.position_from_native(position).abs_diff_eq(there, 1e-4);
            assert!(near, "{frame}: {row}");
            let near = convention
                .rotation_from_native(rotation)
                .abs_diff_eq(turned, 1e-5);
            assert!(near, "{frame}: {row}");
        }
        let (there, turned) = pose(row, "godot");
        assert!(godot::position(position).abs_diff_eq(there, 1e-5), "godot: {row}");
        let near = godot::rotation(rotation).abs_diff_eq(turned, 1e-5);
        assert!(near, "godot: {row}");
    }
}
