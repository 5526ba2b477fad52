//! Bodies whose bones a VRM file names.

use serde_json::{Map, Value, json};

use crate::anatomy::PartsDoc;
use crate::read::{Options, Source, character};

/// Bones with their parents and places.
const BONES: [(&str, &str, [f32; 3]); 19] = [
    ("hips", "", [0.0, 0.9, 0.0]),
    ("spine", "hips", [0.0, 0.2, 0.0]),
    ("chest", "spine", [0.0, 0.2, 0.0]),
    ("neck", "chest", [0.0, 0.2, 0.0]),
    ("head", "neck", [0.0, 0.1, 0.0]),
    ("leftUpperLeg", "hips", [0.1, -0.05, 0.0]),
    ("leftLowerLeg", "leftUpperLeg", [0.0, -0.4, 0.0]),
    ("leftFoot", "leftLowerLeg", [0.0, -0.4, 0.0]),
    ("leftToes", "leftFoot", [0.0, -0.04, 0.12]),
    ("rightUpperLeg", "hips", [-0.1, -0.05, 0.0]),
    ("rightLowerLeg", "rightUpperLeg", [0.0, -0.4, 0.0]),
    ("rightFoot", "rightLowerLeg", [0.0, -0.4, 0.0]),
    ("rightToes", "rightFoot", [0.0, -0.04, 0.12]),
    ("leftUpperArm", "chest", [0.15, 0.15, 0.0]),
    ("leftLowerArm", "leftUpperArm", [0.25, 0.0, 0.0]),
    ("leftHand", "leftLowerArm", [0.25, 0.0, 0.0]),
    ("rightUpperArm", "chest", [-0.15, 0.15, 0.0]),
    ("rightLowerArm", "rightUpperArm", [-0.25, 0.0, 0.0]),
    ("rightHand", "rightLowerArm", [-0.25, 0.0, 0.0]),
];

/// A file with nodes of misleading names, a skin, and an extension.
fn file(extensions: impl Fn(&dyn Fn(&str) -> usize) -> Value) -> Vec<u8> {
    let index = |bone: &str| BONES.iter().position(|row| row.0 == bone).unwrap();
    let nodes: Vec<Value> = BONES
        .iter()
        .enumerate()
        .map(|(nth, (bone, _, place))| {
            let below = BONES.iter().enumerate().filter(|(_, row)| row.1 == *bone);
            let children: Vec<usize> = below.map(|(child, _)| child).collect();
            let mut node = Map::new();
            node.insert("name".to_owned(), json!(format!("Node {nth}")));
            node.insert("translation".to_owned(), json!(place));
            if !children.is_empty() {
                node.insert("children".to_owned(), json!(children));
            }
            Value::Object(node)
        })
        .collect();
    let joints: Vec<usize> = (0..nodes.len()).collect();
    let file = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "skins": [{ "joints": joints }],
        "extensions": extensions(&index),
    });
    serde_json::to_vec(&file).unwrap()
}

fn parts(bytes: &[u8]) -> (PartsDoc, PartsDoc) {
    let found = character(&Source::new("hero.gltf", bytes), &Options::default()).unwrap();
    let figure = found.figure(&PartsDoc::default()).unwrap();
    (found.parts, PartsDoc::of(figure.parts(), figure.skeleton()))
}

#[test]
fn both_versions_of_vrm_say_which_node_is_which() {
    let old = file(|index: &dyn Fn(&str) -> usize| {
        let bones = BONES.map(|(bone, ..)| json!({ "bone": bone, "node": index(bone) }));
        json!({ "VRM": { "humanoid": { "humanBones": bones } } })
    });
    let new = file(|index: &dyn Fn(&str) -> usize| {
        let bones: Map<String, Value> = BONES
            .iter()
            .map(|(bone, ..)| ((*bone).to_owned(), json!({ "node": index(bone) })))
            .collect();
        json!({ "VRMC_vrm": { "humanoid": { "humanBones": bones } } })
    });
    for bytes in [old, new] {
        let (_, parts) = parts(&bytes);
        let leg = parts.left_leg.unwrap();
        assert_eq!(
            (leg.upper.unwrap(), leg.lower.unwrap()),
            (vec!["Node 5".to_owned()], vec!["Node 6".to_owned()])
        );
        let ends = (leg.end.as_deref(), leg.toe.as_deref());
        assert_eq!(ends, (Some("Node 7"), Some("Node 8")));
        assert_eq!(parts.right_arm.unwrap().end.unwrap(), "Node 18");
        assert_eq!(parts.trunk.unwrap(), ["Node 0", "Node 1", "Node 2"]);
        assert_eq!(parts.neck.unwrap(), ["Node 3", "Node 4"]);
    }
}

#[test]
fn what_a_file_says_wins_over_what_is_found() {
    // A file with arms on the other side.
    let bytes = file(|index: &dyn Fn(&str) -> usize| {
        let swapped = |bone: &str| match bone.strip_prefix("left") {
            Some(rest) if rest.contains("Arm") || rest == "Hand" => format!("right{rest}"),
            _ => match bone.strip_prefix("right") {
                Some(rest) if rest.contains("Arm") || rest == "Hand" => format!("left{rest}"),
                _ => bone.to_owned(),
            },
        };
        let bones = BONES.map(|(bone, ..)| json!({ "bone": swapped(bone), "node": index(bone) }));
        json!({ "VRM": { "humanoid": { "humanBones": bones } } })
    });
    let (said, parts) = parts(&bytes);
    let end = parts.left_arm.as_ref().and_then(|arm| arm.end.as_deref());
    assert_eq!(end, Some("Node 18"));
    assert_eq!(parts.left_arm.unwrap().end, said.left_arm.unwrap().end);
}

#[test]
fn incomplete_bones_are_left_out() {
    for extensions in [
        json!({ "VRM": { "humanoid": { "humanBones": [{ "bone": "hips", "node": 0 }] } } }),
        json!({ "VRM": { "humanoid": { "humanBones": [{ "bone": "hips", "node": 99 }, 3] } } }),
        json!({ "VRMC_vrm": { "humanoid": 3 } }),
        json!({ "OTHER": {} }),
    ] {
        let (said, parts) = parts(&file(|_: &dyn Fn(&str) -> usize| extensions.clone()));
        assert!(said.is_empty() && parts.left_leg.is_some());
    }
}
