//! Writes a clip as binary glTF 2.0: a node for each joint, one animation, and a plain mesh for
//! each bone so that viewers show something.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Index, Root};

use glam::{Quat, Vec3};

use crate::clip::Clip;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

/// Bones shorter than this get no mesh, metres.
const MIN_BONE_M: f32 = 1e-3;

/// Why a clip could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GlbError {
    /// The JSON part could not be made.
    #[error("the glTF JSON could not be made: {0}")]
    Json(String),
    /// The format's 32-bit lengths do not suffice.
    #[error("the clip is too long for a GLB file")]
    TooLarge,
}

/// The bytes of a GLB file of `clip`. Nodes have the joints' names. Root translation and all
/// rotations are linear animation tracks.
///
/// # Errors
/// [`GlbError::TooLarge`] for a clip beyond 4 GiB.
pub fn write_glb(clip: &Clip) -> Result<Vec<u8>, GlbError> {
    let mut scene = Builder::default();
    scene.add_nodes(clip);
    scene.add_bones(&clip.skeleton);
    scene.add_animation(clip);
    scene.finish()
}

/// The JSON root and the binary chunk while they grow.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) root: Root,
    bytes: Vec<u8>,
}

/// One animated property of a node: node, property, and values.
pub(crate) type Track = (usize, json::animation::Property, Index<json::Accessor>);

impl Builder {
    fn add_nodes(&mut self, clip: &Clip) {
        let skeleton = &*clip.skeleton;
        for (index, joint) in skeleton.joints.iter().enumerate() {
            let children: Vec<_> = (0..skeleton.joint_count())
                .filter(|&c| skeleton.joints[c].parent == Some(index))
                .map(|c| Index::new(c as u32))
                .collect();
            // The pose of the first frame, for viewers that do not play.
            let place = if index == 0 {
                clip.root_positions.first().copied()
            } else {
                Some(joint.offset_m)
            };
            let turn = clip
                .rotations
                .get(index)
                .map(|q| json::scene::UnitQuaternion(q.to_array()));
            self.root.nodes.push(json::Node {
                name: Some(joint.name.clone()),
                children: (!children.is_empty()).then_some(children),
                translation: place.map(|p| p.to_array()),
                rotation: turn,
                ..Default::default()
            });
        }
        self.add_scene(0);
    }

    /// A scene of the tree below one node.
    pub(crate) fn add_scene(&mut self, root: usize) {
        self.root.scenes.push(json::Scene {
            extensions: None,
            extras: Default::default(),
            name: None,
            nodes: vec![Index::new(root as u32)],
        });
        self.root.scene = Some(Index::new(0));
        self.root.asset.generator = Some(concat!("troupe-motion ", env!("CARGO_PKG_VERSION")).to_owned());
    }

    /// Gives every joint with children a mesh: a slim octahedron to each of them.
    fn add_bones(&mut self, skeleton: &Skeleton) {
        for joint in 0..skeleton.joint_count() {
            let mut vertices = Vec::new();
            let mut indices = Vec::new();
            for child in skeleton.joints.iter().filter(|j| j.parent == Some(joint)) {
                octahedron(child.offset_m, &mut vertices, &mut indices);
            }
            if vertices.is_empty() {
                continue;
            }
            let positions = self.add_vectors(&vertices);
            let corners = self.add_indices(&indices);
            let attributes = [(Valid(json::mesh::Semantic::Positions), positions)].into();
            let primitive = json::mesh::Primitive {
                attributes,
                extensions: None,
                extras: Default::default(),
                indices: Some(corners),
                material: None,
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
            };
            let mesh = json::Mesh {
                extensions: None,
                extras: Default::default(),
                name: Some(skeleton.joints[joint].name.clone()),
                primitives: vec![primitive],
                weights: None,
            };
            self.root.nodes[joint].mesh = Some(self.root.push(mesh));
        }
    }

    fn add_animation(&mut self, clip: &Clip) {
        let times = self.add_times(clip.frames(), clip.fps);
        let mut tracks = vec![(
            0,
            json::animation::Property::Translation,
            self.add_vectors(&clip.root_positions),
        )];
        let joints = clip.skeleton.joint_count();
        for joint in 0..joints {
            let track = clip.rotations.iter().copied().skip(joint).step_by(joints);
            let output = self.add_rotations(track);
            tracks.push((joint, json::animation::Property::Rotation, output));
        }
        self.push_animation("motion", times, tracks);
    }

