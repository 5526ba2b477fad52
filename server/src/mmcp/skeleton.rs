//! The skeleton of a request: the model's own, or a body that motion is carried over to.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use troupe_character::FieldError;
use troupe_live::session::Space;
use troupe_live::skeleton::{Guest, SkeletonError, Worn};
use troupe_motion::gltf::GltfJoint;
use troupe_motion::{Quat, Vec3};

use super::fault::{Code, Fault};
use super::limits::{MAX_PLACE_M, REST_TOLERANCE_M};
use super::model::Model;
use super::schema::{Joint, Skeleton, coordinates, units};

/// Most characters of a joint's name.
const MAX_NAME_CHARS: usize = 128;
/// Most characters of the name to show to people.
const MAX_DISPLAY_CHARS: usize = 256;
/// Shortest and longest quaternion that counts as a rotation.
const QUAT_LENGTHS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// The axes of joints on the wire. They equal the world's axes when the model is at rest. The
/// model's own axes are rotated against them.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// World rotation of each joint at rest, in the model's axes.
    rest: Vec<Quat>,
    parents: Vec<Option<usize>>,
}

impl Axes {
    /// The axes of a skeleton with this rest pose. The rotation of joint 0 is in the world, all
    /// others are relative to their parents.
    pub fn new(skeleton: &troupe_motion::Skeleton, pose: &[Quat]) -> Self {
        let mut rest: Vec<Quat> = Vec::with_capacity(pose.len());
        for (joint, &rotation) in skeleton.joints.iter().zip(pose) {
            rest.push(match joint.parent {
                Some(parent) => (rest[parent] * rotation).normalize(),
                None => rotation,
            });
        }
        Self {
            rest,
            parents: skeleton.joints.iter().map(|joint| joint.parent).collect(),
        }
    }

    fn above(&self, joint: usize) -> Quat {
        self.parents[joint].map_or(Quat::IDENTITY, |parent| self.rest[parent])
    }

    /// Converts an offset in the frame of `parent` to the wire's axes.
    pub fn offset(&self, parent: usize, offset: Vec3) -> Vec3 {
        self.rest[parent] * offset
    }

    /// Converts a rotation relative to the parent to the wire's axes.
    pub fn to_wire(&self, joint: usize, rotation: Quat) -> Quat {
        self.above(joint) * rotation * self.rest[joint].conjugate()
    }

    /// Converts a rotation relative to the parent to the model's axes.
    pub fn to_model(&self, joint: usize, rotation: Quat) -> Quat {
        (self.above(joint).conjugate() * rotation * self.rest[joint]).normalize()
    }

    /// Converts a world rotation of a joint to the model's axes.
    pub fn world_to_model(&self, joint: usize, rotation: Quat) -> Quat {
        (rotation * self.rest[joint]).normalize()
    }
}

/// The joints of a request: those of the model in any order, or a body of the caller's own.
#[derive(Debug, Clone)]
pub struct Joints {
    /// The skeleton of the motion: the model's, or the caller's own.
    pub skeleton: Arc<troupe_motion::Skeleton>,
    /// Its rest pose, relative to the parents.
    pub still: Vec<Quat>,
    /// Its contact joints, by the bits of a motion's contacts.
    pub contacts: Vec<(usize, String)>,
    /// The axes of its joints on the wire.
    pub axes: Axes,
    /// Its index of each joint of the request.
    pub order: Vec<usize>,
    /// The joints at rest, as the request gives them.
    pub rest: Vec<GltfJoint>,
    /// The way from the model's skeleton to the caller's own. None for the model's.
    pub worn: Option<Arc<Worn>>,
}

impl Joints {
    /// Length of the caller's legs by that of the model's.
    pub fn scale(&self) -> f32 {
        self.worn.as_ref().map_or(1.0, |worn| worn.scale())
    }

    /// The caller's joints for those of the model, by name.
    pub fn pairs(&self) -> BTreeMap<String, String> {
        let mut pairs = BTreeMap::new();
        if let Some(worn) = &self.worn {
            let [model, own] = worn.onto().figures().map(|figure| &figure.skeleton().joints);
            for (from, to) in worn.onto().pairs() {
                let name = || own[to].name.clone();
                pairs.entry(model[from].name.clone()).or_insert_with(name);
            }
        }
        pairs
    }
}

