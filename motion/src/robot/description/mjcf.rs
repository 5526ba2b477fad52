//! MJCF, MuJoCo's own format, as far as kinematics goes: bodies, hinges, free joints, defaults, and
//! equalities between joints.

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec3};
use roxmltree::Node;

use super::parts::{child, element_error, numbers};
use super::{DescribedJoint, DescriptionError, Follows, Kind, Link, Shape, Solid};

type Parts = (String, Vec<Link>, Vec<DescribedJoint>);

/// What `<compiler>` and `<default>` say.
struct Settings<'a, 'input> {
    /// Whether angles are in degrees, as they are unless the file says otherwise.
    degrees: bool,
    /// Whether a range limits a joint that does not say so.
    autolimits: bool,
    /// Letters of `eulerseq`.
    euler: String,
    /// Classes by name, each with the class around it.
    classes: HashMap<String, Class<'a, 'input>>,
}

#[derive(Clone)]
struct Class<'a, 'input> {
    element: Node<'a, 'input>,
    around: Option<String>,
}

pub(super) fn read(root: Node<'_, '_>) -> Result<Parts, DescriptionError> {
    if let Some(include) = root.descendants().find(|node| node.has_tag_name("include")) {
        let reason = "files that include others are not read; MuJoCo's `compile` writes one whole file";
        return Err(element_error(include, reason));
    }
    let settings = Settings::of(root)?;
    let world = child(root, "worldbody").ok_or_else(|| element_error(root, "it has no <worldbody>"))?;
    if let Some(group) = world.descendants().find(|node| is_group(*node)) {
        let reason = "parts of a robot in it are not read; MuJoCo's `compile` writes a file without it";
        return Err(element_error(group, reason));
    }
    let mut robot = Robot {
        settings,
        links: Vec::new(),
        joints: Vec::new(),
    };
    let bodies: Vec<Node<'_, '_>> = world
        .children()
        .filter(|node| node.has_tag_name("body"))
        .collect();
    let [body] = bodies[..] else {
        let reason = format!("it has {} bodies; a robot is one", bodies.len());
        return Err(element_error(world, &reason));
    };
    robot.walk(body)?;
    robot.follow(root)?;
    let name = root.attribute("model").unwrap_or("robot").to_owned();
    Ok((name, robot.links, robot.joints))
}

/// Whether an element stands around parts of a robot, or in their place, and is no body.
fn is_group(element: Node<'_, '_>) -> bool {
    let tag = |node: Node<'_, '_>| node.tag_name().name().to_owned();
    if !matches!(&*tag(element), "frame" | "replicate" | "attach") {
        return false;
    }
    // Those of lights and of the floor move nothing.
    let is_in_body = element.ancestors().any(|node| node.has_tag_name("body"));
    element.descendants().any(|node| match &*tag(node) {
        "attach" | "body" | "joint" | "freejoint" => true,
        "geom" => is_in_body,
        _ => false,
    })
}

impl<'a, 'input> Settings<'a, 'input> {
    fn of(root: Node<'a, 'input>) -> Result<Self, DescriptionError> {
        let compiler = child(root, "compiler");
        let attribute = |name: &str| compiler.and_then(|compiler| compiler.attribute(name));
        if attribute("coordinate") == Some("global") {
            return Err(element_error(
                root,
                "coordinate=\"global\" is not read; MuJoCo dropped it in 2.3",
            ));
        }
        let mut classes = HashMap::new();
        let mut open: Vec<(Node<'_, '_>, Option<String>)> = root
            .children()
            .filter(|node| node.has_tag_name("default"))
            .map(|node| (node, None))
            .collect();
        while let Some((element, around)) = open.pop() {
            let name = element.attribute("class").unwrap_or("main").to_owned();
            let inside = element.children().filter(|node| node.has_tag_name("default"));
            open.extend(inside.map(|node| (node, Some(name.clone()))));
            classes.insert(name, Class { element, around });
        }
        Ok(Self {
            degrees: attribute("angle") != Some("radian"),
            autolimits: attribute("autolimits") != Some("false"),
            euler: attribute("eulerseq").unwrap_or("xyz").to_owned(),
            classes,
        })
    }

