//! URDF.

use std::collections::HashMap;

use glam::{DQuat, DVec3, EulerRot};
use roxmltree::Node;

use super::parts::{child, element_error, numbers, stl_points};
use super::{DescribedJoint, DescriptionError, Follows, Kind, Link, Shape, Solid};

type Parts = (String, Vec<Link>, Vec<DescribedJoint>);

pub(super) fn read(
    root: Node<'_, '_>,
    beside: &dyn Fn(&str) -> Option<Vec<u8>>,
) -> Result<Parts, DescriptionError> {
    let mut links = Vec::new();
    let mut place = HashMap::new();
    for element in root.children().filter(|node| node.has_tag_name("link")) {
        let link = link(element, beside)?;
        if place.insert(link.name.clone(), links.len()).is_some() {
            return Err(element_error(element, "there is another link of this name"));
        }
        links.push(link);
    }
    let joints = root.children().filter(|node| node.has_tag_name("joint"));
    let joints = joints
        .map(|element| joint(element, &place))
        .collect::<Result<Vec<_>, _>>()?;
    Ok((
        root.attribute("name").unwrap_or("robot").to_owned(),
        links,
        joints,
    ))
}

fn joint(element: Node<'_, '_>, place: &HashMap<String, usize>) -> Result<DescribedJoint, DescriptionError> {
    let wrong = |reason: &str| element_error(element, reason);
    let link = |tag: &str| {
        let name = child(element, tag).and_then(|node| node.attribute("link"));
        let name = name.ok_or_else(|| wrong("a joint needs <parent link> and <child link>"))?;
        let found = place.get(name).copied();
        found.ok_or_else(|| wrong(&format!("there is no link {name:?}")))
    };
    let kind = element.attribute("type").unwrap_or_default();
    let (place, turn) = origin(element)?;
    let mut made = DescribedJoint {
        name: element.attribute("name").unwrap_or_default().to_owned(),
        kind: Kind::Fixed,
        parent: link("parent")?,
        child: link("child")?,
        place,
        turn,
        axis: DVec3::X,
        lower_rad: -std::f64::consts::PI,
        upper_rad: std::f64::consts::PI,
        max_speed_rad_per_s: 0.0,
        follows: None,
    };
    match kind {
        "fixed" => return Ok(made),
        "floating" => {
            made.kind = Kind::Floating;
            return Ok(made);
        }
        "revolute" | "continuous" => made.kind = Kind::Hinge,
        other => {
            let reason = format!("type {other:?}; allowed: revolute, continuous, fixed, floating");
            return Err(wrong(&reason));
        }
    }
    let axis = child(element, "axis");
    let axis = axis.map_or(Ok(DVec3::X), |axis| {
        Ok(DVec3::from(numbers::<3>(axis, "xyz", "1 0 0")?))
    })?;
    made.axis = axis
        .try_normalize()
        .ok_or_else(|| wrong("its axis has no length"))?;
    let limit = child(element, "limit");
    if let Some(limit) = limit {
        [made.max_speed_rad_per_s] = numbers::<1>(limit, "velocity", "0")?;
    }
    if kind == "revolute" {
        let limit = limit.ok_or_else(|| wrong("a revolute joint needs a <limit>"))?;
        [made.lower_rad] = numbers::<1>(limit, "lower", "0")?;
        [made.upper_rad] = numbers::<1>(limit, "upper", "0")?;
    }
    if let Some(mimic) = child(element, "mimic") {
        let joint = mimic
            .attribute("joint")
            .ok_or_else(|| wrong("<mimic> names no joint"))?;
        let [multiplier] = numbers::<1>(mimic, "multiplier", "1")?;
        let [offset_rad] = numbers::<1>(mimic, "offset", "0")?;
        made.follows = Some(Follows {
            joint: joint.to_owned(),
            multiplier,
            offset_rad,
        });
    } else if made.lower_rad >= made.upper_rad {
        let reason = format!(
            "its lower limit {} is not below the upper {}",
            made.lower_rad, made.upper_rad
        );
        return Err(wrong(&reason));
    }
    Ok(made)
}

