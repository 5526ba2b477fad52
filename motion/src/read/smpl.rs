//! AMASS: motion of the SMPL family of body models, as NumPy archives.
//!
//! The joints are those of the models' published tree. The models themselves are not needed, and
//! their shapes are not used: bones are those of the mean body, to a tenth of a millimetre.

use glam::{DQuat, DVec3};

use super::adapted::Arrays;
use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::report::{Basis, Finding, Format, Note, Topic, Up};
use super::stance::Stated;
use super::units::UNITS;
use crate::clip::{MAX_FRAMES, MAX_ROTATIONS};
use crate::files::NumpyError;
use crate::files::npz::Unpacked;

/// Name, parent and place in it (metres; X left, Y up, Z forward) of the joints that all models
/// share.
const JOINTS: [(&str, Option<usize>, [f64; 3]); 22] = [
    ("pelvis", None, [-0.0018, -0.2233, 0.0282]),
    ("left_hip", Some(0), [0.0695, -0.0914, -0.0068]),
    ("right_hip", Some(0), [-0.0677, -0.0905, -0.0043]),
    ("spine1", Some(0), [-0.0025, 0.109, -0.0267]),
    ("left_knee", Some(1), [0.0343, -0.3752, -0.0045]),
    ("right_knee", Some(2), [-0.0383, -0.3826, -0.0089]),
    ("spine2", Some(3), [0.0055, 0.1352, 0.0011]),
    ("left_ankle", Some(4), [-0.0136, -0.398, -0.0437]),
    ("right_ankle", Some(5), [0.0158, -0.3984, -0.0423]),
    ("spine3", Some(6), [0.0015, 0.0529, 0.0254]),
    ("left_foot", Some(7), [0.0264, -0.0558, 0.1193]),
    ("right_foot", Some(8), [-0.0254, -0.0481, 0.1233]),
    ("neck", Some(9), [-0.0028, 0.2139, -0.0429]),
    ("left_collar", Some(9), [0.0788, 0.1217, -0.0341]),
    ("right_collar", Some(9), [-0.0818, 0.1188, -0.0386]),
    ("head", Some(12), [0.0052, 0.065, 0.0513]),
    ("left_shoulder", Some(13), [0.091, 0.0305, -0.0089]),
    ("right_shoulder", Some(14), [-0.096, 0.0326, -0.0091]),
    ("left_elbow", Some(16), [0.2596, -0.0128, -0.0275]),
    ("right_elbow", Some(17), [-0.2537, -0.0133, -0.0214]),
    ("left_wrist", Some(18), [0.2492, 0.009, -0.0012]),
    ("right_wrist", Some(19), [-0.2553, 0.0078, -0.0056]),
];
/// Place of SMPL-X's pelvis beside the origin, metres. The other models have it as in [`JOINTS`].
const PELVIS_OF_SMPL_X: [f64; 3] = [0.0031, -0.3514, 0.0120];
/// Name of the model that has another origin.
const SMPL_X: &str = "SMPL-X";
/// Fields that hold the rate.
const RATES: [&str; 4] = ["mocap_framerate", "mocap_frame_rate", "fps", "framerate"];
/// Rate of most of AMASS, Hz, for files without one.
const USUAL_FPS: f32 = 120.0;

/// Whether an archive has a body model's poses.
pub(super) fn is_amass(archive: &Unpacked<'_>) -> bool {
    archive.has("trans") && (archive.has("poses") || (archive.has("root_orient") && archive.has("pose_body")))
}

pub(super) fn parse(archive: &mut Unpacked<'_>, options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    let (frames, trans) = archive.rows("trans", &[3])?;
    if frames > MAX_FRAMES.min(MAX_ROTATIONS / JOINTS.len()) {
        return Err(NumpyError::array("trans", format_args!("{frames} frames are too many")).into());
    }
    let (model, given, turns) = poses(archive, frames)?;
    let fps = rate(archive, options)?;
    let has_shape = archive.has("betas")
        && (archive.floats("betas")).is_ok_and(|(_, betas)| betas.iter().any(|beta| *beta != 0.0));
    let offset = DVec3::from(match model {
        SMPL_X => PELVIS_OF_SMPL_X,
        _ => JOINTS[0].2,
    });
    // The models turn about the pelvis, which stands beside the origin that `trans` moves.
    let roots = trans
        .chunks_exact(3)
        .map(|at| DVec3::new(at[0].into(), at[1].into(), at[2].into()) + offset);
    let source = Arrays {
        names: JOINTS.iter().map(|joint| joint.0.to_owned()).collect(),
        parents: JOINTS.iter().map(|joint| joint.1).collect(),
        offsets: JOINTS.iter().map(|joint| DVec3::from(joint.2)).collect(),
        roots: roots.collect(),
        rotations: turns,
        fps: fps.value,
    };
    let evidence = format!("{given} joints; bones of the mean body, since its shape (betas) needs the model");
    let mut repairs = Vec::new();
    if given > JOINTS.len() {
        repairs.push(Note {
            topic: Topic::Fingers,
            text: format!(
                "{} joints of hands and face are left out: the mean body's bones here end at the wrists and the head",
                given - JOINTS.len()
            ),
        });
    }
    if has_shape {
        repairs.push(Note {
            topic: Topic::Body,
            text: "its shape (betas) is not applied: bones are the mean body's".to_owned(),
        });
    }
    Ok(Parsed {
        source: Box::new(source),
        format: Finding::new(
            Format::Amass,
            Basis::Found,
            "it has the arrays trans and poses of a body model",
        ),
        producer: Some(Finding::new(
            "AMASS".to_owned(),
            Basis::Found,
            "the names of its arrays",
        )),
        skeleton: Some(Finding::new(model.to_owned(), Basis::Found, evidence)),
        stated: Stated {
            up: Some(Up::Z),
            unit_m: Some(1.0),
            units: &UNITS,
            may_be_y_up: true,
            by: "AMASS is Z up and in metres",
        },
        fps,
        repairs,
        oddities: Vec::new(),
    })
}

