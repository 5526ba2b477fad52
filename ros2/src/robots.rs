//! The robots of a node, from the command line or a TOML file.

use std::str::FromStr;

use serde::Deserialize;
use toml::Spanned;

use crate::body::Place;

/// Robots of one node.
const MAX_ROBOTS: usize = 32;
/// Characters of a name.
const MAX_NAME: usize = 32;
/// How far from the origin a robot may start, metres.
const MAX_START_M: f32 = 1000.0;

/// A robot, which is a namespace in ROS and a session on the server.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Robot {
    /// Its namespace, without slashes.
    pub(crate) name: String,
    /// Pack that moves it.
    pub(crate) pack: String,
    /// Body of the pack. Empty: the pack's own, or its first.
    pub(crate) body: String,
    /// First style. Empty: the pack's.
    pub(crate) style: String,
    /// Where it stands at first: X and Y in metres, heading in radians.
    pub(crate) start: [f32; 3],
    /// What the names of its joints end with in its URDF. Packs leave that out.
    pub(crate) joint_suffix: String,
}

/// What a TOML file holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Fleet {
    /// Address of the server.
    pub(crate) server: Option<String>,
    /// Frames a second.
    pub(crate) rate: Option<u32>,
    /// Whether stamps come from `/clock`.
    pub(crate) use_sim_time: Option<bool>,
    /// The robots, at least one.
    pub(crate) robots: Vec<Robot>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    server: Option<String>,
    rate: Option<u32>,
    use_sim_time: Option<bool>,
    #[serde(default)]
    robot: Vec<Spanned<Entry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    pack: Option<String>,
    #[serde(default)]
    body: String,
    #[serde(default)]
    style: String,
    #[serde(default)]
    start: [f32; 3],
    joint_suffix: Option<String>,
}

impl FromStr for Robot {
    type Err = String;

    /// Reads `NAME`, `NAME:PACK` or `NAME:PACK/BODY`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (name, of) = text.split_once(':').unwrap_or((text, "g1"));
        let (pack, body) = of.split_once('/').unwrap_or((of, ""));
        let entry = Entry {
            name: name.to_owned(),
            pack: Some(pack.to_owned()),
            body: body.to_owned(),
            style: String::new(),
            start: [0.0; 3],
            joint_suffix: None,
        };
        entry.robot()
    }
}

impl Robot {
    /// A G1 without a file.
    pub(crate) fn g1() -> Self {
        Self {
            name: "g1".to_owned(),
            pack: "g1".to_owned(),
            body: String::new(),
            style: String::new(),
            start: [0.0; 3],
            joint_suffix: "_joint".to_owned(),
        }
    }

    pub(crate) fn start(&self) -> Place {
        let [x, y, heading] = self.start;
        Place { x, y, heading }
    }
}

/// Checks the number of robots, and that no two have one name.
///
/// # Errors
/// A sentence.
pub(crate) fn check(robots: &[Robot]) -> Result<(), String> {
    let twice = |(nth, robot): (usize, &Robot)| robots[..nth].iter().any(|other| other.name == robot.name);
    if let Some(nth) = (0..robots.len()).find(|&nth| twice((nth, &robots[nth]))) {
        return Err(format!("two robots have the name {:?}", robots[nth].name));
    }
    match robots.len() {
        1..=MAX_ROBOTS => Ok(()),
        count => Err(format!("{count} robots; allowed: 1 to {MAX_ROBOTS}")),
    }
}

impl Fleet {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// A sentence with the line at fault.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let file = toml::from_str::<File>(text).map_err(|e| e.to_string().trim_end().to_owned())?;
        let mut robots = Vec::with_capacity(file.robot.len());
        for spanned in file.robot {
            let before = text.get(..spanned.span().start).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            let robot = spanned.into_inner().robot();
            robots.push(robot.map_err(|why| format!("line {line}: {why}"))?);
        }
        check(&robots)?;
        Ok(Self {
            server: file.server,
            rate: file.rate,
            use_sim_time: file.use_sim_time,
            robots,
        })
    }
}

impl Entry {
    fn robot(self) -> Result<Robot, String> {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let starts = self.name.starts_with(|c: char| c.is_ascii_alphabetic());
        let doubled = self.name.contains("__") || self.name.len() > MAX_NAME;
        if !starts || doubled || !self.name.chars().all(is_word) {
            return Err(format!(
                "name is {:?}; allowed: up to {MAX_NAME} letters, digits and single _, a letter first",
                self.name
            ));
        }
        let [x, y, heading] = self.start;
        let near = x.abs() <= MAX_START_M && y.abs() <= MAX_START_M;
        if !near || !heading.is_finite() {
            return Err(format!(
                "start is {:?}; allowed: X and Y within {MAX_START_M} m, and a heading in radians",
                self.start
            ));
        }
        Ok(Robot {
            name: self.name,
            pack: self.pack.unwrap_or_else(|| "g1".to_owned()),
            body: self.body,
            style: self.style,
            start: self.start,
            joint_suffix: self.joint_suffix.unwrap_or_else(|| "_joint".to_owned()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = r#"server = "http://10.0.0.2:8080"
rate = 30
use_sim_time = true

[[robot]]
name = "left"
style = "slow"
start = [0, 1.5, 1.57]

[[robot]]
name = "right"
pack = "unimogen"
body = "h1"
joint_suffix = ""
"#;

    #[test]
    fn a_file_has_robots() {
        let fleet = Fleet::parse(TWO).unwrap();
        assert_eq!(fleet.server.as_deref(), Some("http://10.0.0.2:8080"));
        assert_eq!((fleet.rate, fleet.use_sim_time), (Some(30), Some(true)));
        let [left, right] = fleet.robots.as_slice() else {
            panic!("{fleet:?}")
        };
        assert_eq!((left.pack.as_str(), left.style.as_str()), ("g1", "slow"));
        assert_eq!(left.start, [0.0, 1.5, 1.57]);
        assert_eq!(left.joint_suffix, "_joint");
        assert_eq!((right.pack.as_str(), right.body.as_str()), ("unimogen", "h1"));
        assert_eq!(right.joint_suffix, "");
    }

    #[test]
    fn a_robot_of_the_command_line_has_pack_and_body() {
        let of = |text: &str| {
            let robot: Robot = text.parse().unwrap();
            (robot.name, robot.pack, robot.body)
        };
        let words = |a: &str, b: &str, c: &str| (a.to_owned(), b.to_owned(), c.to_owned());
        assert_eq!(of("one"), words("one", "g1", ""));
        assert_eq!(of("one:mine"), words("one", "mine", ""));
        assert_eq!(of("one:unimogen/h1"), words("one", "unimogen", "h1"));
        assert_eq!("g1".parse::<Robot>().unwrap(), Robot::g1());
    }

    #[test]
    fn errors_name_their_line() {
        for (text, wanted) in [
            ("", "0 robots; allowed: 1 to 32"),
            (
                &*TWO.replace("right", "left"),
                "two robots have the name \"left\"",
            ),
            (&TWO.replace("right", "a b"), "line 10: name is \"a b\""),
            (&TWO.replace("right", "a__b"), "line 10: name is \"a__b\""),
            (&TWO.replace("right", "1st"), "line 10: name is \"1st\""),
            (&TWO.replace("1.5,", "1e9,"), "line 5: start is"),
            (&TWO.replace("1.57", "nan"), "line 5: start is"),
            (&TWO.replace("style", "stile"), "stile"),
        ] {
            let why = Fleet::parse(text).unwrap_err();
            assert!(why.contains(wanted), "{wanted}: {why}");
        }
    }
}
