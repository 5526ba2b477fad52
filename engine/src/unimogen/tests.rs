use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use troupe_motion::features::{FEATURES_PER_JOINT, pose_features_from_world};
use troupe_motion::model::{Body, KeyTensors};
use troupe_motion::rotation::{angle_between, from_six_d, from_wxyz};
use troupe_motion::{Quat, Vec3};

use super::ROW_CHANNELS;
use super::noise::row_noise;
use super::rows::{Coding, PathPoint};
use super::schedule::Schedule;
use crate::pack::Pack;

#[derive(Deserialize)]
struct Reference {
    steps: BTreeMap<usize, Vec<usize>>,
    noise: Vec<Noise>,
    bodies: BTreeMap<String, Described>,
    requests: Vec<Request>,
    answers: Vec<Answer>,
}

#[derive(Deserialize)]
struct Noise {
    seed: u64,
    row: usize,
    values: Vec<[f32; 6]>,
}

#[derive(Deserialize)]
struct Described {
    rows: Vec<Vec<f32>>,
    slots: Vec<Vec<i64>>,
    reads: Vec<Vec<f32>>,
}

#[derive(Deserialize)]
struct Request {
    body: String,
    path_m: Vec<[f32; 2]>,
    heading_rad: Vec<f32>,
    #[serde(default)]
    past_root_m: Vec<[f32; 3]>,
    #[serde(default)]
    past_rotations_wxyz: Vec<Vec<[f32; 4]>>,
}

#[derive(Deserialize)]
struct Answer {
    path_features: Vec<[f32; 3]>,
    known_rows: Option<Vec<Vec<[f32; 6]>>>,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/unimogen")
}

fn reference() -> Reference {
    serde_json::from_str(&std::fs::read_to_string(folder().join("reference.json")).unwrap()).unwrap()
}

pub(super) fn pack() -> Pack {
    Pack::load(&folder()).unwrap()
}

fn coding(pack: &Pack) -> Coding {
    Coding::new(pack.manifest.unimogen.as_ref().unwrap(), 30.0)
}

fn schedule(pack: &Pack) -> Schedule {
    Schedule::new(&pack.manifest.unimogen.as_ref().unwrap().signal)
}

/// The Python tests compare with the same tolerance.
pub(super) fn assert_near(found: &[f32], wanted: &[f32]) {
    assert_eq!(found.len(), wanted.len());
    for (a, b) in found.iter().zip(wanted) {
        assert!((a - b).abs() < 2e-4, "{a} is not {b}");
    }
}

#[test]
fn noise_has_the_same_bits_as_the_reference() {
    for Noise { seed, row, values } in reference().noise {
        let mut found = vec![0.0; values.len() * ROW_CHANNELS];
        row_noise(seed, row, &mut found);
        assert_eq!(found, values.as_flattened(), "seed {seed}, row {row}");
        let mut longer = vec![0.0; 68 * ROW_CHANNELS];
        row_noise(seed, row, &mut longer);
        assert_eq!(
            longer[..found.len()],
            found,
            "a longer window begins with the same numbers"
        );
    }
}

#[test]
fn samplers_visit_the_steps_of_the_reference() {
    let schedule = schedule(&pack());
    for (count, wanted) in reference().steps {
        let found: Vec<usize> = (0..count).map(|index| schedule.step(index, count)).collect();
        assert_eq!(found, wanted);
    }
    assert!((0..50).map(|index| schedule.step(index, 50)).eq((0..50).rev()));
}

#[test]
fn ddim_keeps_the_noise_of_its_input() {
    let schedule = Schedule::new(&[0.64, 0.36]);
    // x = 0.6 c + 0.8 e with c = 2 and e = -1; then 0.8 c + 0.6 e.
    let mut noisy = [0.6 * 2.0 - 0.8];
    schedule.advance(0, 2, &mut noisy, &[2.0]);
    assert!((noisy[0] - 1.0).abs() < 1e-6, "{noisy:?}");
    schedule.advance(1, 2, &mut noisy, &[5.0]);
    assert_eq!(noisy, [5.0]);
}

#[test]
fn bodies_have_the_descriptions_of_the_reference() {
    let pack = pack();
    for (name, wanted) in reference().bodies {
        let body = pack.body(&name).unwrap();
        for (row, wanted) in body.description.iter().zip(&wanted.rows) {
            assert_near(row, wanted);
        }
        assert!(
            body.rows
                .iter()
                .zip(&wanted.slots)
                .all(|(found, wanted)| found[..] == wanted[..])
        );
        assert!(
            body.reads
                .iter()
                .zip(&wanted.reads)
                .all(|(found, wanted)| found[..] == wanted[..])
        );
        assert_eq!(
            (body.row_count(), body.rows.len()),
            (wanted.rows.len(), wanted.slots.len())
        );
    }
}