    /// An attribute of an element, or of its class, or of those around that.
    fn attribute(&self, element: Node<'a, 'input>, class: Option<&str>, name: &str) -> Option<&'a str> {
        if let Some(value) = element.attribute(name) {
            return Some(value);
        }
        let mut at = element.attribute("class").or(class).unwrap_or("main").to_owned();
        // Classes do not nest deeper than there are classes.
        for _ in 0..=self.classes.len() {
            let class = self.classes.get(&at)?;
            let tag = element.tag_name().name();
            if let Some(value) = child(class.element, tag).and_then(|of| of.attribute(name)) {
                return Some(value);
            }
            at = class.around.clone()?;
        }
        None
    }

    fn radians(&self, angle: f64) -> f64 {
        if self.degrees { angle.to_radians() } else { angle }
    }

    /// The place and rotation of a body or a shape.
    fn frame(&self, element: Node<'a, 'input>) -> Result<(DVec3, DQuat), DescriptionError> {
        let place = DVec3::from(numbers::<3>(element, "pos", "0 0 0")?);
        let wrong = |reason: &str| element_error(element, reason);
        let turn = if element.has_attribute("quat") {
            let [w, x, y, z] = numbers::<4>(element, "quat", "")?;
            let length = DQuat::from_xyzw(x, y, z, w);
            match length.length() > 1e-6 {
                true => length.normalize(),
                false => return Err(wrong("quat has no length")),
            }
        } else if element.has_attribute("euler") {
            let angles = numbers::<3>(element, "euler", "")?;
            let mut turn = DQuat::IDENTITY;
            for (letter, angle) in self.euler.chars().zip(angles) {
                let axis = match letter.to_ascii_lowercase() {
                    'x' => DVec3::X,
                    'y' => DVec3::Y,
                    _ => DVec3::Z,
                };
                let step = DQuat::from_axis_angle(axis, self.radians(angle));
                // Small letters turn about the body's own axes, capitals about fixed ones.
                turn = if letter.is_lowercase() {
                    turn * step
                } else {
                    step * turn
                };
            }
            turn
        } else if element.has_attribute("axisangle") {
            let [x, y, z, angle] = numbers::<4>(element, "axisangle", "")?;
            let axis = DVec3::new(x, y, z).try_normalize();
            let axis = axis.ok_or_else(|| wrong("axisangle has an axis without length"))?;
            DQuat::from_axis_angle(axis, self.radians(angle))
        } else if element.has_attribute("zaxis") {
            let axis = DVec3::from(numbers::<3>(element, "zaxis", "")?).try_normalize();
            DQuat::from_rotation_arc(DVec3::Z, axis.ok_or_else(|| wrong("zaxis has no length"))?)
        } else if element.has_attribute("xyaxes") {
            let [a, b, c, d, e, f] = numbers::<6>(element, "xyaxes", "")?;
            let x = DVec3::new(a, b, c).try_normalize();
            let x = x.ok_or_else(|| wrong("xyaxes has an axis without length"))?;
            let y = DVec3::new(d, e, f);
            let y = (y - y.dot(x) * x).try_normalize();
            let y = y.ok_or_else(|| wrong("xyaxes has parallel axes"))?;
            DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
        } else {
            DQuat::IDENTITY
        };
        Ok((place, turn))
    }
}

/// A robot that is being read.
struct Robot<'a, 'input> {
    settings: Settings<'a, 'input>,
    links: Vec<Link>,
    joints: Vec<DescribedJoint>,
}

impl<'a, 'input> Robot<'a, 'input> {
    /// Reads a body and all inside it, depth first, without recursion.
    fn walk(&mut self, body: Node<'a, 'input>) -> Result<(), DescriptionError> {
        let mut open = vec![(body, None::<usize>, None::<String>)];
        while let Some((body, parent, class)) = open.pop() {
            let class = body.attribute("childclass").map(str::to_owned).or(class);
            let link = self.body(body, parent, class.as_deref())?;
            let inside: Vec<_> = body.children().filter(|node| node.has_tag_name("body")).collect();
            open.extend(
                inside
                    .into_iter()
                    .rev()
                    .map(|node| (node, Some(link), class.clone())),
            );
        }
        Ok(())
    }

