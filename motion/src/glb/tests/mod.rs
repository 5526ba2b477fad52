//! Which animations are read.

mod dress;
mod forms;
mod humanoid;

use std::path::Path;

use glam::{Quat, Vec3};
use serde_json::{Value, json};

use super::{GlbOptions, GlbReadError, animation_names, parse, write_glb};
use crate::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use crate::clip::Clip;
use crate::convert::ConvertError;
use crate::fk::WorldMotion;
use crate::rotation::angle_between;
use crate::testing::{biped, walk};

/// A file with one moving node `Hips` below a node `Rig`, with a child `Leg_L`. Keys are at 0, 0.5
/// and 1 second.
struct Made {
    json: Value,
    bytes: Vec<u8>,
}

impl Made {
    fn new() -> Self {
        let mut made = Self {
            json: json!({
                "asset": { "version": "2.0" },
                "scene": 0,
                "scenes": [{ "nodes": [0] }],
                "nodes": [
                    { "name": "Rig", "children": [1], "scale": [2.0, 2.0, 2.0], "rotation": [0.0, 0.70710677, 0.0, 0.70710677] },
                    { "name": "Hips", "children": [2] },
                    { "name": "Leg_L", "translation": [0.1, -0.5, 0.0] },
                ],
                "buffers": [], "bufferViews": [], "accessors": [],
                "animations": [{ "name": "Go", "channels": [], "samplers": [] }],
            }),
            bytes: Vec::new(),
        };
        let times = made.accessor(&[0.0, 0.5, 1.0], "SCALAR", 1);
        assert_eq!(times, 0);
        made
    }

    fn accessor(&mut self, numbers: &[f32], kind: &str, width: usize) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": 4 * numbers.len() });
        let accessor = json!({
            "bufferView": self.list("bufferViews").len(), "componentType": 5126, "count": numbers.len() / width, "type": kind,
            "min": vec![-9.0; width], "max": vec![9.0; width],
        });
        self.list("bufferViews").push(view);
        self.list("accessors").push(accessor);
        self.list("accessors").len() - 1
    }

    fn list(&mut self, name: &str) -> &mut Vec<Value> {
        self.json[name].as_array_mut().unwrap()
    }

    /// Moves a node by keys of three or four numbers.
    fn channel(mut self, node: usize, path: &str, interpolation: &str, numbers: &[f32]) -> Self {
        let (kind, width) = if path == "rotation" {
            ("VEC4", 4)
        } else {
            ("VEC3", 3)
        };
        let output = self.accessor(numbers, kind, width);
        let animation = &mut self.json["animations"][0];
        let sampler = animation["samplers"].as_array().unwrap().len();
        let made = json!({ "input": 0, "output": output, "interpolation": interpolation });
        animation["samplers"].as_array_mut().unwrap().push(made);
        let made = json!({ "sampler": sampler, "target": { "node": node, "path": path } });
        animation["channels"].as_array_mut().unwrap().push(made);
        self
    }

    fn changed(mut self, pointer: &str, value: Value) -> Self {
        *self
            .json
            .pointer_mut(pointer)
            .unwrap_or_else(|| panic!("no {pointer}")) = value;
        self
    }

    fn glb(mut self) -> Vec<u8> {
        let length = self.bytes.len();
        self.list("buffers").push(json!({ "byteLength": length }));
        let mut text = serde_json::to_vec(&self.json).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let mut out = b"glTF".to_vec();
        out.extend(2_u32.to_le_bytes());
        out.extend((total as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }
}

/// Hips that rise by a metre, in their own units, in a second.
fn rising(interpolation: &str) -> Vec<u8> {
    let numbers: &[f32] = match interpolation {
        // In-tangent, value, out-tangent: the same straight line.
        "CUBICSPLINE" => &[
            0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, //
            0.0, 1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, //
            0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0,
        ],
        _ => &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0],
    };
    Made::new()
        .channel(1, "translation", interpolation, numbers)
        .glb()
}

fn at(fps: f32) -> GlbOptions {
    GlbOptions {
        fps: Some(fps),
        ..GlbOptions::default()
    }
}

fn heights(clip: &Clip) -> Vec<f32> {
    clip.root_positions.iter().map(|p| p.y).collect()
}

