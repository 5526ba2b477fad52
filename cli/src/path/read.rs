//! The file's form, and its checks.

use std::path::Path as FilePath;

use glam::Vec2;
use serde::Deserialize;
use toml::Spanned;
use troupe_client::{Act, Performance};

use super::script::{Manner, Moment, Motion, Path, Timed, Waypoint, When};
use crate::failure::Failure;

/// Faster than anybody runs, m/s.
const MAX_SPEED_MPS: f32 = 20.0;
/// Farther than a path goes, metres.
const MAX_PLACE_M: f32 = 1000.0;
/// Longest path, seconds.
const MAX_TIME_S: f32 = 3600.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    title: Option<String>,
    pack: Option<String>,
    style: Option<String>,
    scene: Option<String>,
    #[serde(default)]
    seed: u64,
    seconds: Option<Spanned<f32>>,
    start: Option<Spanned<Vec<f32>>>,
    heading_deg: Option<Spanned<f32>>,
    #[serde(default)]
    command: Vec<Spanned<CommandEntry>>,
    #[serde(default)]
    waypoint: Vec<Spanned<WaypointEntry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandEntry {
    time_s: Option<Spanned<f32>>,
    wait_s: Option<Spanned<f32>>,
    after: Option<Spanned<String>>,
    interact: Option<String>,
    skill: Option<String>,
    variant: Option<Spanned<String>>,
    approach: Option<Spanned<String>>,
    #[serde(default)]
    end: bool,
    #[serde(default)]
    cancel: bool,
    #[serde(default)]
    drop: bool,
    perform: Option<String>,
    velocity: Option<Spanned<Vec<f32>>>,
    speed: Option<Spanned<f32>>,
    direction_deg: Option<Spanned<f32>>,
    facing_deg: Option<Spanned<f32>>,
    style: Option<String>,
    gait: Option<String>,
    height_m: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WaypointEntry {
    at: Spanned<Vec<f32>>,
    speed: Option<Spanned<f32>>,
    wait_s: Option<Spanned<f32>>,
    facing_deg: Option<Spanned<f32>>,
    style: Option<String>,
    gait: Option<String>,
    height_m: Option<Spanned<f32>>,
}

impl Path {
    /// Reads a file.
    pub(crate) fn read(path: &FilePath) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
        let mut read = Self::parse(&text).map_err(|why| Failure::file(path, why))?;
        if read.title.is_none() {
            read.title = path.file_stem().map(|name| name.to_string_lossy().into_owned());
        }
        Ok(read)
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// A sentence with the line and field at fault.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let file = toml::from_str::<File>(text).map_err(|e| e.to_string().trim_end().to_owned())?;
        Check { text }.path(&file)
    }
}

/// Finds the line of what is wrong.
pub(super) struct Check<'a> {
    pub(super) text: &'a str,
}

