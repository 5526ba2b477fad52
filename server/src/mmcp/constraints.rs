//! Checks the constraints of a request.

use std::collections::{BTreeMap, HashMap};

use serde_json::Value;
use troupe_character::take::{Clock, Effector, Ground, Knot, PoseKey, Wanted};
use troupe_motion::{Quat, Vec3};

use super::fault::{Code, Fault};
use super::limits::{
    MAX_CONSTRAINTS, MAX_GROUND_POINTS, MAX_HEIGHT_M, MAX_PLACE_M, MAX_POINTS, MAX_SPEED_MPS,
};
use super::model::Model;
use super::schema::{EffectorTarget, FillMode, GroundHeight, PoseKeyframe, RootPath, read, take_type};
use super::skeleton::{Joints, rotation};

/// Types of constraints in the protocol.
const TYPES: [&str; 4] = ["root_path", "effector_target", "pose_keyframe", "ground_height"];

/// The motion that the constraints belong to.
pub struct Scope<'a> {
    /// The model that must meet the constraints.
    pub model: &'a Model,
    /// The body that must meet them.
    pub joints: &'a Joints,
    /// Converts frames of the request to frames of the model.
    pub clock: Clock,
}

/// One decoded constraint.
#[derive(Debug)]
pub enum Constraint {
    /// Positions of the root over the ground.
    Path(RootPath),
    /// Positions of a joint.
    Effector(EffectorTarget),
    /// Rotations of joints in one frame.
    Pose(PoseKeyframe),
    /// Points on the ground's surface.
    Ground(GroundHeight),
}

/// Decodes the constraints of a request.
///
/// # Errors
/// [`Fault`] for the first constraint that does not have the protocol's form.
pub fn read_all(values: Vec<Value>) -> Result<Vec<Constraint>, Fault> {
    let each = values.into_iter().enumerate();
    each.map(|(index, value)| read_one(value, &format!("constraints[{index}]")))
        .collect()
}

fn read_one(mut value: Value, place: &str) -> Result<Constraint, Fault> {
    let kind = take_type(&mut value, place)?;
    let field = |name: &str| format!("{place}.{name}");
    match kind.as_str() {
        "root_path" => {
            let path: RootPath = read(value, place)?;
            let count = path.frames.len();
            filled(&field("frames"), count, MAX_POINTS)?;
            same(&field("positions_xz"), path.positions_xz.len(), count)?;
            if let Some(headings) = &path.heading_radians {
                same(&field("heading_radians"), headings.len(), count)?;
            }
            if let Some(at) = path.frames.windows(2).position(|pair| pair[0] >= pair[1]) {
                let allowed = format!("more than {}", path.frames[at]);
                let found = format!("is {}", path.frames[at + 1]);
                return Err(Fault::schema(
                    format!("{place}.frames[{}]", at + 1),
                    found,
                    allowed,
                ));
            }
            Ok(Constraint::Path(path))
        }
        "effector_target" => {
            let target: EffectorTarget = read(value, place)?;
            let count = target.frames.len();
            filled(&field("frames"), count, MAX_POINTS)?;
            same(&field("positions"), target.positions.len(), count)?;
            if let Some(rotations) = &target.rotations {
                same(&field("rotations"), rotations.len(), count)?;
            }
            Ok(Constraint::Effector(target))
        }
        "pose_keyframe" => {
            let pose: PoseKeyframe = read(value, place)?;
            if pose.frame < 0 {
                return Err(Fault::schema(
                    field("frame"),
                    format!("is {}", pose.frame),
                    "0 or more",
                ));
            }
            match pose.joint_rotations.is_empty() {
                true => Err(Fault::schema(
                    field("joint_rotations"),
                    "is empty",
                    "1 joint or more",
                )),
                false => Ok(Constraint::Pose(pose)),
            }
        }
        "ground_height" => {
            let ground: GroundHeight = read(value, place)?;
            filled(&field("points"), ground.points.len(), MAX_GROUND_POINTS)?;
            Ok(Constraint::Ground(ground))
        }
        other => {
            let found = format!("is {:?}", troupe_base::echo::cut(other, 64));
            Err(Fault::schema(field("type"), found, TYPES.join(", ")))
        }
    }
}

