//! Keyframes on a user's skeleton, for the pack.

use troupe_character::keyframe::Checked;
use troupe_character::{FieldError, Path};
use troupe_live::skeleton::Worn;
use troupe_live::wire::keyframe::{Role, check};
use troupe_motion::rotation::to_wxyz;
use troupe_motion::{GlobalRoot, Quat, Vec3};
use troupe_proto::v1;

use super::pins::Given;

/// Consecutive keyframes as they were given, and as they go to the pack.
#[derive(Debug, Default)]
pub(super) struct Keys {
    pub(super) given: Vec<Given>,
    /// Root and rotations on the pack's skeleton, of keyframes with a pose.
    pub(super) carried: Vec<Option<(Vec3, Vec<Quat>)>>,
}

/// Checks consecutive keyframes in the field `name` of `path`, and replaces them by the pack's.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(super) fn keys(
    path: &Path<'_>,
    name: &'static str,
    keys: &mut [v1::Keyframe],
    role: Role,
    worn: &Worn,
) -> Result<Keys, FieldError> {
    let mut checked = Vec::with_capacity(keys.len());
    for (index, key) in keys.iter().enumerate() {
        checked.push(check(&path.element(name, index), key, role, worn.skeleton())?);
    }
    Ok(carry(keys, &checked, worn))
}

/// As [`keys`], for a keyframe by itself.
pub(super) fn key(path: &Path<'_>, key: &mut v1::Keyframe, worn: &Worn) -> Result<Keys, FieldError> {
    let checked = [check(path, key, Role::Target, worn.skeleton())?];
    Ok(carry(std::slice::from_mut(key), &checked, worn))
}

fn carry(keys: &mut [v1::Keyframe], checked: &[Checked], worn: &Worn) -> Keys {
    let place = |key: &Checked| {
        let height = key.height.unwrap_or_default();
        key.root.map_or(Vec3::Y * height, |root| root.position)
    };
    let posed = checked.iter().filter_map(|key| {
        let pose = key.pose.as_ref()?;
        Some((place(key), &pose.rotations[..]))
    });
    let mut carried = worn.back(&posed.collect::<Vec<_>>()).into_iter();
    let mut made = Keys::default();
    for (key, checked) in keys.iter_mut().zip(checked) {
        let pose = checked.pose.as_ref().and_then(|_| carried.next());
        *key = for_pack(checked, pose.as_ref(), worn);
        made.given.push(Given {
            root: match checked.root {
                Some(root) => root.position.to_array().map(Some),
                None => [None, checked.pose.as_ref().map(|pose| pose.height), None],
            },
            rotations: checked.pose.as_ref().map(|pose| pose.rotations.clone()),
        });
        made.carried.push(pose);
    }
    made
}

/// A keyframe on the pack's skeleton.
fn for_pack(key: &Checked, pose: Option<&(Vec3, Vec<Quat>)>, worn: &Worn) -> v1::Keyframe {
    let root = match (key.root, pose) {
        (Some(_), Some((place, _))) => Some(root_of(*place, None)),
        (Some(root), None) => {
            let GlobalRoot { position, heading } = worn.root_in(root);
            Some(root_of(position, Some(heading)))
        }
        (None, _) => None,
    };
    let velocity = key.velocity.map(|velocity| v1::RootVelocity {
        x: velocity.vx / worn.scale(),
        z: velocity.vz / worn.scale(),
        angular: velocity.omega,
        height: (root.is_none() && pose.is_none()).then(|| worn.height_in(velocity.height)),
    });
    v1::Keyframe {
        velocity,
        pose: pose.map(|(place, rotations)| v1::Pose {
            rotations: rotations.iter().copied().flat_map(to_wxyz).collect(),
            root_height: root.is_none().then_some(place.y),
        }),
        root,
        qpos: Vec::new(),
    }
}

fn root_of(position: Vec3, heading: Option<f32>) -> v1::Root {
    let Vec3 { x, y, z } = position;
    v1::Root {
        position: Some(v1::Vec3 { x, y, z }),
        heading,
    }
}