impl Check<'_> {
    pub(super) fn fault<T>(&self, at: &Spanned<T>, what: impl std::fmt::Display) -> String {
        let before = self.text.get(..at.span().start).unwrap_or_default();
        format!("line {}: {what}", before.matches('\n').count() + 1)
    }

    /// The path of a file, or of a part of one.
    pub(super) fn path(&self, file: &File) -> Result<Path, String> {
        let seconds = self.number("seconds", file.seconds.as_ref(), 0.1, MAX_TIME_S)?;
        let heading = self.angle("heading_deg", file.heading_deg.as_ref())?;
        let path = Path {
            title: file.title.clone(),
            pack: file.pack.clone(),
            style: file.style.clone(),
            scene: file.scene.clone(),
            seed: file.seed,
            start: file
                .start
                .as_ref()
                .map(|start| self.place("start", start))
                .transpose()?
                .unwrap_or_default(),
            heading: heading.unwrap_or_default(),
            seconds,
            commands: self.commands(&file.command, !file.waypoint.is_empty())?,
            waypoints: self.waypoints(&file.waypoint)?,
        };
        if path.commands.is_empty() && path.waypoints.is_empty() {
            return Err("there is neither a [[command]] nor a [[waypoint]] in it".to_owned());
        }
        Ok(path)
    }

    fn number(
        &self,
        field: &str,
        value: Option<&Spanned<f32>>,
        least: f32,
        most: f32,
    ) -> Result<Option<f32>, String> {
        let Some(spanned) = value else { return Ok(None) };
        let number = *spanned.get_ref();
        if !(least..=most).contains(&number) {
            return Err(self.fault(
                spanned,
                format!("{field} is {number}, but may be {least} to {most}"),
            ));
        }
        Ok(Some(number))
    }

    fn angle(&self, field: &str, value: Option<&Spanned<f32>>) -> Result<Option<f32>, String> {
        Ok(self.number(field, value, -3600.0, 3600.0)?.map(f32::to_radians))
    }

    /// Two numbers that make a vector of a length of at most `most`.
    fn pair(&self, field: &str, value: &Spanned<Vec<f32>>, most: f32, unit: &str) -> Result<Vec2, String> {
        let fault = |what: String| Err(self.fault(value, what));
        let &[x, z] = value.get_ref().as_slice() else {
            let count = value.get_ref().len();
            return fault(format!("{field} has {count} numbers, but must have two: x and z"));
        };
        let pair = Vec2::new(x, z);
        if !pair.is_finite() || pair.length() > most {
            return fault(format!(
                "{field} is {pair}, but may be at most {most} {unit} long"
            ));
        }
        Ok(pair)
    }

    fn place(&self, field: &str, value: &Spanned<Vec<f32>>) -> Result<Vec2, String> {
        self.pair(field, value, MAX_PLACE_M, "m")
    }

    fn commands(
        &self,
        entries: &[Spanned<CommandEntry>],
        with_waypoints: bool,
    ) -> Result<Vec<Timed>, String> {
        let mut commands = Vec::<Timed>::with_capacity(entries.len());
        for spanned in entries {
            let entry = spanned.get_ref();
            let when = self.when(spanned, &commands)?;
            let act = self.act(spanned)?;
            let motion = self.motion(entry)?;
            if with_waypoints && motion != Motion::AsBefore {
                let what = "velocity, speed and direction_deg come from the waypoints if a path has some; a [[command]] may then \
                            set facing_deg, style, gait and height_m, or act";
                return Err(self.fault(spanned, what));
            }
            let manner = Manner {
                facing: self.angle("facing_deg", entry.facing_deg.as_ref())?,
                style: entry.style.clone(),
                gait: entry.gait.clone(),
                height_m: self.number("height_m", entry.height_m.as_ref(), 0.0, 3.0)?,
            };
            if act.is_some() && (motion != Motion::AsBefore || manner != Manner::default()) {
                let what = "interact, skill, end, cancel, drop and perform exclude what says how to move; give that a [[command]] of its \
                            own";
                return Err(self.fault(spanned, what));
            }
            commands.push(Timed {
                when,
                act,
                motion,
                manner,
            });
        }
        Ok(commands)
    }

    /// The time of a command that comes after these.
    fn when(&self, spanned: &Spanned<CommandEntry>, before: &[Timed]) -> Result<When, String> {
        let entry = spanned.get_ref();
        let time_s = self.number("time_s", entry.time_s.as_ref(), 0.0, MAX_TIME_S)?;
        let wait_s = self.number("wait_s", entry.wait_s.as_ref(), 0.0, MAX_TIME_S)?;
        let after = entry
            .after
            .as_ref()
            .map(|after| self.moment(after, before))
            .transpose()?;
        let Some((time_s, at)) = time_s.zip(entry.time_s.as_ref()) else {
            if wait_s.is_none() && after.is_none() {
                return Err(self.fault(spanned, "time_s is missing; or else give after or wait_s"));
            }
            let wait_s = wait_s.unwrap_or_default();
            return Ok(When::Later { wait_s, after });
        };
        if wait_s.is_some() || after.is_some() {
            return Err(self.fault(at, "time_s excludes after and wait_s: it has both"));
        }
        let timed = before.iter().rev().find_map(|command| match command.when {
            When::At(time_s) => Some(time_s),
            When::Later { .. } => None,
        });
        if let Some(before) = timed.filter(|before| *before > time_s) {
            let what = format!("time_s is {time_s}, but the command before is at {before}");
            return Err(self.fault(at, what));
        }
        Ok(When::At(time_s))
    }

    /// What a command waits for that comes after these.
    fn moment(&self, after: &Spanned<String>, before: &[Timed]) -> Result<Moment, String> {
        let interacts =
            |command: &Timed| matches!(command.act, Some(Act::Interact { .. } | Act::Skill { .. }));
        if !before.iter().any(interacts) {
            let what = "after waits for what an interact or a skill before it began, and there is none";
            return Err(self.fault(after, what));
        }
        match after.get_ref().as_str() {
            "held" => Ok(Moment::Held),
            "done" => Ok(Moment::Done),
            other => {
                let what = format!("after is {other:?}, but may be \"held\" or \"done\"");
                Err(self.fault(after, what))
            }
        }
    }

    /// What a command does instead of moving.
    fn act(&self, spanned: &Spanned<CommandEntry>) -> Result<Option<Act>, String> {
        let entry = spanned.get_ref();
        let interact = entry.interact.as_ref().map(|instance| Act::Interact {
            instance: instance.clone(),
            variant: entry.variant.as_ref().map(|name| name.get_ref().clone()),
            approach: entry.approach.as_ref().map(|name| name.get_ref().clone()),
        });
        let skill = entry.skill.as_ref().map(|name| Act::Skill {
            name: name.clone(),
            variant: entry.variant.as_ref().map(|name| name.get_ref().clone()),
        });
        if let Some(value) = &entry.variant
            && interact.is_none()
            && skill.is_none()
        {
            let what = "variant needs interact or skill, which are missing";
            return Err(self.fault(value, what));
        }
        if let Some(value) = entry.approach.as_ref().filter(|_| interact.is_none()) {
            return Err(self.fault(value, "approach needs interact, which is missing"));
        }
        let mut acts = interact.into_iter().chain(skill).chain(
            [
                (entry.end, Act::EndInteraction),
                (entry.cancel, Act::Cancel),
                (entry.drop, Act::Drop),
            ]
            .into_iter()
            .filter_map(|(asked, act)| asked.then_some(act))
            .chain((entry.perform.as_ref()).map(|text| Performance::of(text.as_str()).into())),
        );
        let act = acts.next();
        if acts.next().is_some() {
            let what =
                "interact, skill, end, cancel, drop and perform exclude each other: it has more than one";
            return Err(self.fault(spanned, what));
        }
        Ok(act)
    }

    fn motion(&self, entry: &CommandEntry) -> Result<Motion, String> {
        let speed_mps = self.number("speed", entry.speed.as_ref(), 0.0, MAX_SPEED_MPS)?;
        let direction = self.angle("direction_deg", entry.direction_deg.as_ref())?;
        let Some(velocity) = &entry.velocity else {
            return Ok(match (speed_mps, direction) {
                (None, None) => Motion::AsBefore,
                (speed_mps, direction) => Motion::Polar { speed_mps, direction },
            });
        };
        if speed_mps.is_some() || direction.is_some() {
            let what = "velocity excludes speed and direction_deg: it has both";
            return Err(self.fault(velocity, what));
        }
        let vector = self.pair("velocity", velocity, MAX_SPEED_MPS, "m/s")?;
        Ok(Motion::Velocity(vector))
    }

    fn waypoints(&self, entries: &[Spanned<WaypointEntry>]) -> Result<Vec<Waypoint>, String> {
        let mut waypoints = Vec::<Waypoint>::with_capacity(entries.len());
        for spanned in entries {
            let entry = spanned.get_ref();
            let speed = self.number("speed", entry.speed.as_ref(), 0.1, MAX_SPEED_MPS)?;
            let speed_mps = speed
                .or_else(|| waypoints.last().map(|before| before.speed_mps))
                .ok_or_else(|| self.fault(spanned, "speed is missing; the first waypoint needs one"))?;
            waypoints.push(Waypoint {
                at: self.place("at", &entry.at)?,
                speed_mps,
                wait_s: self
                    .number("wait_s", entry.wait_s.as_ref(), 0.0, MAX_TIME_S)?
                    .unwrap_or_default(),
                manner: Manner {
                    facing: self.angle("facing_deg", entry.facing_deg.as_ref())?,
                    style: entry.style.clone(),
                    gait: entry.gait.clone(),
                    height_m: self.number("height_m", entry.height_m.as_ref(), 0.0, 3.0)?,
                },
            });
        }
        Ok(waypoints)
    }
}