impl Constraint {
    /// The type's name in the protocol.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Path(_) => TYPES[0],
            Self::Effector(_) => TYPES[1],
            Self::Pose(_) => TYPES[2],
            Self::Ground(_) => TYPES[3],
        }
    }
}

fn filled(place: &str, found: usize, most: usize) -> Result<(), Fault> {
    match found {
        0 => Err(Fault::schema(place, "is empty", format!("1 to {most}"))),
        _ if found > most => Err(Fault::option(
            place,
            format!("has {found} entries"),
            format!("1 to {most}"),
        )),
        _ => Ok(()),
    }
}

fn same(place: &str, found: usize, wanted: usize) -> Result<(), Fault> {
    match found == wanted {
        true => Ok(()),
        false => Err(Fault::schema(
            place,
            format!("has {found} entries"),
            format!("exactly {wanted}, one per frame"),
        )),
    }
}

/// Checks constraints against the model, and converts them to its frames.
///
/// # Errors
/// [`Fault`] for the first constraint that is not accepted.
pub fn check(constraints: &[Constraint], scope: &Scope<'_>) -> Result<Wanted, Fault> {
    let count = constraints.len();
    if count > MAX_CONSTRAINTS {
        let allowed = format!("at most {MAX_CONSTRAINTS}");
        return Err(Fault::option(
            "constraints",
            format!("has {count} entries"),
            allowed,
        ));
    }
    let supported = scope.model.constraints();
    for (index, constraint) in constraints.iter().enumerate() {
        let kind = constraint.kind();
        if !supported.contains(&kind) {
            let field = format!("constraints[{index}].type");
            let allowed = match supported.is_empty() {
                true => format!("no constraints: {} takes none", scope.model.id),
                false => supported.join(", "),
            };
            let fault = Fault::new(
                Code::UnsupportedConstraint,
                field,
                format!("is {kind:?}"),
                allowed,
            );
            return Err(fault.with("supported_constraints", supported));
        }
    }
    let mut wanted = Wanted {
        ground: ground(constraints)?,
        ..Wanted::default()
    };
    let (mut path, mut keys) = (BTreeMap::new(), BTreeMap::new());
    let joints = scope.joints();
    for (index, constraint) in constraints.iter().enumerate() {
        let place = format!("constraints[{index}]");
        match constraint {
            Constraint::Path(given) => scope.path(&place, given, &mut path)?,
            Constraint::Effector(given) => {
                let Wanted {
                    ground, effectors, ..
                } = &mut wanted;
                scope.effector(&place, given, &joints, ground, effectors)?;
            }
            Constraint::Pose(given) => {
                let key = scope.pose(&place, given, &joints, &wanted.ground)?;
                if keys.insert(key.frame, key).is_some() {
                    let field = format!("{place}.frame");
                    let found = format!("is {}, which is the frame of another pose", given.frame);
                    let allowed = "one pose per frame of the model";
                    return Err(Fault::new(Code::InvalidRequest, field, found, allowed));
                }
            }
            Constraint::Ground(_) => {}
        }
    }
    wanted.path = path.into_values().collect();
    wanted.keys = keys.into_values().collect();
    wanted.effectors.sort_by_key(|effector| effector.frame);
    scope.check_speed(&wanted.path)?;
    Ok(wanted)
}

fn ground(constraints: &[Constraint]) -> Result<Ground, Fault> {
    let mut points = Vec::new();
    for (index, constraint) in constraints.iter().enumerate() {
        let Constraint::Ground(ground) = constraint else {
            continue;
        };
        for (nth, &[x, z, y]) in ground.points.iter().enumerate() {
            let place = format!("constraints[{index}].points[{nth}]");
            points.push(world(&place, [x, y, z])?);
        }
        filled(
            &format!("constraints[{index}].points"),
            points.len(),
            MAX_GROUND_POINTS,
        )?;
    }
    Ok(Ground(points))
}