/// Name of the model, its number of joints, and the rotations of those that are kept.
fn poses(
    archive: &mut Unpacked<'_>,
    frames: usize,
) -> Result<(&'static str, usize, Vec<DQuat>), ReadErrorKind> {
    let kept = 3 * JOINTS.len();
    let (name, width, numbers) = if archive.has("poses") {
        let (shape, numbers) = archive.floats("poses")?;
        let width = match shape[..] {
            [rows, ref rest @ ..] if rows as usize == frames => {
                let width = rest.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
                width.unwrap_or(u64::MAX) as usize
            }
            _ => {
                let reason = format!("shape {shape:?}; it must be {frames} frames, as trans has");
                return Err(NumpyError::array("poses", reason).into());
            }
        };
        ("poses", width, numbers)
    } else {
        let (rows, root) = archive.rows("root_orient", &[3])?;
        let (bodies, body) = archive.rows("pose_body", &[kept - 3])?;
        if rows != frames || bodies != frames {
            let reason = format!("{bodies} frames; it must be {frames}, as trans has");
            return Err(NumpyError::array("pose_body", reason).into());
        }
        let rows = root.chunks_exact(3).zip(body.chunks_exact(kept - 3));
        (
            "pose_body",
            kept,
            rows.flat_map(|(root, body)| [root, body].concat()).collect(),
        )
    };
    let hands = archive.has("pose_hand");
    let (model, given) = match width {
        66 if hands => (SMPL_X, 55),
        66 => ("SMPL, without hands", 22),
        72 => ("SMPL", 24),
        156 => ("SMPL-H", 52),
        165 => (SMPL_X, 55),
        _ => {
            let reason = format!("{width} numbers a frame; SMPL has 66 or 72, SMPL-H 156, SMPL-X 165");
            return Err(NumpyError::array(name, reason).into());
        }
    };
    let mut turns = Vec::with_capacity(frames * JOINTS.len());
    for (row, numbers) in numbers.chunks_exact(width).enumerate() {
        for axis in numbers[..kept].chunks_exact(3) {
            let axis = DVec3::new(axis[0].into(), axis[1].into(), axis[2].into());
            if !axis.is_finite() {
                return Err(NumpyError::array(name, format_args!("row {row} is not finite")).into());
            }
            turns.push(DQuat::from_scaled_axis(axis));
        }
    }
    Ok((model, given, turns))
}

fn rate(archive: &mut Unpacked<'_>, options: &Options) -> Result<Finding<f32>, ReadErrorKind> {
    Ok(stated_rate(archive, options)?.unwrap_or_else(|| {
        let why = "it has no mocap_framerate; --fps decides";
        Finding::new(USUAL_FPS, Basis::Assumed, why)
    }))
}

/// The rate that an option gives, or an array.
pub(super) fn stated_rate(
    archive: &mut Unpacked<'_>,
    options: &Options,
) -> Result<Option<Finding<f32>>, ReadErrorKind> {
    if let Some(fps) = options.fps {
        return Ok(Some(Finding::new(fps, Basis::Given, "--fps")));
    }
    let Some(name) = RATES.into_iter().find(|name| archive.has(name)) else {
        return Ok(None);
    };
    let (_, numbers) = archive.floats(name)?;
    match numbers[..] {
        [fps] if (1.0..=1000.0).contains(&fps) => Ok(Some(Finding::new(fps, Basis::Stated, name))),
        _ => Err(ReadErrorKind::Range {
            field: name.to_owned(),
            found: format!("{numbers:?}"),
            allowed: "one number from 1 to 1000".to_owned(),
            option: Some(Advice::decides(Choice::any(OptionName::Fps))),
        }),
    }
}
