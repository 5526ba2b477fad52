//! Answers as the wire has them: glTF with the extension `MMCP_motion`.

use serde::Serialize;
use serde_json::{Map, Value};
use troupe_motion::Quat;
use troupe_motion::glb::GlbError;
use troupe_motion::gltf::{GltfMotion, write_gltf};

use super::finish::Made;
use super::model::VERSION;
use super::take::{Note, Take};
use super::trajectory::{Trajectory, trajectory};

/// The name of the protocol's extension.
const EXTENSION: &str = "MMCP_motion";

/// The extension.
#[derive(Debug, Serialize)]
struct Extension<'a> {
    version: &'static str,
    model: &'a str,
    fps: f32,
    samples: Vec<Sample>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<Note>,
}

/// What is told of a sample.
#[derive(Debug, Serialize)]
struct Sample {
    name: String,
    num_frames: usize,
    chunk_boundaries: Vec<usize>,
    #[serde(skip_serializing_if = "Map::is_empty")]
    foot_contacts: Map<String, Value>,
    trajectory: Trajectory,
}

/// The document of a take's samples.
///
/// # Errors
/// [`GlbError`] where it cannot be written.
pub fn write(take: &Take, samples: &[Made]) -> Result<Vec<u8>, GlbError> {
    let skeleton = &take.model.rig().skeleton;
    let contacts = take.model.contact_joints();
    let mut notes = take.notes.clone();
    let (mut told, mut motions) = (Vec::new(), Vec::new());
    for (nth, made) in samples.iter().enumerate() {
        let name = format!("sample_{nth}");
        for note in &made.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        told.push(Sample {
            name: name.clone(),
            num_frames: made.track.len(),
            chunk_boundaries: made.boundaries.clone(),
            foot_contacts: contacts
                .iter()
                .enumerate()
                .map(|(bit, joint)| {
                    let flags = made.track.contacts.iter().map(|bits| bits >> bit & 1 == 1);
                    (joint.clone(), flags.collect())
                })
                .collect(),
            trajectory: trajectory(&made.track, skeleton, take.clock.fps, take.is_loop),
        });
        motions.push(GltfMotion {
            name,
            roots: made.track.roots.clone(),
            rotations: ordered(take, made),
        });
    }
    let extension = Extension {
        version: VERSION,
        model: &take.model.id,
        fps: take.clock.fps,
        samples: told,
        notes,
    };
    let extension = serde_json::to_value(extension).map_err(|error| GlbError::Json(error.to_string()))?;
    write_gltf(
        &take.joints.rest,
        take.clock.fps,
        &motions,
        (EXTENSION, extension),
    )
}

/// Rotations in the request's order of joints.
fn ordered(take: &Take, made: &Made) -> Vec<Quat> {
    let frames = 0..made.track.len();
    frames
        .flat_map(|frame| {
            let pose = made.track.pose(frame);
            let wire = |&joint: &usize| take.joints.axes.to_wire(joint, pose[joint]);
            take.joints.order.iter().map(wire)
        })
        .collect()
}