/// Checks that a rotation has about unit length.
///
/// # Errors
/// [`Fault`] for numbers that are not a rotation.
pub fn rotation(place: &str, xyzw: [f64; 4]) -> Result<Quat, Fault> {
    let length = xyzw.iter().map(|value| value * value).sum::<f64>().sqrt();
    match QUAT_LENGTHS.contains(&length) {
        true => Ok(Quat::from_array(xyzw.map(|value| (value / length) as f32)).normalize()),
        false => Err(Fault::schema(
            place,
            format!("has length {length}"),
            "a unit quaternion x, y, z, w",
        )),
    }
}

/// Checks the skeleton of a request: the model's, or a body that its motion can be carried over to.
///
/// # Errors
/// [`Fault`] for joints that do not form a tree, or whose body does not fit the model.
pub fn check(skeleton: &Skeleton, model: &Model, space: &Space) -> Result<Joints, Fault> {
    check_form(skeleton)?;
    let parents = tree(&skeleton.joints)?;
    let mut rest = Vec::with_capacity(parents.len());
    for (index, (joint, &parent)) in skeleton.joints.iter().zip(&parents).enumerate() {
        let place = format!("skeleton.joints[{index}].rest_rotation");
        rest.push(GltfJoint {
            name: joint.name.clone(),
            parent,
            translation_m: Vec3::from_array(joint.rest_translation.map(|value| value as f32)),
            rotation: rotation(&place, joint.rest_rotation)?,
        });
    }
    match same(skeleton, model) {
        Ok(order) => Ok(Joints {
            skeleton: model.rig().skeleton.clone(),
            still: model.rest().0,
            contacts: model.contact_joints().into_iter().enumerate().collect(),
            axes: model.axes(),
            order,
            rest,
            worn: None,
        }),
        Err(fault) if !model.can_be_worn(&space.packs.table()) => Err(fault),
        Err(_) => carried(rest, model, space),
    }
}

/// The model's index of each joint of a request that has the model's skeleton. Their order and
/// their rest rotations may differ, because channels replace rest rotations.
fn same(skeleton: &Skeleton, model: &Model) -> Result<Vec<usize>, Fault> {
    let own = model.skeleton();
    let places: HashMap<&str, usize> = own
        .joints
        .iter()
        .enumerate()
        .map(|(index, joint)| (joint.name.as_str(), index))
        .collect();
    if skeleton.joints.len() != own.joints.len() {
        return Err(foreign(
            "skeleton.joints",
            format!("has {} joints", skeleton.joints.len()),
            format!("the {} joints of canonical_skeleton", own.joints.len()),
        ));
    }
    let mut order = Vec::with_capacity(own.joints.len());
    for (index, joint) in skeleton.joints.iter().enumerate() {
        let field = |name: &str| format!("skeleton.joints[{index}].{name}");
        let Some(&place) = places.get(joint.name.as_str()) else {
            let allowed = "the joints of canonical_skeleton, by name";
            return Err(foreign(field("name"), format!("is {:?}", joint.name), allowed));
        };
        let canonical = &own.joints[place];
        if canonical.parent != joint.parent {
            let allowed = canonical.parent.clone().unwrap_or_else(|| "null".to_owned());
            return Err(foreign(
                field("parent"),
                format!("is {:?}", joint.parent),
                allowed,
            ));
        }
        let off = joint.rest_translation.iter().zip(canonical.rest_translation);
        let off_m = off.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        // The root's rest position does not depend on the body.
        let tolerance_m = if joint.parent.is_some() {
            REST_TOLERANCE_M
        } else {
            MAX_PLACE_M
        };
        if off_m > tolerance_m {
            let allowed = format!("within {tolerance_m} m of {:?}", canonical.rest_translation);
            return Err(foreign(
                field("rest_translation"),
                format!("is {:?}", joint.rest_translation),
                allowed,
            ));
        }
        order.push(place);
    }
    Ok(order)
}