    /// The times of this many frames, from 0 on.
    pub(crate) fn add_times(&mut self, frames: usize, fps: f32) -> Index<json::Accessor> {
        let times: Vec<f32> = (0..frames).map(|f| f as f32 / fps).collect();
        let last = times.last().copied().unwrap_or(0.0);
        self.add_floats(&times, Type::Scalar, Some((vec![0.0], vec![last])))
    }

    /// The rotations of one joint, each in the hemisphere of the one before.
    pub(crate) fn add_rotations(&mut self, rotations: impl Iterator<Item = Quat>) -> Index<json::Accessor> {
        let mut track = Vec::new();
        let mut before = None;
        for q in rotations {
            let q = before.map_or(q, |before| align_sign(q, before));
            track.extend(q.to_array());
            before = Some(q);
        }
        self.add_floats(&track, Type::Vec4, None)
    }

    /// An animation of linear tracks that share their times.
    pub(crate) fn push_animation(&mut self, name: &str, times: Index<json::Accessor>, tracks: Vec<Track>) {
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        for (nth, (node, property, output)) in tracks.into_iter().enumerate() {
            samplers.push(json::animation::Sampler {
                extensions: None,
                extras: Default::default(),
                input: times,
                interpolation: Valid(json::animation::Interpolation::Linear),
                output,
            });
            channels.push(json::animation::Channel {
                sampler: Index::new(nth as u32),
                target: json::animation::Target {
                    extensions: None,
                    extras: Default::default(),
                    node: Index::new(node as u32),
                    path: Valid(property),
                },
                extensions: None,
                extras: Default::default(),
            });
        }
        self.root.animations.push(json::Animation {
            extensions: None,
            extras: Default::default(),
            channels,
            name: Some(name.to_owned()),
            samplers,
        });
    }

    pub(crate) fn add_vectors(&mut self, vectors: &[Vec3]) -> Index<json::Accessor> {
        let min = vectors.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let max = vectors.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let flat: Vec<f32> = vectors.iter().flat_map(|v| v.to_array()).collect();
        self.add_floats(
            &flat,
            Type::Vec3,
            Some((min.to_array().to_vec(), max.to_array().to_vec())),
        )
    }

    fn add_floats(
        &mut self,
        values: &[f32],
        kind: Type,
        bounds: Option<(Vec<f32>, Vec<f32>)>,
    ) -> Index<json::Accessor> {
        let count = values.len() / kind.multiplicity();
        let view = self.add_view(values.iter().flat_map(|v| v.to_le_bytes()));
        self.add_accessor(view, count, ComponentType::F32, kind, bounds)
    }

    fn add_indices(&mut self, values: &[u16]) -> Index<json::Accessor> {
        let view = self.add_view(values.iter().flat_map(|v| v.to_le_bytes()));
        self.add_accessor(view, values.len(), ComponentType::U16, Type::Scalar, None)
    }

    fn add_view(&mut self, bytes: impl Iterator<Item = u8>) -> Index<json::buffer::View> {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - start;
        pad(&mut self.bytes, 0);
        self.root.push(json::buffer::View {
            buffer: Index::new(0),
            byte_length: USize64::from(length),
            byte_offset: Some(USize64::from(start)),
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: Default::default(),
        })
    }

    fn add_accessor(
        &mut self,
        view: Index<json::buffer::View>,
        count: usize,
        component: ComponentType,
        kind: Type,
        bounds: Option<(Vec<f32>, Vec<f32>)>,
    ) -> Index<json::Accessor> {
        let (min, max) = bounds.map(|(min, max)| (min.into(), max.into())).unzip();
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(kind),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    /// The document alone, with its bytes in a `data:` URI.
    pub(crate) fn into_json(mut self) -> Result<Vec<u8>, GlbError> {
        let uri = format!(
            "data:application/octet-stream;base64,{}",
            STANDARD.encode(&self.bytes)
        );
        self.push_buffer(Some(uri));
        self.root.to_vec().map_err(|e| GlbError::Json(e.to_string()))
    }

    fn push_buffer(&mut self, uri: Option<String>) {
        self.root.buffers.push(json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            name: None,
            uri,
            extensions: None,
            extras: Default::default(),
        });
    }

    /// The container: a header, the JSON chunk, the binary chunk; all lengths are multiples of
    /// four.
    fn finish(mut self) -> Result<Vec<u8>, GlbError> {
        self.push_buffer(None);
        let mut text = self.root.to_vec().map_err(|e| GlbError::Json(e.to_string()))?;
        pad(&mut text, b' ');
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let length = |n: usize| {
            u32::try_from(n)
                .map_err(|_| GlbError::TooLarge)
                .map(u32::to_le_bytes)
        };
        let mut out = Vec::with_capacity(total);
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&2u32.to_le_bytes());
        out.extend_from_slice(&length(total)?);
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            out.extend_from_slice(&length(chunk.len())?);
            out.extend_from_slice(kind);
            out.extend_from_slice(chunk);
        }
        Ok(out)
    }
}

