//! Writes motions of one skeleton as a single glTF 2.0 document in JSON: a node for each joint, an
//! animation for each motion, and the numbers in a `data:` URI.

use gltf_json as json;
use json::Index;
use json::animation::Property;

use glam::{Quat, Vec3};

use crate::glb::{Builder, GlbError};

/// A joint at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfJoint {
    /// Unique in the skeleton.
    pub name: String,
    /// Index of the parent; none for the root.
    pub parent: Option<usize>,
    /// Place in the parent's frame of reference at rest, metres.
    pub translation_m: Vec3,
    /// Rotation relative to the parent at rest.
    pub rotation: Quat,
}

/// A motion that becomes an animation.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfMotion {
    /// Name of the animation.
    pub name: String,
    /// World position of the root, one a frame, metres.
    pub roots: Vec<Vec3>,
    /// `frames * joints` rotations in the order of the joints, each relative to its parent; the
    /// root's in the world.
    pub rotations: Vec<Quat>,
}

/// Writes a document of `motions`, which have the joints `joints` and a frame every `1 / fps`
/// seconds, with a root extension of the given name.
///
/// # Errors
/// [`GlbError::Json`] if the document cannot be written.
pub fn write_gltf(
    joints: &[GltfJoint],
    fps: f32,
    motions: &[GltfMotion],
    extension: (&str, json::Value),
) -> Result<Vec<u8>, GlbError> {
    let mut document = Builder::default();
    let root = joints
        .iter()
        .position(|joint| joint.parent.is_none())
        .unwrap_or(0);
    for (index, joint) in joints.iter().enumerate() {
        let children = joints
            .iter()
            .enumerate()
            .filter(|(_, child)| child.parent == Some(index));
        let children: Vec<_> = children.map(|(child, _)| Index::new(child as u32)).collect();
        document.root.nodes.push(json::Node {
            name: Some(joint.name.clone()),
            children: (!children.is_empty()).then_some(children),
            translation: Some(joint.translation_m.to_array()),
            rotation: Some(json::scene::UnitQuaternion(joint.rotation.to_array())),
            ..Default::default()
        });
    }
    document.add_scene(root);
    document.root.skins.push(json::Skin {
        extensions: None,
        extras: Default::default(),
        inverse_bind_matrices: None,
        joints: (0..joints.len()).map(|joint| Index::new(joint as u32)).collect(),
        name: Some("skin".to_owned()),
        skeleton: None,
    });
    let most = motions.iter().map(|motion| motion.roots.len()).max().unwrap_or(0);
    let times = document.add_times(most, fps);
    for motion in motions {
        let times = match motion.roots.len() {
            frames if frames == most => times,
            frames => document.add_times(frames, fps),
        };
        let mut tracks = Vec::with_capacity(joints.len() + 1);
        for joint in 0..joints.len() {
            let track = motion.rotations.iter().copied().skip(joint).step_by(joints.len());
            tracks.push((joint, Property::Rotation, document.add_rotations(track)));
        }
        tracks.push((root, Property::Translation, document.add_vectors(&motion.roots)));
        document.push_animation(&motion.name, times, tracks);
    }
    let (name, value) = extension;
    document.root.extensions_used.push(name.to_owned());
    let extensions = document.root.extensions.get_or_insert_default();
    extensions.others.insert(name.to_owned(), value);
    document.into_json()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_has_an_animation_a_motion_and_its_extension() {
        let joint = |name: &str, parent| GltfJoint {
            name: name.to_owned(),
            parent,
            translation_m: Vec3::Y,
            rotation: Quat::IDENTITY,
        };
        // The root comes second.
        let joints = [joint("foot", Some(1)), joint("hips", None)];
        let turn = Quat::from_rotation_y(0.5);
        let motion = |name: &str, frames: usize| GltfMotion {
            name: name.to_owned(),
            roots: (0..frames).map(|f| Vec3::X * f as f32).collect(),
            rotations: [Quat::IDENTITY, turn].repeat(frames),
        };
        let value = json::serialize::to_value(vec![1, 2]).unwrap();
        let bytes = write_gltf(&joints, 30.0, &[motion("a", 3), motion("b", 2)], ("X_y", value)).unwrap();
        let document: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(document["extensions"]["X_y"], serde_json::json!([1, 2]));
        assert_eq!(document["extensionsUsed"], serde_json::json!(["X_y"]));
        assert_eq!(document["scenes"][0]["nodes"], serde_json::json!([1]));
        let file = gltf::Gltf::from_slice_without_validation(&bytes).unwrap();
        assert_eq!(file.animations().count(), 2);
        let uri = document["buffers"][0]["uri"].as_str().unwrap();
        let bytes = STANDARD.decode(uri.split_once(',').unwrap().1).unwrap();
        for (animation, frames) in file.animations().zip([3, 2]) {
            let mut paths = Vec::new();
            for channel in animation.channels() {
                let reader = channel.reader(|_| Some(&bytes));
                assert_eq!(reader.read_inputs().unwrap().count(), frames);
                let node = channel.target().node().index();
                match reader.read_outputs().unwrap() {
                    gltf::animation::util::ReadOutputs::Translations(v) => {
                        assert_eq!(v.last(), Some([frames as f32 - 1.0, 0.0, 0.0]));
                        paths.push((node, "translation"));
                    }
                    gltf::animation::util::ReadOutputs::Rotations(v) => {
                        let first = v.into_f32().next().unwrap();
                        let expected = if node == 1 { turn } else { Quat::IDENTITY };
                        assert_eq!(first, expected.to_array(), "x, y, z, w");
                        paths.push((node, "rotation"));
                    }
                    _ => panic!("neither translation nor rotation"),
                }
            }
            assert_eq!(paths, [(0, "rotation"), (1, "rotation"), (1, "translation")]);
        }
    }

    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
}
