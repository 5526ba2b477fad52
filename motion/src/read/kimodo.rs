//! Kimodo's NumPy archives: SOMA, SMPL-X or a G1 as places and rotation matrices of all joints.

use glam::{DMat3, DQuat, DVec3};

use super::adapted::Arrays;
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::report::{Basis, Finding, Format, Up};
use super::smpl;
use super::stance::Stated;
use super::units::UNITS;
use crate::clip::{MAX_FRAMES, MAX_ROTATIONS};
use crate::files::NumpyError;
use crate::files::npz::Unpacked;

/// Rate of Kimodo, Hz. ARDY has 25.
const USUAL_FPS: f32 = 30.0;
/// Largest error of a rotation matrix.
const MATRIX_TOLERANCE: f64 = 1e-2;

/// Kimodo's skeletons by their number of joints. Each joint stands as `parent>name`, or as `name`
/// if the joint before it is its parent.
const SOMA_77: &str = "Hips Spine1 Spine2 Chest Neck1 Neck2 Head HeadEnd Head>Jaw Head>LeftEye Head>RightEye \
    Chest>LeftShoulder LeftArm LeftForeArm LeftHand LeftHandThumb1 LeftHandThumb2 LeftHandThumb3 LeftHandThumbEnd \
    LeftHand>LeftHandIndex1 LeftHandIndex2 LeftHandIndex3 LeftHandIndex4 LeftHandIndexEnd \
    LeftHand>LeftHandMiddle1 LeftHandMiddle2 LeftHandMiddle3 LeftHandMiddle4 LeftHandMiddleEnd \
    LeftHand>LeftHandRing1 LeftHandRing2 LeftHandRing3 LeftHandRing4 LeftHandRingEnd \
    LeftHand>LeftHandPinky1 LeftHandPinky2 LeftHandPinky3 LeftHandPinky4 LeftHandPinkyEnd \
    Chest>RightShoulder RightArm RightForeArm RightHand RightHandThumb1 RightHandThumb2 RightHandThumb3 \
    RightHandThumbEnd \
    RightHand>RightHandIndex1 RightHandIndex2 RightHandIndex3 RightHandIndex4 RightHandIndexEnd \
    RightHand>RightHandMiddle1 RightHandMiddle2 RightHandMiddle3 RightHandMiddle4 RightHandMiddleEnd \
    RightHand>RightHandRing1 RightHandRing2 RightHandRing3 RightHandRing4 RightHandRingEnd \
    RightHand>RightHandPinky1 RightHandPinky2 RightHandPinky3 RightHandPinky4 RightHandPinkyEnd \
    Hips>LeftLeg LeftShin LeftFoot LeftToeBase LeftToeEnd Hips>RightLeg RightShin RightFoot RightToeBase RightToeEnd";
const SOMA_30: &str = "Hips Spine1 Spine2 Chest Neck1 Neck2 Head Head>Jaw Head>LeftEye Head>RightEye \
    Chest>LeftShoulder LeftArm LeftForeArm LeftHand LeftHandThumbEnd LeftHand>LeftHandMiddleEnd \
    Chest>RightShoulder RightArm RightForeArm RightHand RightHandThumbEnd RightHand>RightHandMiddleEnd \
    Hips>LeftLeg LeftShin LeftFoot LeftToeBase Hips>RightLeg RightShin RightFoot RightToeBase";
const SMPL_22: &str = "pelvis pelvis>left_hip pelvis>right_hip pelvis>spine1 left_hip>left_knee \
    right_hip>right_knee spine1>spine2 left_knee>left_ankle right_knee>right_ankle spine2>spine3 \
    left_ankle>left_foot right_ankle>right_foot spine3>neck spine3>left_collar spine3>right_collar neck>head \
    left_collar>left_shoulder right_collar>right_shoulder left_shoulder>left_elbow right_shoulder>right_elbow \
    left_elbow>left_wrist right_elbow>right_wrist";
const G1_34: &str = "pelvis left_hip_pitch left_hip_roll left_hip_yaw left_knee left_ankle_pitch left_ankle_roll \
    left_toe_base pelvis>right_hip_pitch right_hip_roll right_hip_yaw right_knee right_ankle_pitch right_ankle_roll \
    right_toe_base pelvis>waist_yaw waist_roll waist_pitch left_shoulder_pitch left_shoulder_roll left_shoulder_yaw \
    left_elbow left_wrist_roll left_wrist_pitch left_wrist_yaw left_hand_roll waist_pitch>right_shoulder_pitch \
    right_shoulder_roll right_shoulder_yaw right_elbow right_wrist_roll right_wrist_pitch right_wrist_yaw \
    right_hand_roll";
const SKELETONS: [(usize, &str, &str); 4] = [
    (77, "SOMA, 77 joints", SOMA_77),
    (30, "SOMA, 30 joints", SOMA_30),
    (22, "SMPL-X, 22 joints", SMPL_22),
    (34, "Unitree G1, 34 joints", G1_34),
];

/// Whether an archive is Kimodo's.
pub(super) fn is_kimodo(archive: &Unpacked<'_>) -> bool {
    archive.has("posed_joints") && archive.has("global_rot_mats")
}