/// A world position, metres.
///
/// # Errors
/// [`Fault`] if it is too far away.
pub(super) fn world(place: &str, [x, y, z]: [f64; 3]) -> Result<Vec3, Fault> {
    for (value, most, axis) in [
        (x, MAX_PLACE_M, 'x'),
        (y, MAX_HEIGHT_M, 'y'),
        (z, MAX_PLACE_M, 'z'),
    ] {
        if !(-most..=most).contains(&value) {
            let allowed = format!("-{most} to {most} m along {axis}");
            return Err(Fault::schema(place, format!("is {value} along {axis}"), allowed));
        }
    }
    Ok(Vec3::new(x as f32, y as f32, z as f32))
}

/// Points of a path by their frame, in hundredths of a frame.
type Knots = BTreeMap<i64, Knot>;

impl Scope<'_> {
    fn joints(&self) -> HashMap<&str, usize> {
        let joints = self.joints.skeleton.joints.iter().enumerate();
        joints
            .map(|(index, joint)| (joint.name.as_str(), index))
            .collect()
    }

    fn frame(&self, place: &str, frame: i64) -> Result<usize, Fault> {
        let total = self.clock.frames;
        match usize::try_from(frame).ok().filter(|frame| *frame < total) {
            Some(frame) => Ok(frame),
            None => {
                let allowed = format!("0 to {}", total - 1);
                let fault = Fault::new(Code::FrameOutOfRange, place, format!("is {frame}"), allowed);
                Err(fault.with("frame", frame).with("total_frames", total))
            }
        }
    }

    fn nearest(&self, frame: usize) -> usize {
        self.clock.native(frame).round() as usize
    }

    fn path(&self, place: &str, given: &RootPath, knots: &mut Knots) -> Result<(), Fault> {
        for (nth, &frame) in given.frames.iter().enumerate() {
            let native = self
                .clock
                .native(self.frame(&format!("{place}.frames[{nth}]"), frame)?);
            let [x, z] = given.positions_xz[nth];
            let at = world(&format!("{place}.positions_xz[{nth}]"), [x, 0.0, z])?;
            let heading = match given.heading_radians.as_ref().map(|headings| headings[nth]) {
                None => None,
                Some(heading) if heading.abs() <= 1000.0 => Some(heading as f32),
                Some(heading) => {
                    let field = format!("{place}.heading_radians[{nth}]");
                    return Err(Fault::schema(field, format!("is {heading}"), "-1000 to 1000"));
                }
            };
            let knot = Knot {
                frame: native,
                place: [at.x, at.z],
                heading,
            };
            if knots.insert((native * 100.0).round() as i64, knot).is_some() {
                let field = format!("{place}.frames[{nth}]");
                let found = format!("is {frame}, but the root already has a place in that frame");
                return Err(Fault::new(
                    Code::InvalidRequest,
                    field,
                    found,
                    "one place per frame",
                ));
            }
        }
        Ok(())
    }

    /// Rejects a path that is faster than any living thing of the body's size.
    fn check_speed(&self, path: &[Knot]) -> Result<(), Fault> {
        for pair in path.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let way = (b.place[0] - a.place[0]).hypot(b.place[1] - a.place[1]);
            let speed = way * self.clock.native_fps / (b.frame - a.frame);
            let most = MAX_SPEED_MPS * self.joints.scale();
            if speed > most {
                let at = b.frame * self.clock.fps / self.clock.native_fps;
                let found = format!("has a root path of {speed:.1} m/s before frame {at:.0}");
                return Err(Fault::option("constraints", found, format!("at most {most} m/s")));
            }
        }
        Ok(())
    }

    fn joint(&self, place: String, name: &str, joints: &HashMap<&str, usize>) -> Result<usize, Fault> {
        joints.get(name).copied().ok_or_else(|| {
            let mut names: Vec<&str> = joints.keys().copied().collect();
            names.sort_unstable();
            let found = format!("is {:?}", troupe_base::echo::cut(name, 64));
            Fault::new(Code::UnknownJoint, place, found, "a joint of the skeleton")
                .with("skeleton_joints", names)
        })
    }

    fn effector(
        &self,
        place: &str,
        given: &EffectorTarget,
        joints: &HashMap<&str, usize>,
        ground: &Ground,
        effectors: &mut Vec<Effector>,
    ) -> Result<(), Fault> {
        let joint = self.joint(format!("{place}.joint"), &given.joint, joints)?;
        let axes = &self.joints.axes;
        for (nth, &frame) in given.frames.iter().enumerate() {
            let frame = self.frame(&format!("{place}.frames[{nth}]"), frame)?;
            let point = world(&format!("{place}.positions[{nth}]"), given.positions[nth])?;
            let rotation = given.rotations.as_ref().map(|rotations| {
                let place = format!("{place}.rotations[{nth}]");
                rotation(&place, rotations[nth]).map(|turned| axes.world_to_model(joint, turned))
            });
            // The root's positions are met before the motion is lifted onto the ground, those of
            // other joints after it.
            let floor = if joint == 0 {
                ground.height(point.x, point.z)
            } else {
                None
            };
            effectors.push(Effector {
                frame: self.nearest(frame),
                joint,
                point: point - Vec3::Y * floor.unwrap_or(0.0),
                rotation: rotation.transpose()?,
            });
        }
        Ok(())
    }

    fn pose(
        &self,
        place: &str,
        given: &PoseKeyframe,
        joints: &HashMap<&str, usize>,
        ground: &Ground,
    ) -> Result<PoseKey, Fault> {
        let frame = self.frame(&format!("{place}.frame"), given.frame)?;
        let Joints { still, axes, .. } = self.joints;
        let mut rotations: Vec<Option<Quat>> = match given.fill_mode {
            FillMode::Generate => vec![None; still.len()],
            FillMode::Rest => still.iter().copied().map(Some).collect(),
        };
        for (name, &xyzw) in &given.joint_rotations {
            let place = format!("{place}.joint_rotations.{}", troupe_base::echo::cut(name, 64));
            let joint = self.joint(place.clone(), name, joints)?;
            rotations[joint] = Some(axes.to_model(joint, rotation(&place, xyzw)?));
        }
        let root = given
            .root_position
            .map(|root| world(&format!("{place}.root_position"), root));
        let root = root.transpose()?.map(|root| {
            let floor = ground.height(root.x, root.z);
            root - Vec3::Y * floor.unwrap_or(0.0)
        });
        Ok(PoseKey {
            frame: self.nearest(frame),
            rotations,
            root,
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn code(value: Value) -> Code {
        read_all(vec![value]).unwrap_err().code
    }

    #[test]
    fn lists_have_an_entry_a_frame() {
        let good = json!({"type": "root_path", "frames": [0, 5], "positions_xz": [[0, 0], [1, 2]]});
        assert_eq!(read_all(vec![good]).unwrap()[0].kind(), "root_path");
        for bad in [
            json!({"type": "root_path", "frames": [], "positions_xz": []}),
            json!({"type": "root_path", "frames": [5, 5], "positions_xz": [[0, 0], [1, 2]]}),
            json!({"type": "root_path", "frames": [0], "positions_xz": [[0, 0], [1, 2]]}),
            json!({"type": "root_path", "frames": [0], "positions_xz": [[0, 0]], "heading_radians": []}),
            json!({"type": "effector_target", "joint": "a", "frames": [0], "positions": []}),
            json!({"type": "pose_keyframe", "frame": -1, "joint_rotations": {"a": [0, 0, 0, 1]}}),
            json!({"type": "pose_keyframe", "frame": 0, "joint_rotations": {}}),
            json!({"type": "ground_height", "points": []}),
            json!({"type": "gravity"}),
            json!({"frames": [0]}),
            json!([1]),
        ] {
            assert_eq!(code(bad.clone()), Code::SchemaValidation, "{bad}");
        }
        let many = vec![[0, 0, 0]; MAX_GROUND_POINTS + 1];
        assert_eq!(
            code(json!({"type": "ground_height", "points": many})),
            Code::InvalidOptions
        );
    }

    #[test]
    fn places_are_within_reach() {
        assert!(world("p", [1.0, 2.0, 3.0]).is_ok());
        let error = world("p", [0.0, 1e3, 0.0]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "p: is 1000 along y; allowed: -100 to 100 m along y"
        );
        assert!(world("p", [f64::INFINITY, 0.0, 0.0]).is_err());
    }
}