fn close(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn keys_of_every_interpolation_are_sampled() {
    for (interpolation, wanted) in [
        // The rig doubles the size of its nodes.
        ("LINEAR", [0.0, 0.5, 1.0, 1.5, 2.0]),
        ("CUBICSPLINE", [0.0, 0.5, 1.0, 1.5, 2.0]),
        ("STEP", [0.0, 0.0, 1.0, 1.0, 2.0]),
    ] {
        let clip = parse(&rising(interpolation), &at(4.0))
            .unwrap()
            .to_clip(&at(4.0))
            .unwrap();
        assert!(
            close(&heights(&clip), &wanted),
            "{interpolation}: {:?}",
            heights(&clip)
        );
    }
}

#[test]
fn a_cubic_spline_bends_as_its_tangents_say() {
    // From 0 to 1 in half a second with slope 0 at both ends: 3t² - 2t³.
    let numbers = [
        [[0.0; 3], [0.0, 0.0, 0.0], [0.0; 3]],
        [[0.0; 3], [0.0, 1.0, 0.0], [0.0; 3]],
        [[0.0; 3], [0.0, 1.0, 0.0], [0.0; 3]],
    ];
    let numbers: Vec<f32> = numbers.as_flattened().as_flattened().to_vec();
    let bytes = Made::new()
        .channel(1, "translation", "CUBICSPLINE", &numbers)
        .glb();
    let clip = parse(&bytes, &at(8.0)).unwrap().to_clip(&at(8.0)).unwrap();
    let wanted = [0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0, 1.0, 1.0, 1.0].map(|y| 2.0 * y);
    assert!(close(&heights(&clip), &wanted), "{:?}", heights(&clip));
}

#[test]
fn nodes_above_the_joints_are_folded_into_the_root() {
    let quarter = std::f32::consts::FRAC_PI_2;
    let half = (quarter / 2.0).sin();
    let turns = [0.0, 0.0, 0.0, 1.0, half, 0.0, 0.0, half, half, 0.0, 0.0, half];
    let made = Made::new().channel(1, "rotation", "LINEAR", &turns);
    let made = made.channel(
        1,
        "translation",
        "LINEAR",
        &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    );
    let made = made.channel(2, "rotation", "STEP", &[0.0, 0.0, 0.0, 1.0].repeat(3));
    let bytes = made.glb();
    let animation = parse(&bytes, &at(4.0)).unwrap();
    let clip = animation.to_clip(&at(4.0)).unwrap();
    let names: Vec<&str> = clip.skeleton.joints.iter().map(|j| &*j.name).collect();
    assert_eq!(names, ["Hips", "Leg_L"], "the rig is no joint");
    // A quarter turn about Y takes +X to -Z; the rig doubles it.
    assert!(clip.root_positions[0].abs_diff_eq(Vec3::new(0.0, 0.0, -2.0), 1e-6));
    assert!(
        clip.skeleton.joints[1]
            .offset_m
            .abs_diff_eq(Vec3::new(0.2, -1.0, 0.0), 1e-6)
    );
    let want = Quat::from_rotation_y(quarter) * Quat::from_rotation_x(quarter / 2.0);
    assert!(
        angle_between(clip.rotations_at(1)[0], want) < 1e-6,
        "between two keys"
    );
}

#[test]
fn the_default_rate_is_that_of_the_keys() {
    let clip = walk(31);
    let animation = parse(&write_glb(&clip).unwrap(), &GlbOptions::default()).unwrap();
    assert_eq!((animation.fps(), animation.frames()), (30.0, 31));
    let animation = parse(&write_glb(&clip).unwrap(), &at(60.0)).unwrap();
    assert_eq!((animation.fps(), animation.frames()), (60.0, 61));
}

#[test]
fn bvh_to_glb_to_bvh_is_the_same_motion() {
    let first = bvh::write(&BvhFile::from_clip(&walk(60), &BvhWriteOptions::default()).unwrap());
    let clip = bvh::parse(&first)
        .unwrap()
        .to_clip(&BvhOptions::default())
        .unwrap();
    let glb = write_glb(&clip).unwrap();
    let read = parse(&glb, &GlbOptions::default()).unwrap();
    for again in [
        read.to_clip(&GlbOptions::default()).unwrap(),
        read.to_clip_on(&biped(), &GlbOptions::default()).unwrap(),
    ] {
        let second = bvh::write(&BvhFile::from_clip(&again, &BvhWriteOptions::default()).unwrap());
        let again = bvh::parse(&second)
            .unwrap()
            .to_clip(&BvhOptions::default())
            .unwrap();
        assert_eq!(again.frames(), clip.frames());
        let names = |clip: &Clip| {
            clip.skeleton
                .joints
                .iter()
                .map(|j| j.name.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(&again), names(&clip));
        let (a, b) = (WorldMotion::from_clip(&clip), WorldMotion::from_clip(&again));
        for (a, b) in a.positions.iter().zip(&b.positions) {
            assert!(a.distance(*b) < 1e-5, "{a} {b}");
        }
        for (a, b) in a.rotations.iter().zip(&b.rotations) {
            assert!(angle_between(*a, *b) < 1e-4, "{a} {b}");
        }
    }
}

#[test]
fn joints_are_matched_to_a_skeleton_by_name() {
    let bytes = rising("LINEAR");
    let on = |skeleton| parse(&bytes, &at(30.0)).unwrap().to_clip_on(&skeleton, &at(30.0));
    let missing = on(biped()).unwrap_err();
    let GlbReadError::Convert(ConvertError::MissingJoints(names)) = missing else {
        panic!("{missing}")
    };
    assert_eq!(names.len(), 7, "all but the hips: {names:?}");
}

#[test]
fn one_of_several_animations_must_be_named() {
    let mut made = Made::new().channel(1, "translation", "LINEAR", &[0.0; 9]);
    let first = made.json["animations"][0].clone();
    let mut second = first.clone();
    second.as_object_mut().unwrap().remove("name");
    made.list("animations").push(second);
    let bytes = made.glb();
    assert_eq!(animation_names(&bytes).unwrap(), ["Go", "animation_1"]);
    let message = |name: Option<&str>| {
        let animation = name.map(str::to_owned);
        parse(
            &bytes,
            &GlbOptions {
                animation,
                ..GlbOptions::default()
            },
        )
        .err()
        .map(|e| e.to_string())
    };
    assert_eq!(message(Some("animation_1")), None);
    assert!(
        message(None)
            .unwrap()
            .contains("2 animations; say which: Go, animation_1")
    );
    assert!(
        message(Some("Run"))
            .unwrap()
            .contains("no animation \"Run\"; the file has Go, animation_1")
    );
}

#[test]
fn errors_name_what_cannot_be_played() {
    let still = [0.0; 9];
    let moving = || Made::new().channel(1, "translation", "LINEAR", &still);
    let mut cut = moving();
    cut.bytes.truncate(20);
    let mut backwards = moving();
    backwards.bytes[4..8].copy_from_slice(&2.0_f32.to_le_bytes());
    let mut infinite = moving();
    infinite.bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    for (made, expected) in [
        (Made::new(), "no animation of its nodes"),
        (cut, "node \"Hips\": its keys reach past the end"),
        (backwards, "node \"Hips\": times do not rise at key 2"),
        (infinite, "node \"Hips\": value 0 is not finite"),
        (
            Made::new().channel(1, "translation", "LINEAR", &still[..6]),
            "2 values for 3 keys",
        ),
        (
            Made::new().channel(1, "scale", "LINEAR", &[1.0, 2.0, 1.0].repeat(3)),
            "the same in all directions",
        ),
        (
            moving().changed("/nodes/1/children", json!([0])),
            "\"Rig\" has more than one parent, or is its own",
        ),
        (
            moving().changed("/nodes/0/children", json!([1, 2])),
            "\"Leg_L\" has more than one parent",
        ),
        (
            moving().changed("/accessors/1/count", json!(1_000_000_000)),
            "Hips",
        ),
        (
            moving().changed("/accessors/1/type", json!("VEC2")),
            "Translation keys of F32 Vec2",
        ),
        (
            moving().changed("/animations/0/channels/0/target/node", json!(7)),
            "a channel of an animation names no node",
        ),
        (
            moving().changed("/animations/0/channels/0/target/path", json!("colour")),
            "or no property of one",
        ),
        (moving().changed("/bufferViews/1/byteLength", json!(u64::MAX)), ""),
    ] {
        let error = parse(&made.glb(), &at(30.0)).err().map(|e| e.to_string());
        let error = error.unwrap_or_else(|| panic!("read, but {expected}"));
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn a_long_animation_is_refused_before_memory_is_taken() {
    let mut made = Made::new().channel(1, "translation", "LINEAR", &[0.0; 9]);
    made.bytes[8..12].copy_from_slice(&3e30_f32.to_le_bytes());
    let error = parse(&made.glb(), &at(30.0)).err().unwrap();
    assert!(
        matches!(error, GlbReadError::Convert(ConvertError::TooLong { .. })),
        "{error}"
    );
    assert!(matches!(
        parse(&rising("LINEAR"), &at(f32::NAN)),
        Err(GlbReadError::Rate(_))
    ));
}

/// Real files, if they are present: Blender's export of skinned animals, with several animations
/// each.
#[test]
fn animals_of_mesh2motion_are_read() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/data/mesh2motion/static/animations");
    let Ok(files) = std::fs::read_dir(&top) else {
        eprintln!("skipped: no {}", top.display());
        return;
    };
    let mut animations = 0;
    for file in files {
        let path = file.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        for name in animation_names(&bytes).unwrap() {
            let options = GlbOptions {
                animation: Some(name.clone()),
                max_offset_variation_m: f32::INFINITY,
                ..at(30.0)
            };
            let about = format!("{} {name}", path.display());
            let animation = parse(&bytes, &options).unwrap_or_else(|e| panic!("{about}: {e}"));
            let clip = animation
                .to_clip(&options)
                .unwrap_or_else(|e| panic!("{about}: {e}"));
            assert!(clip.skeleton.joint_count() > 20, "{about}");
            let hips = clip.root_positions[0].y;
            assert!((-1.0..6.0).contains(&hips), "{about}: hips at {hips} m");
            animations += 1;
        }
    }
    assert!(animations > 50, "{animations} animations");
}
