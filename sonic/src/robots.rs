//! The robots of a bridge, from a TOML file.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use glam::Vec3;
use serde::Deserialize;
use toml::Spanned;
use troupe_client::LivePath;

/// Port of the first robot, which the controller connects to by default.
pub const PORT: u16 = 5556;
/// Robots of one bridge.
const MAX_ROBOTS: usize = 100;
/// Points of a route.
const MAX_POINTS: usize = 1024;

/// A G1, the port for it, and its route.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// What orders call it.
    pub name: String,
    /// Address on this machine that the robot connects to.
    pub listen: SocketAddr,
    /// Address of the robot's own words, such as `192.168.1.20:5557`.
    pub feedback: Option<String>,
    /// First style. None: the pack's.
    pub style: Option<String>,
    /// The route that `go` follows.
    pub route: Option<LivePath>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// Address to listen on. Default: all of the machine.
    listen: Option<IpAddr>,
    #[serde(default)]
    robot: Vec<Spanned<Entry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    port: u16,
    feedback: Option<String>,
    style: Option<String>,
    #[serde(default)]
    route: Vec<[f32; 2]>,
    speed: Option<f32>,
    #[serde(default)]
    r#loop: bool,
}

impl Robot {
    /// A robot without a file, on the default port.
    pub fn one() -> Self {
        Self {
            name: "g1".to_owned(),
            listen: (Ipv4Addr::UNSPECIFIED, PORT).into(),
            feedback: None,
            style: None,
            route: None,
        }
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// A sentence with the line at fault.
    pub fn parse(text: &str) -> Result<Vec<Self>, String> {
        let file = toml::from_str::<File>(text).map_err(|e| e.to_string().trim_end().to_owned())?;
        let address = file.listen.unwrap_or(Ipv4Addr::UNSPECIFIED.into());
        let mut robots = Vec::<Self>::with_capacity(file.robot.len());
        for spanned in file.robot {
            let line = text.get(..spanned.span().start).unwrap_or_default();
            let line = line.matches('\n').count() + 1;
            let robot = spanned
                .into_inner()
                .robot(address)
                .and_then(|robot| match robots.iter().find(|other| other.clashes(&robot)) {
                    Some(other) => Err(format!("{} has the same name or port", other.name)),
                    None => Ok(robot),
                })
                .map_err(|why| format!("line {line}: {why}"))?;
            robots.push(robot);
        }
        match robots.len() {
            0 => Err("there is no [[robot]] in it".to_owned()),
            count if count > MAX_ROBOTS => Err(format!("{count} robots; at most {MAX_ROBOTS}")),
            _ => Ok(robots),
        }
    }

    fn clashes(&self, other: &Self) -> bool {
        self.name == other.name || (self.listen.port() != 0 && self.listen.port() == other.listen.port())
    }
}

impl Entry {
    fn robot(self, address: IpAddr) -> Result<Robot, String> {
        let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if !self.name.starts_with(|c: char| c.is_ascii_alphanumeric()) || !self.name.chars().all(is_word) {
            return Err(format!(
                "name is {:?}; allowed: letters, digits, -, _ and .",
                self.name
            ));
        }
        if crate::order::is_verb(&self.name) {
            return Err(format!("name is {:?}, which is an order", self.name));
        }
        let route = match self.route.len() {
            0 if self.speed.is_some() || self.r#loop => {
                return Err("speed and loop need a route".to_owned());
            }
            0 => None,
            1 => return Err("route has one point, but must have two or more".to_owned()),
            count if count > MAX_POINTS => {
                return Err(format!("route has {count} points; at most {MAX_POINTS}"));
            }
            _ => Some(LivePath {
                speed: self.speed,
                is_loop: self.r#loop,
                ..LivePath::through(self.route.iter().map(|&[x, y]| on_ground(x, y)))
            }),
        };
        Ok(Robot {
            name: self.name,
            listen: (address, self.port).into(),
            feedback: self.feedback,
            style: self.style,
            route,
        })
    }
}

/// A place or velocity of a robot, X ahead and Y to the left, in the axes of sessions.
pub(crate) fn on_ground(x: f32, y: f32) -> Vec3 {
    Vec3::new(y, 0.0, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = r#"
listen = "127.0.0.1"
[[robot]]
name = "one"
port = 5556
feedback = "127.0.0.1:5557"
route = [[0, 0], [3, 0], [3.0, 2.5]]
speed = 0.8
loop = true

[[robot]]
name = "two"
port = 5558
style = "slow"
"#;

    #[test]
    fn a_file_has_robots() {
        let robots = Robot::parse(TWO).unwrap();
        let [one, two] = robots.as_slice() else {
            panic!("{robots:?}")
        };
        assert_eq!(one.listen.to_string(), "127.0.0.1:5556");
        let route = one.route.as_ref().unwrap();
        assert_eq!((route.speed, route.is_loop), (Some(0.8), true));
        // Ahead is +Z of a session, left is +X.
        assert_eq!(route.points[2].position, Vec3::new(2.5, 0.0, 3.0));
        assert_eq!((two.style.as_deref(), &two.route), (Some("slow"), &None));
        assert_eq!(Robot::one().listen.to_string(), "0.0.0.0:5556");
    }

    #[test]
    fn errors_name_their_line() {
        for (text, wanted) in [
            ("", "no [[robot]]"),
            (&TWO.replace("5558", "5556"), "line 11: one has the same"),
            (
                &TWO.replace("\"two\"", "\"stop\""),
                "line 11: name is \"stop\", which is an order",
            ),
            (&TWO.replace("\"two\"", "\"a b\""), "line 11: name is"),
            (
                &TWO.replace("[3, 0], [3.0, 2.5]", ""),
                "line 3: route has one point",
            ),
            (
                &TWO.replace("style = \"slow\"", "speed = 1.0"),
                "line 11: speed and loop",
            ),
            (&TWO.replace("style", "stile"), "stile"),
        ] {
            let why = Robot::parse(text).unwrap_err();
            assert!(why.contains(wanted), "{wanted}: {why}");
        }
    }
}
