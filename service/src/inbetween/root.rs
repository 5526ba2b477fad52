//! Roots that a request gives to replace the predicted ones.

use troupe_character::keyframe::Checked;
use troupe_character::limits::HEADING_TOLERANCE;
use troupe_character::{FieldError, Path};
use troupe_motion::model::{Rig, RootKey, RootOverride};
use troupe_motion::root::wrap_angle;
use troupe_motion::{SegmentFrame, Skeleton, Vec3};
use troupe_proto::v1;

use troupe_live::wire::keyframe::{check_height, facing, finite};
use troupe_live::wire::{HEIGHT_TOLERANCE_M, MAX_DISTANCE_M};

/// Largest distance of a given root from the keyframe's root, metres over the ground.
const PLACE_TOLERANCE_M: f32 = HEIGHT_TOLERANCE_M;

/// The given roots of a request.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GivenRoot {
    /// In the segment frame. Includes the roots of targets.
    pub over: RootOverride,
    /// Frame of each entry of the request.
    pub frames: Vec<usize>,
}

/// Keyframes around the gap. Given roots must agree with them.
pub(super) struct Around<'a> {
    /// The first frames of the segment.
    pub(super) context: &'a [Checked],
    /// The last frames of the segment.
    pub(super) targets: &'a [Checked],
    /// Frames of the segment. None: the model chooses.
    pub(super) frames: Option<usize>,
}

/// Checks the field `root` of a character whose segment lies at `segment`. None: the request gives
/// no roots.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(super) fn check_root(
    path: &Path<'_>,
    asked: &[v1::RootKey],
    around: &Around<'_>,
    segment: &SegmentFrame,
    rig: &Rig,
) -> Result<Option<GivenRoot>, FieldError> {
    if asked.is_empty() {
        return Ok(None);
    }
    let Some(frames) = around.frames else {
        let (low, high) = (rig.dims.min_frames(), rig.dims.max_frames());
        return Err(path.field("frame_count").error(
            "is missing, and the frames of root count in it",
            format!("{low} to {high}"),
        ));
    };
    let first_target = frames - around.targets.len();
    let mut keys: Vec<RootKey> = Vec::with_capacity(asked.len() + around.targets.len());
    let mut earliest = 0;
    for (index, root) in asked.iter().enumerate() {
        let path = path.element("root", index);
        let frame = check_frame(&path, root.frame, earliest, frames)?;
        earliest = frame + 1;
        let given = check_values(&path, frame, root, &rig.skeleton)?;
        check_reach(&path, &given, segment)?;
        let met = match frame.checked_sub(first_target) {
            None => around.context.get(frame).map(|key| ("context", frame, key)),
            Some(target) => around.targets.get(target).map(|key| ("targets", target, key)),
        };
        if let Some((list, nth, key)) = met {
            check_same(&path, &given, key, &format!("{list}[{nth}]"), &rig.skeleton)?;
        }
        keys.push(in_segment(&given, segment));
    }
    let entries = keys.iter().map(|key| key.frame).collect();
    for (target, key) in around.targets.iter().enumerate() {
        let Some(root) = key.root else { continue };
        let whole = RootKey::whole(first_target + target, segment.to_segment_root(root));
        match keys.binary_search_by_key(&whole.frame, |key| key.frame) {
            Ok(at) => keys[at] = whole,
            Err(at) => keys.insert(at, whole),
        }
    }
    Ok(Some(GivenRoot {
        over: RootOverride::new(keys, around.context.len() - 1),
        frames: entries,
    }))
}

/// Checks a frame of the segment, which must be at least `earliest`.
fn check_frame(path: &Path<'_>, frame: u32, earliest: usize, frames: usize) -> Result<usize, FieldError> {
    let path = path.field("frame");
    let last = frames - 1;
    let found = frame as usize;
    if found > last {
        return Err(path.error(format!("is {frame}"), format!("{} to {last}", earliest.min(last))));
    }
    if found < earliest {
        return Err(path.error(
            format!("is {frame}, and the entry before has {}", earliest - 1),
            "frames that rise from entry to entry",
        ));
    }
    Ok(found)
}