fn path_of(request: &Request) -> Vec<PathPoint> {
    let points = request.path_m.iter().zip(&request.heading_rad);
    points.map(|(&[x, z], &heading)| [x, z, heading]).collect()
}

pub(super) fn key(body: &Body, root: Vec3, rotations: &[Quat]) -> KeyTensors {
    let mut pose = vec![0.0; body.joints() * FEATURES_PER_JOINT];
    // Positions are not used.
    pose_features_from_world(root, &vec![root; body.joints()], rotations, &mut pose);
    KeyTensors {
        global_root: Some([root.x, root.y, root.z, 1.0, 0.0]),
        pose: Some(pose.into()),
        ..KeyTensors::default()
    }
}

#[test]
fn paths_and_keyframes_become_the_inputs_of_the_reference() {
    let (
        pack,
        Reference {
            requests, answers, ..
        },
    ) = (pack(), reference());
    let coding = coding(&pack);
    for (request, answer) in requests.iter().zip(&answers) {
        let body = pack.body(&request.body).unwrap();
        let path = path_of(request);
        let features = coding.path_features(&path, body.size_m);
        assert_near(features.as_flattened(), answer.path_features.as_flattened());
        let Some(wanted) = &answer.known_rows else {
            continue;
        };
        for (frame, (&root, rotations)) in request
            .past_root_m
            .iter()
            .zip(&request.past_rotations_wxyz)
            .enumerate()
        {
            let rotations: Vec<Quat> = rotations.iter().map(|&q| from_wxyz(q)).collect();
            let rows = coding
                .encode(body, &key(body, root.into(), &rotations), path[frame])
                .unwrap();
            for (row, wanted) in rows.chunks_exact(ROW_CHANNELS).zip(wanted) {
                assert_near(row, &wanted[frame]);
            }
        }
    }
}

#[test]
fn decoding_rows_gives_the_encoded_motion() {
    let (pack, Reference { requests, .. }) = (pack(), reference());
    let coding = coding(&pack);
    let request = &requests[2];
    let body = pack.body(&request.body).unwrap();
    let path = &path_of(request)[..4];
    let mut rows = vec![0.0; body.row_count() * 4 * ROW_CHANNELS];
    let world: Vec<Vec<Quat>> = (request.past_rotations_wxyz.iter())
        .map(|frame| frame.iter().map(|&q| from_wxyz(q)).collect())
        .collect();
    for (frame, world) in world.iter().enumerate() {
        let key = key(body, request.past_root_m[frame].into(), world);
        let encoded = coding.encode(body, &key, path[frame]).unwrap();
        for (row, values) in encoded.chunks_exact(ROW_CHANNELS).enumerate() {
            rows[(row * 4 + frame) * ROW_CHANNELS..][..ROW_CHANNELS].copy_from_slice(values);
        }
    }
    let motion = coding.decode(body, &rows, path);
    for (frame, world) in world.iter().enumerate() {
        assert_near(&motion.root[frame * 5..][..3], &request.past_root_m[frame]);
        for (six_d, wanted) in motion.rotations.as_chunks().0[frame * body.joints()..]
            .iter()
            .zip(world)
        {
            assert!(angle_between(from_six_d(*six_d), *wanted) < 1e-3);
        }
    }
    assert_eq!(motion.contacts.len(), 4 * 4);
}

#[test]
fn a_body_that_stands_still_is_in_contact() {
    let pack = pack();
    let (coding, body) = (coding(&pack), pack.body("turned").unwrap());
    let table = pack.manifest.unimogen.as_ref().unwrap();
    let mut rows = vec![0.0; body.row_count() * 4 * ROW_CHANNELS];
    // The neutral pose has no offset and no bends.
    for frame in 0..4 {
        for axis in 0..3 {
            let (low, high) = (table.root_low[axis], table.root_high[axis]);
            rows[frame * ROW_CHANNELS + axis] = -low / (high - low) * 2.0 - 1.0;
        }
    }
    let still = coding.decode(body, &rows, &[[1.0, 2.0, 0.5]; 4]);
    assert_eq!(still.contacts, [1.0; 16]);
    assert_near(
        &still.root[..5],
        &[1.0, body.height_m, 2.0, 0.5_f32.cos(), 0.5_f32.sin()],
    );
    let slides: Vec<PathPoint> = (0..4).map(|frame| [1.0, frame as f32, 0.5]).collect();
    assert!(
        coding
            .decode(body, &rows, &slides)
            .contacts
            .iter()
            .all(|&contact| contact == 0.0)
    );
}
