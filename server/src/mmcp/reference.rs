//! Reference motions: decodes them and converts them to the model's frames.
//!
//! A model describes a reference motion in words, and acts out the words.

use std::collections::{HashMap, HashSet};

use troupe_character::keyframe::{Checked, KeyWriter};
use troupe_character::take::MotionFrames;
use troupe_motion::clip::Clip;
use troupe_motion::model::{DescribeTask, Task};
use troupe_motion::{Quat, SegmentFrame};

use super::constraints::world;
use super::fault::{Code, Fault};
use super::limits::FPS;
use super::model::Model;
use super::schema::MotionReference;
use super::skeleton::{self, Joints};
use troupe_base::echo::cut;
use troupe_live::session::Space;
use troupe_service::inbetween::check_description;

/// Checks the reference motion of the segment at `place` in the request.
///
/// # Errors
/// [`Fault`] for the first value that is not accepted.
pub fn check(
    place: &str,
    given: &MotionReference,
    (model, joints, space): (&Model, &Joints, &Space),
) -> Result<MotionFrames, Fault> {
    check_form(place, given, model)?;
    let own = given.skeleton.as_ref().map(|own| {
        skeleton::check(own, model, space).map_err(|mut fault| {
            fault.place.field = format!("{place}.{}", fault.place.field);
            fault
        })
    });
    let own = own.transpose()?;
    let joints = own.as_ref().unwrap_or(joints);
    let order = order(place, given, joints)?;
    let clip = clip(place, given, &order, (model, joints))?;
    let frames = keyframes(&clip, model);
    let task = Task::Describe(DescribeTask {
        frames: frames.to_vec(),
        ..DescribeTask::default()
    });
    check_description(&model.loaded.pack, &task).map_err(|error| {
        let found = format!("{}, at {} frames a second", error.message, model.rig().fps);
        Fault::option(format!("{place}.rotations"), found, error.allowed)
    })?;
    Ok(frames)
}

/// Checks that the lists have one entry per frame or joint, and are not too long.
fn check_form(place: &str, given: &MotionReference, model: &Model) -> Result<(), Fault> {
    let field = |name: &str| format!("{place}.{name}");
    let (frames, most) = (given.rotations.len(), model.max_reference_frames());
    let entries = |name: &str, found: usize, wanted: usize, of: &str| match found == wanted {
        true => Ok(()),
        false => {
            let allowed = format!("exactly {wanted}, one {of}");
            Err(Fault::schema(
                field(name),
                format!("has {found} entries"),
                allowed,
            ))
        }
    };
    if frames < 2 {
        let allowed = format!("2 to {most}");
        return Err(Fault::schema(
            field("rotations"),
            format!("has {frames} entries"),
            allowed,
        ));
    }
    entries("root_positions", given.root_positions.len(), frames, "per frame")?;
    for (index, pose) in given.rotations.iter().enumerate() {
        let name = format!("rotations[{index}]");
        entries(&name, pose.len(), given.joint_names.len(), "per joint")?;
    }
    if !(FPS[0]..=FPS[1]).contains(&given.fps) {
        let allowed = format!("{} to {}", FPS[0], FPS[1]);
        return Err(Fault::schema(field("fps"), format!("is {}", given.fps), allowed));
    }
    match frames > most {
        true => Err(Fault::option(
            field("rotations"),
            format!("has {frames} entries"),
            format!("at most {most}"),
        )
        .with("max_reference_frames", most)
        .with("reference_frames", frames)),
        false => Ok(()),
    }
}

/// The skeleton's index of each joint in the reference motion. The root must be among them.
fn order(place: &str, given: &MotionReference, joints: &Joints) -> Result<Vec<usize>, Fault> {
    let own = &joints.skeleton.joints;
    let places: HashMap<&str, usize> = own
        .iter()
        .enumerate()
        .map(|(index, joint)| (joint.name.as_str(), index))
        .collect();
    let mut seen = HashSet::new();
    let each = given.joint_names.iter().enumerate().map(|(index, name)| {
        let field = format!("{place}.joint_names[{index}]");
        let found = format!("is {:?}", cut(name, 64));
        let Some(&joint) = places.get(name.as_str()) else {
            let mut names: Vec<&str> = places.keys().copied().collect();
            names.sort_unstable();
            let fault = Fault::new(Code::UnknownJoint, field, found, "a joint of the skeleton");
            return Err(fault.with("skeleton_joints", names));
        };
        match seen.insert(joint) {
            true => Ok(joint),
            false => Err(Fault::schema(field, found, "each joint once")),
        }
    });
    let joints: Vec<usize> = each.collect::<Result<_, _>>()?;
    match joints.contains(&0) {
        true => Ok(joints),
        false => {
            let root = own[0].name.as_str();
            let field = format!("{place}.joint_names");
            let fault = Fault::new(Code::InvalidRequest, field, "lacks the root joint", root);
            Err(fault.with("root_joint", root))
        }
    }
}

/// The reference motion on the model's skeleton, at the model's frame rate. Joints that it leaves
/// out are at rest.
fn clip(
    place: &str,
    given: &MotionReference,
    order: &[usize],
    (model, joints): (&Model, &Joints),
) -> Result<Clip, Fault> {
    let Joints { still, axes, .. } = joints;
    let mut rotations: Vec<Quat> = Vec::with_capacity(given.rotations.len() * still.len());
    let mut roots = Vec::with_capacity(given.root_positions.len());
    for (frame, (pose, &root)) in given.rotations.iter().zip(&given.root_positions).enumerate() {
        let first = rotations.len();
        rotations.extend_from_slice(still);
        for (nth, (&joint, &xyzw)) in order.iter().zip(pose).enumerate() {
            let turned = skeleton::rotation(&format!("{place}.rotations[{frame}][{nth}]"), xyzw)?;
            rotations[first + joint] = axes.to_model(joint, turned);
        }
        roots.push(world(&format!("{place}.root_positions[{frame}]"), root)?);
    }
    if let Some(worn) = &joints.worn {
        let frames = roots.iter().copied().zip(rotations.chunks_exact(still.len()));
        let back = worn.back(&frames.collect::<Vec<_>>());
        let poses: Vec<Vec<Quat>>;
        (roots, poses) = back.into_iter().unzip();
        rotations = poses.concat();
    }
    let rig = model.rig();
    let clip = Clip::new(rig.skeleton.clone(), given.fps as f32, roots, rotations);
    clip.and_then(|clip| clip.resample(rig.fps))
        .map_err(|error| Fault::option(place, error.to_string(), "a motion of the model's joints"))
}

/// The frames as input of the model, relative to the first frame.
fn keyframes(clip: &Clip, model: &Model) -> MotionFrames {
    let rig = model.rig();
    let key = |frame: usize| {
        let rotations = clip.rotations_at(frame).to_vec();
        Checked::of(Some(clip.root_at(frame)), None, None, Some(rotations))
    };
    let keys: Vec<Checked> = (0..clip.frames()).map(key).collect();
    let segment = SegmentFrame::from_root(clip.root_at(0));
    KeyWriter::new(&rig.skeleton, rig.fps)
        .write(&segment, &keys)
        .into()
}
