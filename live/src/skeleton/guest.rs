//! A skeleton that comes with a request, and goes with it.

use std::sync::Arc;

use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_character::FieldError;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::Figure;
use troupe_motion::{Joint, Quat, Skeleton, Vec3};

use super::doc::{BodyDoc, JointsDoc, MAX_JOINTS, SkeletonDoc};
use super::error::SkeletonError;
use super::store::Own;
use super::worn::{Worn, figure_of};
use crate::packs::{LoadedPack, PackTable};

/// What errors call it.
const NAME: &str = "of the request";
/// A rest pose stands on the ground at height 0 if its root is this near to where its toes say that
/// it is, by the length of its legs.
const STANDS_SHARE: f32 = 0.15;

/// A skeleton of a request on the body with index `place` of a pack. `rest` is its rest pose: joint
/// 0 in the world, others relative to their parents, and `height_m` the height of joint 0 in it.
/// This takes milliseconds.
///
/// # Errors
/// [`SkeletonError::Field`] if no body is found, and [`SkeletonError::Unfit`] if motion of the pack
/// cannot be carried over, or is below the bar. `field` is the request's.
pub fn guest(
    field: &str,
    joints: Vec<Joint>,
    (rest, height_m): (&[Quat], f32),
    of: (&LoadedPack, usize),
    table: &PackTable,
) -> Result<Arc<Worn>, SkeletonError> {
    let wrong = |why: String| {
        // An error that says what is allowed says it best.
        let (message, allowed) = why
            .split_once("; allowed: ")
            .unwrap_or((&why, "a body on two legs or four"));
        FieldError {
            field: field.to_owned(),
            message: cut(message, MAX_MESSAGE),
            allowed: allowed.to_owned(),
        }
    };
    if joints.len() > MAX_JOINTS {
        return Err(wrong(format!("has {} joints; allowed: 1 to {MAX_JOINTS}", joints.len())).into());
    }
    let figure = figure(joints, rest, height_m).map_err(wrong)?;
    let doc = SkeletonDoc {
        name: NAME.to_owned(),
        forced: false,
        notes: Vec::new(),
        body: BodyDoc::Joints(JointsDoc::of(&figure)),
    };
    Own::new(doc).map_err(wrong)?.fit(of, table, field)
}

/// Whether motion of a body of a pack can be carried over to other bodies.
pub fn can_wear((loaded, place): (&LoadedPack, usize), table: &PackTable) -> bool {
    figure_of(loaded, place, table).is_ok()
}

fn figure(joints: Vec<Joint>, rest: &[Quat], height_m: f32) -> Result<Figure, String> {
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, None).map_err(|error| error.to_string())?;
    let skeleton = Arc::new(skeleton);
    let find = |root_y_m| {
        let found = Figure::new(skeleton.clone(), rest, root_y_m, &PartsDoc::default());
        found.map_err(|error| error.to_string())
    };
    let found = find(None)?;
    let stands = (height_m - found.root().y).abs() <= STANDS_SHARE * found.leg_m();
    match stands {
        true => find(Some(height_m)),
        false => Ok(found),
    }
}
