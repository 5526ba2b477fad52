//! Skeletons that come with a request.

use troupe_character::{FieldError, Path};
use troupe_motion::model::{Body, BodyError, InlineJoint, InlineSkeleton, Rig};
use troupe_motion::rotation::from_wxyz;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;

/// Name of a body whose skeleton came with the request.
const NAME: &str = "skeleton";

/// Makes a body from the skeleton that a request gives at `path`. `notes` gets a line for what was
/// derived and may be meant otherwise. `rig` gives frame rate and sizes of segments.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn inline_body(
    path: &Path<'_>,
    skeleton: &v1::BodySkeleton,
    rig: &Rig,
    notes: &mut Vec<String>,
) -> Result<Body, FieldError> {
    let mut joints = Vec::with_capacity(skeleton.joints.len());
    for (index, joint) in skeleton.joints.iter().enumerate() {
        let path = path.element("joints", index);
        joints.push(InlineJoint {
            name: joint.name.clone(),
            parent: joint.parent.clone(),
            offset_m: vector(&path.field("offset"), joint.offset.unwrap_or_default())?,
        });
    }
    let neutral = skeleton.neutral.iter().map(|q| from_wxyz([q.w, q.x, q.y, q.z]));
    let neutral: Vec<Quat> = neutral.collect();
    let left_axis = skeleton
        .left_axis
        .map(|axis| vector(&path.field("left_axis"), axis));
    let inline = InlineSkeleton {
        joints,
        left_axis: left_axis.transpose()?,
        contacts: (!skeleton.contact_joints.is_empty()).then(|| skeleton.contact_joints.clone()),
        neutral: (!neutral.is_empty()).then_some(neutral),
        sides: None,
        robot: None,
    };
    inline
        .body(NAME, rig.fps, &rig.dims, notes)
        .map_err(|error| field_error(path, error))
}

fn vector(path: &Path<'_>, v: v1::Vec3) -> Result<Vec3, FieldError> {
    match v.x.is_finite() && v.y.is_finite() && v.z.is_finite() {
        true => Ok(Vec3::new(v.x, v.y, v.z)),
        false => Err(path.error("is not finite", "finite numbers")),
    }
}

/// Maps the error to the request's field names.
fn field_error(path: &Path<'_>, error: BodyError) -> FieldError {
    match error {
        BodyError::Field {
            field,
            found,
            allowed,
        } => {
            let inside = field.strip_prefix("skeleton.").unwrap_or(&field);
            let inside = inside
                .replace("offset_m", "offset")
                .replace("neutral.rotations", "neutral");
            FieldError {
                field: format!("{path}.{}", inside.replace("contacts[", "contact_joints[")),
                message: format!("is {found}"),
                allowed,
            }
        }
        other => path.error(
            format!("does not make a body: {other}"),
            "one tree of joints with names of their own",
        ),
    }
}
