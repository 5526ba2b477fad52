//! Forms of glTF that other programs write: text, files beside it, sparse keys, extensions, props.

use serde_json::{Value, json};

use super::{Made, at, close, heights, rising};
use crate::clip::Clip;
use crate::glb::{parse, parse_beside};

/// A skinned `Hips` that rises, and a prop.
fn skinned() -> Made {
    let numbers = [0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0];
    let mut made = Made::new().channel(1, "translation", "LINEAR", &numbers);
    made.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": 99 }]);
    made.list("nodes")
        .push(json!({ "name": "Prop", "scale": [-1.0, 1.0, 1.0] }));
    made.channel(
        3,
        "translation",
        "LINEAR",
        &[0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    )
}

fn clip(bytes: &[u8]) -> Clip {
    let animation = parse(bytes, &at(4.0)).unwrap_or_else(|e| panic!("{e}"));
    animation.to_clip(&at(4.0)).unwrap_or_else(|e| panic!("{e}"))
}

const RISING: [f32; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

fn with_channel(made: Made, target: Value) -> Made {
    let mut made = made;
    let channels = made.json["animations"][0]["channels"].as_array_mut().unwrap();
    channels.push(json!({ "sampler": 0, "target": target }));
    made
}

fn rising_made() -> Made {
    Made::new().channel(
        1,
        "translation",
        "LINEAR",
        &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0],
    )
}

#[test]
fn channels_that_move_no_node_are_ignored() {
    let pointer =
        |to: &str| json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": to } } });
    for target in [
        json!({ "path": "translation" }),
        json!({ "path": "pointer" }),
        pointer("/materials/0/emissiveFactor"),
        pointer("/nodes/x/translation"),
    ] {
        let bytes = with_channel(rising_made(), target).glb();
        let animation = parse(&bytes, &at(4.0)).unwrap();
        assert_eq!(animation.origin().ignored_channels, 1);
        assert!(close(&heights(&clip(&bytes)), &RISING));
    }
    // A pointer to a node's own property is a channel.
    let mut made = rising_made();
    made.json["animations"][0]["channels"][0]["target"] = pointer("/nodes/1/translation");
    assert!(close(&heights(&clip(&made.glb())), &RISING));
}

#[test]
fn extensions_of_meshes_and_materials_are_ignored_and_compressed_keys_refused() {
    let required = ["KHR_draco_mesh_compression", "KHR_mesh_quantization", "VRM"];
    let mut made = rising_made();
    made.json["extensionsRequired"] = json!(required);
    made.json["meshes"] = json!("none that one could read");
    made.json["nodes"][2]["mesh"] = json!(7);
    assert!(close(&heights(&clip(&made.glb())), &RISING));
    let mut made = rising_made();
    made.json["bufferViews"][1]["extensions"] = json!({ "EXT_meshopt_compression": {} });
    let error = parse(&made.glb(), &at(4.0)).err().unwrap().to_string();
    assert!(
        error.contains("EXT_meshopt_compression") && error.contains("gltf-transform"),
        "{error}"
    );
}

#[test]
fn props_beside_the_body_are_left_out() {
    let bytes = skinned().glb();
    let animation = parse(&bytes, &at(4.0)).unwrap();
    assert_eq!(animation.origin().props, ["Prop"]);
    let names: Vec<String> = clip(&bytes)
        .skeleton
        .joints
        .iter()
        .map(|j| j.name.clone())
        .collect();
    assert_eq!(names, ["Hips", "Leg_L"]);
    // A mirrored prop in a hand, too.
    let held = skinned().changed(
        "/nodes/2",
        json!({ "name": "Leg_L", "translation": [0.1, -0.5, 0.0], "children": [3] }),
    );
    assert_eq!(parse(&held.glb(), &at(4.0)).unwrap().origin().props, ["Prop"]);
    // Without a skin, one that no joint is above or below.
    let mut alone = skinned();
    alone.json.as_object_mut().unwrap().remove("skins");
    assert_eq!(parse(&alone.glb(), &at(4.0)).unwrap().origin().props, ["Prop"]);
    // A mirrored joint of the body is an error.
    let mut mirrored = skinned();
    mirrored.json["nodes"][2]["scale"] = json!([1.0, -1.0, 1.0]);
    let error = parse(&mirrored.glb(), &at(4.0)).err().unwrap().to_string();
    assert!(error.contains("\"Leg_L\": scale"), "{error}");
    assert!(error.contains("apply the scale in your tool"), "{error}");
}

#[test]
fn text_with_a_file_beside_it_or_a_data_uri_is_read() {
    use base64::Engine as _;

    let mut made = rising_made();
    let bytes = made.bytes.clone();
    let beside = json!([{ "byteLength": bytes.len(), "uri": "my%20walk.bin" }]);
    made.json["buffers"] = beside;
    let text = serde_json::to_vec(&made.json).unwrap();
    let found = |name: &str| (name == "my walk.bin").then(|| bytes.clone());
    let read = parse_beside(&text, &found, &at(4.0))
        .unwrap()
        .to_clip(&at(4.0))
        .unwrap();
    assert!(close(&heights(&read), &RISING));
    let error = parse(&text, &at(4.0)).err().unwrap().to_string();
    assert!(
        error.contains("\"my%20walk.bin\"") && error.contains("beside"),
        "{error}"
    );
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let uri = format!("data:application/octet-stream;base64,{data}");
    made.json["buffers"] = json!([{ "byteLength": bytes.len(), "uri": uri }]);
    let text = serde_json::to_vec(&made.json).unwrap();
    assert!(close(&heights(&clip(&text)), &RISING));
}

#[test]
fn sparse_keys_replace_those_of_their_accessor() {
    // All zero but the last key, which is one metre high.
    let mut made = Made::new().channel(1, "translation", "LINEAR", &[0.0; 9]);
    let start = made.bytes.len();
    made.bytes.extend([2_u8, 0, 0, 0]);
    made.bytes
        .extend([0.0_f32, 1.0, 0.0].iter().flat_map(|n| n.to_le_bytes()));
    let views = made.list("bufferViews");
    let first = views.len();
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": 1 }));
    views.push(json!({ "buffer": 0, "byteOffset": start + 4, "byteLength": 12 }));
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": first, "componentType": 5121 },
        "values": { "bufferView": first + 1 },
    });
    made.json["accessors"][1]["sparse"] = sparse;
    let wanted = [0.0, 0.0, 0.0, 1.0, 2.0];
    let mut without = Made::new().channel(1, "translation", "LINEAR", &[0.0; 9]);
    (without.json, without.bytes) = (made.json.clone(), made.bytes.clone());
    assert!(close(&heights(&clip(&made.glb())), &wanted));
    // Without bytes of its own, the rest is zero.
    without.json["accessors"][1]
        .as_object_mut()
        .unwrap()
        .remove("bufferView");
    let mut cut = Made::new();
    (cut.json, cut.bytes) = (without.json.clone(), without.bytes.clone());
    assert!(close(&heights(&clip(&without.glb())), &wanted));
    cut.json["accessors"][1]["sparse"]["count"] = json!(2);
    let error = parse(&cut.glb(), &at(4.0)).err().unwrap().to_string();
    assert!(error.contains("reach past the end"), "{error}");
}