/// Place and rotation of `<origin>`: roll, pitch, yaw about the fixed X, Y and Z.
fn origin(element: Node<'_, '_>) -> Result<(DVec3, DQuat), DescriptionError> {
    let Some(origin) = child(element, "origin") else {
        return Ok((DVec3::ZERO, DQuat::IDENTITY));
    };
    let place = DVec3::from(numbers::<3>(origin, "xyz", "0 0 0")?);
    let [roll, pitch, yaw] = numbers::<3>(origin, "rpy", "0 0 0")?;
    Ok((place, DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll)))
}

fn link(element: Node<'_, '_>, beside: &dyn Fn(&str) -> Option<Vec<u8>>) -> Result<Link, DescriptionError> {
    let mut link = Link {
        name: element.attribute("name").unwrap_or_default().to_owned(),
        ..Link::default()
    };
    for collision in element.children().filter(|node| node.has_tag_name("collision")) {
        link.shapes.extend(shape(collision, beside)?);
    }
    if let Some(inertial) = child(element, "inertial") {
        link.inertia = inertia(inertial)?;
    }
    Ok(link)
}

/// A collision's shape; none for a mesh that is not to be had, or is no binary STL.
fn shape(
    collision: Node<'_, '_>,
    beside: &dyn Fn(&str) -> Option<Vec<u8>>,
) -> Result<Option<Shape>, DescriptionError> {
    let (place, turn) = origin(collision)?;
    let solid = child(collision, "geometry").and_then(|geometry| geometry.first_element_child());
    let Some(solid) = solid else {
        return Ok(None);
    };
    let made = match solid.tag_name().name() {
        "sphere" => {
            let [radius] = numbers::<1>(solid, "radius", "")?;
            Solid::Sphere { radius }
        }
        "box" => Solid::Box {
            half: DVec3::from(numbers::<3>(solid, "size", "")?) / 2.0,
        },
        "cylinder" | "capsule" => {
            let [radius] = numbers::<1>(solid, "radius", "")?;
            let [length] = numbers::<1>(solid, "length", "")?;
            Solid::Cylinder {
                radius,
                half_length: length / 2.0,
            }
        }
        "mesh" => {
            let name = solid.attribute("filename").unwrap_or_default();
            let scale = DVec3::from(numbers::<3>(solid, "scale", "1 1 1")?);
            let name = name.strip_prefix("package://").unwrap_or(name);
            let points = beside(name).and_then(|bytes| stl_points(&bytes));
            let Some(points) = points else {
                return Ok(None);
            };
            Solid::Points(points.into_iter().map(|point| point * scale).collect())
        }
        _ => return Ok(None),
    };
    Ok(Some(Shape {
        solid: made,
        place,
        turn,
    }))
}

/// The box with a link's mass and moments of inertia: Ixx = m (b² + c²) / 12 and so on.
fn inertia(inertial: Node<'_, '_>) -> Result<Option<Shape>, DescriptionError> {
    let (Some(mass), Some(inertia)) = (child(inertial, "mass"), child(inertial, "inertia")) else {
        return Ok(None);
    };
    let (place, turn) = origin(inertial)?;
    let [kilograms] = numbers::<1>(mass, "value", "0")?;
    let moment = |name: &str| numbers::<1>(inertia, name, "0").map(|[moment]| moment);
    let moments = DVec3::new(moment("ixx")?, moment("iyy")?, moment("izz")?);
    if kilograms <= 0.0 {
        return Ok(None);
    }
    let squares = (DVec3::splat(moments.element_sum() / 2.0) - moments).max(DVec3::ZERO) * 12.0 / kilograms;
    let edges = squares.to_array().map(f64::sqrt);
    Ok(Some(Shape {
        solid: Solid::Box {
            half: DVec3::from(edges) / 2.0,
        },
        place,
        turn,
    }))
}