/// Checks the values of an entry, in world coordinates.
fn check_values(
    path: &Path<'_>,
    frame: usize,
    root: &v1::RootKey,
    skeleton: &Skeleton,
) -> Result<RootKey, FieldError> {
    let ground = match (root.x, root.z) {
        (Some(x), Some(z)) => Some([finite(&path.field("x"), x)?, finite(&path.field("z"), z)?]),
        (None, None) => None,
        (x, _) => {
            let (missing, given) = if x.is_none() { ("x", "z") } else { ("z", "x") };
            let message = format!("is missing, and {given} is given");
            return Err(path.field(missing).error(message, "both x and z, or neither"));
        }
    };
    if ground.is_none() && root.height.is_none() && root.heading.is_none() {
        return Err(path.error("is empty", "at least one of x and z, height and heading"));
    }
    if let Some(height) = root.height {
        check_height(&path.field("height"), height, skeleton.ground_y_m)?;
    }
    if let Some(heading) = root.heading {
        finite(&path.field("heading"), heading)?;
    }
    Ok(RootKey {
        frame,
        ground,
        height: root.height,
        heading: root.heading,
    })
}

fn check_reach(path: &Path<'_>, given: &RootKey, segment: &SegmentFrame) -> Result<(), FieldError> {
    let Some([x, z]) = given.ground else {
        return Ok(());
    };
    let distance = (x - segment.origin.x).hypot(z - segment.origin.z);
    match distance <= MAX_DISTANCE_M {
        true => Ok(()),
        false => Err(path.error(
            format!("is {} m from the last context frame", path.metres(distance)),
            format!(
                "at most {} m from the last context frame",
                path.metres(MAX_DISTANCE_M)
            ),
        )),
    }
}

/// Checks that a root agrees with the keyframe `name` of the same frame.
fn check_same(
    path: &Path<'_>,
    root: &RootKey,
    key: &Checked,
    name: &str,
    skeleton: &Skeleton,
) -> Result<(), FieldError> {
    if let (Some([x, z]), Some(at)) = (root.ground, key.root.map(|root| root.position)) {
        let off = (x - at.x).hypot(z - at.z);
        if off > PLACE_TOLERANCE_M {
            let [off, within, x, z] = [off, PLACE_TOLERANCE_M, at.x, at.z].map(|value| path.metres(value));
            return Err(path.error(
                format!("is {off} m over the ground from the root of {name}, which has the same frame"),
                format!("x and z within {within} m of {x} and {z}"),
            ));
        }
    }
    if let (Some(given), Some(height)) = (root.height, key.height)
        && (given - height).abs() > HEIGHT_TOLERANCE_M
    {
        let (given, height) = (path.height(given), path.height(height));
        return Err(path.field("height").error(
            format!("is {given} m, but {name} has the same frame and its root at {height} m"),
            format!(
                "within {} m of {height}, or left out",
                path.metres(HEIGHT_TOLERANCE_M)
            ),
        ));
    }
    let faces = key.root.map(|root| root.heading).or_else(|| {
        let pelvis = key.pose.as_ref()?.rotations.first()?;
        facing(*pelvis, skeleton)
    });
    if let (Some(given), Some(heading)) = (root.heading, faces)
        && wrap_angle(given - heading).abs() > HEADING_TOLERANCE
    {
        return Err(path.field("heading").error(
            format!("is {given}, but {name} has the same frame and faces {heading}"),
            format!("within {HEADING_TOLERANCE} rad of {heading}, or left out"),
        ));
    }
    Ok(())
}

fn in_segment(root: &RootKey, segment: &SegmentFrame) -> RootKey {
    let place = |[x, z]: [f32; 2]| {
        let place = segment.to_segment_position(Vec3::new(x, 0.0, z));
        [place.x, place.z]
    };
    RootKey {
        ground: root.ground.map(place),
        heading: root.heading.map(|heading| wrap_angle(heading - segment.heading)),
        ..*root
    }
}

#[cfg(test)]
#[path = "root_tests.rs"]
mod tests;