    /// Adds a body's links and joints. A body with several hinges has a link for each.
    fn body(
        &mut self,
        body: Node<'a, 'input>,
        parent: Option<usize>,
        class: Option<&str>,
    ) -> Result<usize, DescriptionError> {
        let name = body
            .attribute("name")
            .map_or_else(|| format!("body_{}", self.links.len()), str::to_owned);
        let (place, turn) = self.settings.frame(body)?;
        let hinges: Vec<Node<'_, '_>> = body
            .children()
            .filter(|node| node.has_tag_name("joint"))
            .collect();
        let mut at = parent;
        let mut frame = (place, turn);
        if let Some(above) = parent {
            for (nth, &hinge) in hinges.iter().enumerate() {
                // Where a joint of the body stands away from its origin, the links before it do
                // too.
                let joint = self.hinge(hinge, class, above, frame)?;
                let is_last = nth + 1 == hinges.len();
                self.links.push(Link {
                    name: if is_last {
                        name.clone()
                    } else {
                        format!("{name}_{nth}")
                    },
                    ..Link::default()
                });
                let child = self.links.len() - 1;
                self.joints.push(DescribedJoint {
                    parent: at.unwrap_or(above),
                    child,
                    ..joint
                });
                at = Some(child);
                frame = (DVec3::ZERO, DQuat::IDENTITY);
            }
        }
        if parent.is_none() || hinges.is_empty() {
            self.links.push(Link {
                name: name.clone(),
                ..Link::default()
            });
            let child = self.links.len() - 1;
            if let Some(parent) = parent {
                self.joints.push(DescribedJoint {
                    name: format!("{name}_fixed"),
                    kind: Kind::Fixed,
                    parent,
                    child,
                    place,
                    turn,
                    axis: DVec3::X,
                    lower_rad: 0.0,
                    upper_rad: 0.0,
                    max_speed_rad_per_s: 0.0,
                    follows: None,
                });
            } else if hinges
                .iter()
                .any(|hinge| self.settings.attribute(*hinge, class, "type") != Some("free"))
            {
                let reason = "the robot's first body has a hinge: only a free joint may carry it";
                return Err(element_error(body, reason));
            }
            at = Some(child);
        }
        let link = at.unwrap_or(0);
        for geom in body.children().filter(|node| node.has_tag_name("geom")) {
            let shape = self.shape(geom, class)?;
            self.links[link].shapes.extend(shape);
        }
        Ok(link)
    }

    fn hinge(
        &self,
        element: Node<'a, 'input>,
        class: Option<&str>,
        parent: usize,
        (place, turn): (DVec3, DQuat),
    ) -> Result<DescribedJoint, DescriptionError> {
        let settings = &self.settings;
        let attribute = |name: &str| settings.attribute(element, class, name);
        let wrong = |reason: &str| element_error(element, reason);
        match attribute("type").unwrap_or("hinge") {
            "hinge" => {}
            other => return Err(wrong(&format!("type {other:?} below the root; allowed: hinge"))),
        }
        let list = |text: Option<&str>, default: &[f64]| -> Result<Vec<f64>, DescriptionError> {
            let Some(text) = text else {
                return Ok(default.to_vec());
            };
            let found: Option<Vec<f64>> = text
                .split_whitespace()
                .map(|word| word.parse().ok().filter(|n: &f64| n.is_finite()))
                .collect();
            found
                .filter(|found| found.len() == default.len())
                .ok_or_else(|| wrong(&format!("{text:?} must be {} finite numbers", default.len())))
        };
        let axis = list(attribute("axis"), &[0.0, 0.0, 1.0])?;
        let at = list(attribute("pos"), &[0.0; 3])?;
        if at.iter().any(|n| n.abs() > 1e-9) {
            return Err(wrong(
                "a joint that stands beside its body's origin is not read; move the body there",
            ));
        }
        let rest = list(attribute("ref"), &[0.0])?;
        if rest[0] != 0.0 {
            return Err(wrong(
                "ref other than 0 is not read: the body must stand at angle 0",
            ));
        }
        let range = list(attribute("range"), &[0.0; 2])?;
        let is_limited = match attribute("limited") {
            Some("true") => true,
            Some("false") => false,
            _ if range[0] == range[1] => false,
            _ if settings.autolimits => true,
            _ => {
                return Err(wrong(
                    "with autolimits=\"false\", limited must say whether the range counts",
                ));
            }
        };
        let (lower_rad, upper_rad) = match is_limited {
            true => (settings.radians(range[0]), settings.radians(range[1])),
            false => (-std::f64::consts::PI, std::f64::consts::PI),
        };
        if lower_rad >= upper_rad {
            return Err(wrong(&format!("its range {:?} does not rise", &range)));
        }
        Ok(DescribedJoint {
            name: element.attribute("name").unwrap_or_default().to_owned(),
            kind: Kind::Hinge,
            parent,
            child: 0,
            place,
            turn,
            axis: DVec3::from_slice(&axis)
                .try_normalize()
                .ok_or_else(|| wrong("its axis has no length"))?,
            lower_rad,
            upper_rad,
            max_speed_rad_per_s: 0.0,
            follows: None,
        })
    }