pub(super) fn parse(archive: &mut Unpacked<'_>, options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    let (shape, places) = archive.floats("posed_joints")?;
    let joints = shape.get(1).map_or(0, |&joints| joints as usize);
    let Some((_, skeleton, words)) = SKELETONS.into_iter().find(|skeleton| skeleton.0 == joints) else {
        let reason =
            format!("shape {shape:?}; it must be frames, 77, 30, 22 or 34 joints, 3 (one sample a file)");
        return Err(NumpyError::array("posed_joints", reason).into());
    };
    let is_robot = options
        .skeleton
        .as_ref()
        .is_some_and(|skeleton| skeleton.robot.is_some());
    if joints == 34 && is_robot {
        return Err(ReadErrorKind::NotRead {
            format: "Kimodo's npz of a G1, whose joints have axes of their own,",
            how: "the .csv that Kimodo writes beside it holds the hinges' angles, and is read",
        });
    }
    let frames = shape[0] as usize;
    if frames > MAX_FRAMES.min(MAX_ROTATIONS / joints) || frames == 0 {
        let reason = format!(
            "{frames} frames; allowed: 1 to {}",
            MAX_FRAMES.min(MAX_ROTATIONS / joints)
        );
        return Err(NumpyError::array("posed_joints", reason).into());
    }
    let (rows, matrices) = archive.rows("global_rot_mats", &[joints, 3, 3])?;
    if rows != frames || places.len() != 3 * joints * frames || places.iter().any(|n| !n.is_finite()) {
        let reason =
            format!("shape {shape:?} or a number that is not finite; global_rot_mats has {rows} frames");
        return Err(NumpyError::array("posed_joints", reason).into());
    }
    let (names, parents) = tree(words);
    let turns = rotations(&matrices, joints)?;
    let place = |at: usize| {
        let at = &places[3 * at..3 * at + 3];
        DVec3::new(at[0].into(), at[1].into(), at[2].into())
    };
    let mut offsets = vec![DVec3::ZERO; joints];
    let mut locals = Vec::with_capacity(frames * joints);
    for frame in 0..frames {
        let first = frame * joints;
        for (joint, parent) in parents.iter().enumerate() {
            let turn = turns[first + joint];
            locals.push(match parent {
                None => turn,
                Some(parent) => {
                    let above = turns[first + parent].conjugate();
                    offsets[joint] += above * (place(first + joint) - place(first + parent)) / frames as f64;
                    above * turn
                }
            });
        }
    }
    let fps = match smpl::stated_rate(archive, options)? {
        Some(fps) => fps,
        None => {
            let why = "Kimodo has 30, and ARDY 25; the file says none, and --fps decides";
            Finding::new(USUAL_FPS, Basis::Assumed, why)
        }
    };
    let source = Arrays {
        names,
        parents,
        offsets,
        roots: (0..frames).map(|frame| place(frame * joints)).collect(),
        rotations: locals,
        fps: fps.value,
    };
    let evidence = "it has the arrays posed_joints and global_rot_mats";
    Ok(Parsed {
        source: Box::new(source),
        format: Finding::new(Format::Kimodo, Basis::Found, evidence),
        producer: Some(Finding::new("Kimodo".to_owned(), Basis::Found, evidence)),
        skeleton: Some(Finding::new(
            skeleton.to_owned(),
            Basis::Found,
            format!("posed_joints has {joints} joints"),
        )),
        stated: Stated {
            up: Some(Up::Y),
            unit_m: Some(1.0),
            units: &UNITS,
            may_be_y_up: false,
            by: "Kimodo is Y up and in metres",
        },
        fps,
        repairs: Vec::new(),
        oddities: Vec::new(),
    })
}

/// Names and parents of the skeleton with a number of joints.
#[cfg(test)]
pub(super) fn tree_of(joints: usize) -> Option<(Vec<String>, Vec<Option<usize>>)> {
    let skeleton = SKELETONS.iter().find(|skeleton| skeleton.0 == joints)?;
    Some(tree(skeleton.2))
}

/// Names and parents of a skeleton's joints.
fn tree(words: &str) -> (Vec<String>, Vec<Option<usize>>) {
    let mut names: Vec<String> = Vec::new();
    let mut parents = Vec::new();
    for word in words.split_whitespace() {
        let (parent, name) = match word.split_once('>') {
            Some((parent, name)) => (names.iter().position(|of| of == parent), name),
            None => (names.len().checked_sub(1), word),
        };
        names.push(name.to_owned());
        parents.push(parent);
    }
    (names, parents)
}

/// Rotations of row-major matrices.
fn rotations(matrices: &[f32], joints: usize) -> Result<Vec<DQuat>, ReadErrorKind> {
    let turn = |(at, m): (usize, &[f32])| {
        let rows: [f64; 9] = std::array::from_fn(|nth| f64::from(m[nth]));
        let matrix = DMat3::from_cols_array(&rows).transpose();
        let off = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
        let is_turn = off.iter().all(|n| n.abs() <= MATRIX_TOLERANCE) && matrix.determinant() > 0.0;
        match is_turn {
            true => Ok(DQuat::from_mat3(&matrix).normalize()),
            false => {
                let (frame, joint) = (at / joints, at % joints);
                let reason = format!("frame {frame}, joint {joint}: not a rotation matrix");
                Err(NumpyError::array("global_rot_mats", reason).into())
            }
        }
    };
    matrices.chunks_exact(9).enumerate().map(turn).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_skeleton_is_a_tree_of_its_number_of_joints() {
        for (joints, name, words) in SKELETONS {
            let (names, parents) = tree(words);
            assert_eq!((names.len(), parents.len()), (joints, joints), "{name}");
            assert_eq!(parents[0], None);
            let is_tree =
                |(joint, parent): (usize, &Option<usize>)| parent.is_some_and(|parent| parent < joint);
            assert!(parents.iter().enumerate().skip(1).all(is_tree), "{name}");
        }
        let (names, parents) = tree(SOMA_77);
        let parent = |name: &str| {
            let joint = names.iter().position(|of| of == name).unwrap();
            &*names[parents[joint].unwrap()]
        };
        assert_eq!(
            [
                parent("Jaw"),
                parent("RightShoulder"),
                parent("RightHandPinky1"),
                parent("RightLeg")
            ],
            ["Head", "Chest", "RightHand", "Hips"]
        );
    }
}