/// The way from a model's skeleton to a body of the caller's own, with these joints.
///
/// # Errors
/// [`Fault`] for a body that the model's motion cannot be carried over to.
pub(super) fn worn(rest: &[GltfJoint], model: &Model, space: &Space) -> Result<Arc<Worn>, Fault> {
    let joint = |joint: &GltfJoint| troupe_motion::Joint {
        name: joint.name.clone(),
        parent: joint.parent,
        offset_m: joint.translation_m,
    };
    let guest = Guest {
        joints: rest.iter().map(joint).collect(),
        rest: rest.iter().map(|joint| joint.rotation).collect(),
        height_m: rest.first().map_or(0.0, |root| root.translation_m.y),
    };
    let of = (&*model.loaded, model.place);
    let skeletons = space.store.skeletons();
    let worn = skeletons.guest("skeleton", guest, of, &space.packs.table());
    worn.map_err(unfit)
}

/// The contact joints of the body that motion is carried over to, by the bits of its contacts.
pub(super) fn contacts(worn: &Worn) -> Vec<(usize, String)> {
    let contacts = worn.onto().contacts().into_iter().flatten();
    let contacts: BTreeMap<usize, usize> = contacts.collect();
    let joints = &worn.skeleton().joints;
    let named = |(bit, joint): (usize, usize)| (bit, joints[joint].name.clone());
    contacts.into_iter().map(named).collect()
}

/// The joints of a body that the model's motion is carried over to.
fn carried(rest: Vec<GltfJoint>, model: &Model, space: &Space) -> Result<Joints, Fault> {
    let still: Vec<Quat> = rest.iter().map(|joint| joint.rotation).collect();
    let worn = worn(&rest, model, space)?;
    let skeleton = worn.skeleton().clone();
    Ok(Joints {
        contacts: contacts(&worn),
        axes: Axes::new(&skeleton, &vec![Quat::IDENTITY; still.len()]),
        order: (0..still.len()).collect(),
        skeleton,
        still,
        rest,
        worn: Some(worn),
    })
}

/// The protocol's error for a body that motion cannot be carried over to.
fn unfit(error: SkeletonError) -> Fault {
    let canonical = "or canonical_skeleton";
    match error {
        SkeletonError::Field(FieldError {
            field,
            message,
            allowed,
        }) => foreign(field, message, format!("{allowed}; {canonical}")),
        SkeletonError::Unfit {
            field,
            pack,
            faults,
            allowed,
            ..
        } => {
            let message = format!("does not fit {pack}: {}", faults.join("; "));
            foreign(field, message, format!("{allowed}; {canonical}")).with("faults", faults)
        }
        other => foreign("skeleton", other.to_string(), "canonical_skeleton"),
    }
}

fn foreign(field: impl Into<String>, message: String, allowed: impl Into<String>) -> Fault {
    Fault::new(Code::RetargetingUnsupported, field, message, allowed)
}

fn check_form(skeleton: &Skeleton) -> Result<(), Fault> {
    for (field, found, only) in [
        (
            "skeleton.coordinate_system",
            &skeleton.coordinate_system,
            coordinates(),
        ),
        ("skeleton.units", &skeleton.units, units()),
    ] {
        if *found != only {
            return Err(Fault::schema(field, format!("is {found:?}"), only));
        }
    }
    for (index, joint) in skeleton.joints.iter().enumerate() {
        let count = joint.name.chars().count();
        if !(1..=MAX_NAME_CHARS).contains(&count) {
            let allowed = format!("1 to {MAX_NAME_CHARS} characters");
            let field = format!("skeleton.joints[{index}].name");
            return Err(Fault::schema(field, format!("has {count} characters"), allowed));
        }
        let shown = joint.display_name.iter().map(|name| name.chars().count());
        if let Some(count) = shown.into_iter().find(|count| *count > MAX_DISPLAY_CHARS) {
            let allowed = format!("at most {MAX_DISPLAY_CHARS} characters");
            let field = format!("skeleton.joints[{index}].display_name");
            return Err(Fault::schema(field, format!("has {count} characters"), allowed));
        }
    }
    match skeleton.joints.is_empty() {
        true => Err(Fault::schema("skeleton.joints", "is empty", "1 joint or more")),
        false => Ok(()),
    }
}

