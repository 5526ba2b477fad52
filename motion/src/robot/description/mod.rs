//! Robots as their makers describe them: URDF and MJCF. [`read`] parses a file, and [`build`] makes
//! the skeleton with hinges of it.
//!
//! Descriptions are in ROS axes (X ahead, Y left, Z up), metres and radians.

mod build;
mod mjcf;
mod parts;
#[cfg(test)]
mod tests;
mod urdf;

pub use build::{BuildOptions, Built, build};

use glam::{DQuat, DVec3};

use crate::skeleton::MAX_NAME_BYTES;

/// Most links of a robot.
pub const MAX_LINKS: usize = 2048;
/// How much of a name that is too long an error shows, characters.
const SHOWN_CHARS: usize = 32;

/// Why a description was not read or does not make a robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// The text is not XML.
    #[error("no XML: {0}")]
    Xml(String),
    /// The file is neither URDF nor MJCF.
    #[error("the root element is <{0}>; a URDF's is <robot>, an MJCF's <mujoco>")]
    Root(String),
    /// An element cannot be used.
    #[error("line {line}, {what}: {reason}")]
    Element {
        /// Line of the element, from 1.
        line: u32,
        /// The element with its name: `joint left_knee_joint`.
        what: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The links do not make one tree.
    #[error("{0}")]
    Tree(String),
    /// The robot lacks something, with the option that gives it.
    #[error("{0}")]
    Body(String),
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Fixed,
    Hinge,
    Floating,
}

/// An angle that another hinge's angle gives: `multiplier * angle + offset_rad`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Follows {
    pub(crate) joint: String,
    pub(crate) multiplier: f64,
    pub(crate) offset_rad: f64,
}

/// A joint: where its link stands in the parent link at angle 0, and how it turns there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DescribedJoint {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) parent: usize,
    pub(crate) child: usize,
    pub(crate) place: DVec3,
    pub(crate) turn: DQuat,
    /// Unit length, in the child link.
    pub(crate) axis: DVec3,
    pub(crate) lower_rad: f64,
    pub(crate) upper_rad: f64,
    /// 0 if the file gives none.
    pub(crate) max_speed_rad_per_s: f64,
    pub(crate) follows: Option<Follows>,
}

/// A solid of a link, as points that hold its extremes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Solid {
    Sphere {
        radius: f64,
    },
    /// Half of the edges.
    Box {
        half: DVec3,
    },
    /// Along Z.
    Cylinder {
        radius: f64,
        half_length: f64,
    },
    Points(Vec<DVec3>),
}

/// A solid where it stands in its link.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    pub(crate) solid: Solid,
    pub(crate) place: DVec3,
    pub(crate) turn: DQuat,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) shapes: Vec<Shape>,
    /// The box of even density with the link's mass and inertia.
    pub(crate) inertia: Option<Shape>,
}

/// A robot as its maker describes it: a tree of links.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    /// In the file's order.
    pub(crate) joints: Vec<DescribedJoint>,
    /// The link that is no joint's child.
    pub(crate) root: usize,
}

/// Reads a URDF or an MJCF. `beside` gives the bytes of meshes by the name that the file has for
/// them; those that are not to be had are left out.
///
/// # Errors
/// [`DescriptionError`], with the line and the element.
pub fn read(text: &str, beside: &dyn Fn(&str) -> Option<Vec<u8>>) -> Result<Description, DescriptionError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let xml = roxmltree::Document::parse(text).map_err(|e| DescriptionError::Xml(e.to_string()))?;
    let root = xml.root_element();
    let (name, links, joints) = match root.tag_name().name() {
        "robot" => urdf::read(root, beside)?,
        "mujoco" => mjcf::read(root)?,
        other => return Err(DescriptionError::Root(other.to_owned())),
    };
    Description::new(name, links, joints)
}

impl Description {
    /// Checks that the links make one tree.
    fn new(name: String, links: Vec<Link>, joints: Vec<DescribedJoint>) -> Result<Self, DescriptionError> {
        let tree = |text: String| Err(DescriptionError::Tree(text));
        if links.len() > MAX_LINKS {
            return tree(format!("{} links; at most {MAX_LINKS} are read", links.len()));
        }
        let names = links.iter().map(|link| &link.name);
        let mut names = names.chain(joints.iter().map(|joint| &joint.name));
        if let Some(name) = names.find(|name| name.len() > MAX_NAME_BYTES) {
            let start: String = name.chars().take(SHOWN_CHARS).collect();
            return tree(format!(
                "the name \"{}…\" is {} bytes long; allowed: up to {MAX_NAME_BYTES} bytes",
                start.escape_debug(),
                name.len()
            ));
        }
        let mut above = vec![None; links.len()];
        for (nth, joint) in joints.iter().enumerate() {
            if above[joint.child].replace(nth).is_some() {
                return tree(format!(
                    "link {:?} hangs on more than one joint",
                    links[joint.child].name
                ));
            }
        }
        let roots: Vec<usize> = (0..links.len()).filter(|&link| above[link].is_none()).collect();
        let [root] = roots[..] else {
            let names: Vec<&str> = roots.iter().map(|&link| &*links[link].name).collect();
            return tree(format!(
                "a tree has one root link; this has {}: {}",
                roots.len(),
                names.join(", ")
            ));
        };
        let description = Self {
            name,
            links,
            joints,
            root,
        };
        let reached = description.below(root).len();
        match reached == description.links.len() {
            true => Ok(description),
            false => tree("some joints form a ring".to_owned()),
        }
    }

    /// The joints on a link, in the file's order.
    pub(crate) fn on(&self, link: usize) -> impl Iterator<Item = &DescribedJoint> {
        self.joints.iter().filter(move |joint| joint.parent == link)
    }

    /// A link and all that hang on it.
    fn below(&self, link: usize) -> Vec<usize> {
        let mut found = vec![link];
        let mut at = 0;
        while let Some(&link) = found.get(at) {
            found.extend(self.on(link).map(|joint| joint.child));
            at += 1;
        }
        found
    }
}

impl Shape {
    /// Points that hold the extremes of the shape, and its lowest in a direction.
    pub(crate) fn surface(&self, down: DVec3) -> Vec<DVec3> {
        let local = match &self.solid {
            Solid::Sphere { radius } => return vec![self.place + *radius * down],
            Solid::Box { half } => (0..8)
                .map(|corner| {
                    let sign = |bit: i32| if corner & bit == 0 { -1.0 } else { 1.0 };
                    *half * DVec3::new(sign(1), sign(2), sign(4))
                })
                .collect(),
            Solid::Cylinder { radius, half_length } => (0..64)
                .map(|nth| {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(nth / 2) / 32.0).sin_cos();
                    let end = if nth % 2 == 0 { -half_length } else { *half_length };
                    DVec3::new(radius * cos, radius * sin, end)
                })
                .collect(),
            Solid::Points(points) => points.clone(),
        };
        local
            .into_iter()
            .map(|point| self.place + self.turn * point)
            .collect()
    }
}