#[test]
fn sparse_indices_must_rise() {
    let read = |indices: [u8; 2]| {
        let mut made = Made::new().channel(1, "translation", "LINEAR", &[0.0; 9]);
        let start = made.bytes.len();
        made.bytes.extend([indices[0], indices[1], 0, 0]);
        made.bytes.extend(
            [0.0_f32, 1.0, 0.0, 0.0, 2.0, 0.0]
                .iter()
                .flat_map(|n| n.to_le_bytes()),
        );
        let views = made.list("bufferViews");
        let first = views.len();
        views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": 2 }));
        views.push(json!({ "buffer": 0, "byteOffset": start + 4, "byteLength": 24 }));
        made.json["accessors"][1]["sparse"] = json!({
            "count": 2,
            "indices": { "bufferView": first, "componentType": 5121 },
            "values": { "bufferView": first + 1 },
        });
        parse(&made.glb(), &at(4.0)).map(drop).map_err(|e| e.to_string())
    };
    assert_eq!(read([1, 2]), Ok(()));
    for (indices, wanted) in [
        (
            [2, 1],
            "index 1 of its sparse keys is 1; they must rise, and be less than 3",
        ),
        ([1, 1], "index 1 of its sparse keys is 1"),
        ([1, 3], "index 1 of its sparse keys is 3"),
    ] {
        let error = read(indices).unwrap_err();
        assert!(error.contains(wanted), "{error}");
    }
}

#[test]
fn the_program_that_wrote_a_file_is_known() {
    let made = rising_made().changed("/asset", json!({ "version": "2.0", "generator": "Blender" }));
    let origin = parse(&made.glb(), &at(4.0)).unwrap().origin().clone();
    assert_eq!(
        (origin.generator.as_deref(), &*origin.animation),
        (Some("Blender"), "Go")
    );
    assert_eq!(
        parse(&rising("LINEAR"), &at(4.0)).unwrap().origin().generator,
        None
    );
}