/// Pads to a multiple of four.
fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}

/// Adds a slim octahedron from the origin to `tip`; nothing for a bone that is too short.
fn octahedron(tip: Vec3, vertices: &mut Vec<Vec3>, indices: &mut Vec<u16>) {
    let Some(along) = tip.try_normalize().filter(|_| tip.length() >= MIN_BONE_M) else {
        return;
    };
    // All bones of one joint share a mesh; 16-bit indices suffice for ten thousand of them.
    let Ok(base) = u16::try_from(vertices.len()) else {
        return;
    };
    if base > u16::MAX - 6 {
        return;
    }
    let length = tip.length();
    let across = along.any_orthonormal_vector();
    let (a, b) = (across * length * 0.08, along.cross(across) * length * 0.08);
    let middle = tip * 0.2;
    vertices.extend([Vec3::ZERO, middle + a, middle + b, middle - a, middle - b, tip]);
    for side in 0..4u16 {
        let (this, next) = (base + 1 + side, base + 1 + (side + 1) % 4);
        // Counter-clockwise seen from outside.
        indices.extend([base, next, this, base + 5, this, next]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{arm, walk};

    #[test]
    fn glb_holds_the_clip() {
        let clip = walk(20);
        let bytes = write_glb(&clip).unwrap();
        // Validates JSON, indices, accessor bounds and chunk lengths.
        let file = gltf::Gltf::from_slice(&bytes).unwrap();
        let blob = file.blob.clone().unwrap();
        assert_eq!(file.nodes().count(), clip.skeleton.joint_count());
        let animation = file.animations().next().unwrap();
        assert_eq!(animation.channels().count(), 1 + clip.skeleton.joint_count());
        for channel in animation.channels() {
            let reader = channel.reader(|_| Some(&blob));
            let times: Vec<f32> = reader.read_inputs().unwrap().collect();
            assert_eq!(times.len(), 20);
            assert!((times[19] - 19.0 / 30.0).abs() < 1e-6);
            let node = channel.target().node();
            assert_eq!(
                node.name(),
                Some(clip.skeleton.joints[node.index()].name.as_str())
            );
            match reader.read_outputs().unwrap() {
                gltf::animation::util::ReadOutputs::Translations(v) => {
                    let read: Vec<Vec3> = v.map(Vec3::from).collect();
                    assert_eq!(read, clip.root_positions);
                }
                gltf::animation::util::ReadOutputs::Rotations(v) => {
                    for (f, q) in v.into_f32().enumerate() {
                        let q = Quat::from_array(q);
                        let want = clip.rotations_at(f)[node.index()];
                        assert!(q.dot(want).abs() > 0.999_999, "joint {} frame {f}", node.index());
                    }
                }
                _ => panic!("neither translation nor rotation"),
            }
        }
    }

    #[test]
    fn bones_point_at_the_children() {
        let clip = arm();
        let file = gltf::Gltf::from_slice(&write_glb(&clip).unwrap()).unwrap();
        let blob = file.blob.clone().unwrap();
        for node in file.nodes() {
            let child = clip
                .skeleton
                .joints
                .iter()
                .find(|j| j.parent == Some(node.index()));
            assert_eq!(node.mesh().is_some(), child.is_some(), "a mesh for every bone");
            let (Some(mesh), Some(child)) = (node.mesh(), child) else {
                continue;
            };
            let primitive = mesh.primitives().next().unwrap();
            let reader = primitive.reader(|_| Some(&blob));
            let tip = reader.read_positions().unwrap().last().unwrap();
            assert_eq!(Vec3::from(tip), child.offset_m);
            assert_eq!(reader.read_indices().unwrap().into_u32().count(), 24);
        }
    }

    #[test]
    fn triangles_face_outwards() {
        let (mut v, mut i) = (Vec::new(), Vec::new());
        octahedron(Vec3::new(0.1, 0.3, -0.2), &mut v, &mut i);
        let centre = Vec3::new(0.1, 0.3, -0.2) * 0.3;
        for t in i.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|n| v[usize::from(t[n])]);
            let normal = (b - a).cross(c - a);
            assert!(
                normal.dot((a + b + c) / 3.0 - centre) > 0.0,
                "{t:?} faces inwards"
            );
        }
    }
}