    /// A body's shape; none for a mesh, a plane, or one of another kind.
    fn shape(&self, geom: Node<'a, 'input>, class: Option<&str>) -> Result<Option<Shape>, DescriptionError> {
        let attribute = |name: &str| self.settings.attribute(geom, class, name);
        // What touches nothing is for the eye.
        if attribute("contype") == Some("0") && attribute("conaffinity") == Some("0") {
            return Ok(None);
        }
        let (mut place, mut turn) = self.settings.frame(geom)?;
        let size: Vec<f64> = attribute("size")
            .unwrap_or_default()
            .split_whitespace()
            .filter_map(|word| word.parse().ok().filter(|n: &f64| n.is_finite()))
            .collect();
        let mut half_length = size.get(1).copied().unwrap_or(0.0);
        if geom.has_attribute("fromto") {
            let [a, b, c, d, e, f] = numbers::<6>(geom, "fromto", "")?;
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            place = 0.5 * (from + to);
            half_length = 0.5 * from.distance(to);
            turn = (to - from)
                .try_normalize()
                .map_or(DQuat::IDENTITY, |to| DQuat::from_rotation_arc(DVec3::Z, to));
        }
        let solid = match (attribute("type").unwrap_or("sphere"), &size[..]) {
            ("sphere", [radius, ..]) => Solid::Sphere { radius: *radius },
            ("capsule" | "cylinder", [radius, ..]) => Solid::Cylinder {
                radius: *radius,
                half_length,
            },
            ("box", [x, y, z]) => Solid::Box {
                half: DVec3::new(*x, *y, *z),
            },
            _ => return Ok(None),
        };
        Ok(Some(Shape { solid, place, turn }))
    }

    /// Joints that an equality binds to another's angle.
    fn follow(&mut self, root: Node<'a, 'input>) -> Result<(), DescriptionError> {
        let equalities = root.children().filter(|node| node.has_tag_name("equality"));
        let bound = equalities
            .flat_map(|node| node.children())
            .filter(|node| node.has_tag_name("joint"));
        for element in bound {
            let (Some(first), Some(second)) = (element.attribute("joint1"), element.attribute("joint2"))
            else {
                continue;
            };
            if element.attribute("active") == Some("false") {
                continue;
            }
            let [offset_rad, multiplier, more @ ..] = numbers::<5>(element, "polycoef", "0 1 0 0 0")?;
            if more.iter().any(|n| *n != 0.0) {
                return Err(element_error(element, "polycoef of a degree above 1 is not read"));
            }
            if let Some(joint) = self.joints.iter_mut().find(|joint| joint.name == first) {
                joint.follows = Some(Follows {
                    joint: second.to_owned(),
                    multiplier,
                    offset_rad,
                });
            }
        }
        Ok(())
    }
}
