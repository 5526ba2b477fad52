//! Answers in the protocol's form: glTF with the extension `MMCP_motion`.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value};
use troupe_character::take::{Made, Note, trajectory};
use troupe_motion::Quat;
use troupe_motion::glb::GlbError;
use troupe_motion::gltf::{GltfMotion, write_gltf};

use super::asked::Asked;
use super::model::VERSION;
use super::trajectory::Wire;

/// The name of the protocol's extension.
const EXTENSION: &str = "MMCP_motion";

/// The members of `MMCP_motion`.
#[derive(Debug, Serialize)]
struct Extension<'a> {
    version: &'static str,
    model: &'a str,
    fps: f32,
    samples: Vec<Sample>,
    /// Joints of the request for those of the model, if they differ.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    canonical_to_request: BTreeMap<String, String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<Note>,
}

/// Metadata of one sample, beside its channels.
#[derive(Debug, Serialize)]
struct Sample {
    name: String,
    num_frames: usize,
    chunk_boundaries: Vec<usize>,
    #[serde(skip_serializing_if = "Map::is_empty")]
    foot_contacts: Map<String, Value>,
    trajectory: Wire,
}

/// Writes the document for all samples of a request.
///
/// # Errors
/// [`GlbError`] for numbers that JSON cannot hold.
pub fn write(asked: &Asked, samples: &[Made]) -> Result<Vec<u8>, GlbError> {
    let skeleton = &asked.joints.skeleton;
    let (clock, is_loop) = (&asked.take.clock, asked.take.is_loop);
    let contacts = &asked.joints.contacts;
    let mut notes = asked.notes.clone();
    let (mut listed, mut motions) = (Vec::new(), Vec::new());
    for (nth, made) in samples.iter().enumerate() {
        let name = format!("sample_{nth}");
        for note in &made.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        listed.push(Sample {
            name: name.clone(),
            num_frames: made.track.len(),
            chunk_boundaries: made.boundaries.clone(),
            foot_contacts: contacts
                .iter()
                .map(|(bit, joint)| {
                    let flags = made.track.contacts.iter().map(|bits| bits >> bit & 1 == 1);
                    (joint.clone(), flags.collect())
                })
                .collect(),
            trajectory: Wire::new(trajectory(&made.track, skeleton, clock.fps, is_loop), is_loop),
        });
        motions.push(GltfMotion {
            name,
            roots: made.track.roots.clone(),
            rotations: ordered(asked, made),
        });
    }
    let extension = Extension {
        version: VERSION,
        model: &asked.model.id,
        fps: clock.fps,
        samples: listed,
        canonical_to_request: asked.joints.pairs(),
        notes,
    };
    let extension = serde_json::to_value(extension).map_err(|error| GlbError::Json(error.to_string()))?;
    write_gltf(&asked.joints.rest, clock.fps, &motions, (EXTENSION, extension))
}

/// Rotations in the request's order of joints.
fn ordered(asked: &Asked, made: &Made) -> Vec<Quat> {
    let frames = 0..made.track.len();
    frames
        .flat_map(|frame| {
            let pose = made.track.pose(frame);
            let wire = |&joint: &usize| asked.joints.axes.to_wire(joint, pose[joint]);
            asked.joints.order.iter().map(wire)
        })
        .collect()
}