/// The parents of joints that form one tree. Each joint comes after its parent.
fn tree(joints: &[Joint]) -> Result<Vec<Option<usize>>, Fault> {
    let wrong = |index: usize, name: &str, message: String, allowed: &str| {
        let field = format!("skeleton.joints[{index}].{name}");
        Err(Fault::new(Code::InvalidSkeleton, field, message, allowed))
    };
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut parents = Vec::with_capacity(joints.len());
    let mut roots = 0;
    for (index, joint) in joints.iter().enumerate() {
        let parent = match &joint.parent {
            None => None,
            Some(parent) => match places.get(parent.as_str()) {
                Some(&place) => Some(place),
                None => {
                    let allowed = "the name of a joint before it";
                    return wrong(index, "parent", format!("is {parent:?}"), allowed);
                }
            },
        };
        roots += usize::from(parent.is_none());
        if roots > 1 {
            return wrong(index, "parent", "is null again".to_owned(), "null for one joint");
        }
        if places.insert(&joint.name, index).is_some() {
            return wrong(
                index,
                "name",
                format!("is {:?} again", joint.name),
                "each name once",
            );
        }
        parents.push(parent);
    }
    Ok(parents)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(name: &str, parent: Option<&str>) -> Joint {
        Joint {
            name: name.to_owned(),
            parent: parent.map(str::to_owned),
            rest_translation: [0.0; 3],
            rest_rotation: [0.0, 0.0, 0.0, 1.0],
            display_name: None,
        }
    }

    #[test]
    fn joints_make_one_tree() {
        let good = [joint("a", None), joint("b", Some("a")), joint("c", Some("a"))];
        assert_eq!(tree(&good).unwrap(), [None, Some(0), Some(0)]);
        for bad in [
            vec![joint("a", None), joint("b", None)],
            vec![joint("a", None), joint("a", Some("a"))],
            vec![joint("b", Some("a")), joint("a", None)],
            vec![joint("a", Some("a"))],
        ] {
            assert_eq!(tree(&bad).unwrap_err().code, Code::InvalidSkeleton);
        }
    }

    #[test]
    fn at_rest_the_wire_turns_nothing() {
        let joint = |name: &str, parent| troupe_motion::Joint {
            name: name.to_owned(),
            parent,
            offset_m: Vec3::X,
        };
        let joints = vec![joint("a", None), joint("b", Some(0)), joint("c", Some(1))];
        let skeleton = troupe_motion::Skeleton::new(joints, Vec3::X, 0.0, None).unwrap();
        let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let rest = [turn, Quat::from_rotation_x(0.3), turn];
        let axes = Axes::new(&skeleton, &rest);
        assert!(axes.offset(0, Vec3::X).distance(Vec3::Y) < 1e-6);
        for (joint, &rotation) in rest.iter().enumerate() {
            assert!(axes.to_wire(joint, rotation).angle_between(Quat::IDENTITY) < 1e-3);
            let other = Quat::from_rotation_y(0.7);
            let back = axes.to_model(joint, axes.to_wire(joint, other));
            assert!(back.angle_between(other) < 1e-3);
        }
        // The same motion: worlds differ by the rotation at rest alone.
        let pose = [0.1, 0.5, -0.4].map(Quat::from_rotation_y);
        let wire: Vec<Quat> = (0..3).map(|joint| axes.to_wire(joint, pose[joint])).collect();
        let (model, wire) = (pose[0] * pose[1] * pose[2], wire[0] * wire[1] * wire[2]);
        assert!(axes.world_to_model(2, wire).angle_between(model) < 1e-3);
    }

    #[test]
    fn rotations_are_brought_to_unit_length() {
        let turned = rotation("q", [0.0, 1.1, 0.0, 0.0]).unwrap();
        assert_eq!(turned, Quat::from_xyzw(0.0, 1.0, 0.0, 0.0));
        for bad in [[0.0; 4], [f64::NAN; 4], [9.0, 0.0, 0.0, 0.0]] {
            assert!(rotation("q", bad).is_err());
        }
    }
}
