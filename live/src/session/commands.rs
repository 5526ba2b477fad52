//! Commands. Each is checked on its own, so a wrong command does not stop the others.

use std::sync::Arc;
use std::time::Instant;

use troupe_motion::Vec3;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent as Asked;

use super::cell::{Live, SessionCell};
use super::executor::Turn;
use super::id::MAX_ID_CHARS;
use super::options::unknown_style;
use super::results::CommandResult;
use super::{Registry, SessionError, TimeSource};
use crate::wire::{MAX_DISTANCE_M, units};
use troupe_character::document::MAX_NAME_CHARS;
use troupe_character::limits::MAX_HEIGHT_M;
use troupe_character::live::{CommandError, CommandOutcome, Intent, PerformCommand};
use troupe_character::primitives::path::{AskedPoint, PATH_POINTS};
use troupe_character::primitives::{LocomotionCommand, PathCommand};
use troupe_character::scene::MAX_ID_BYTES;
use troupe_character::style::Style;
use troupe_character::{FieldError, Path};

/// Maximum number of commands in one request.
pub const MAX_COMMANDS: usize = 10_000;
/// Maximum number of frames from the session's frame to a command's `at_frame`.
const MAX_FRAMES_AHEAD: u64 = 100_000;
/// Maximum velocity along an axis, m/s.
const MAX_VELOCITY_MPS: f32 = 1000.0;

/// Gives commands to their sessions. The results have the order of the commands.
pub(super) async fn apply(
    registry: &Registry,
    time: &TimeSource,
    commands: &[v1::Command],
) -> Vec<CommandResult> {
    let now = time.now();
    let mut turn = Turn::begin();
    let mut results = Vec::with_capacity(commands.len());
    for (index, command) in commands.iter().enumerate() {
        results.push(apply_one(registry, now, index, command));
        turn.pause().await;
    }
    results
}

fn apply_one(registry: &Registry, now: Instant, index: usize, command: &v1::Command) -> CommandResult {
    let root = Path::root();
    let path = root.element("commands", index);
    let field = || path.field("session_id").to_string();
    let outcome = registry
        .get(&command.session_id, now, &field)
        .and_then(|cell| give(&path, &cell, command));
    result(command, outcome)
}

fn result(command: &v1::Command, outcome: Result<CommandOutcome, SessionError>) -> CommandResult {
    CommandResult {
        session_id: command.session_id.chars().take(MAX_ID_CHARS).collect(),
        sequence: command.sequence,
        outcome,
    }
}

/// Gives a command to its session.
pub(super) fn give(
    path: &Path<'_>,
    cell: &SessionCell,
    command: &v1::Command,
) -> Result<CommandOutcome, SessionError> {
    if command.sequence == 0 {
        return Err(path.field("sequence").error("is 0", "1 or more").into());
    }
    let priority = |value| units::priority(&path.field("priority"), value);
    let priority = command.priority.map(priority).transpose()?;
    let words = words(path, command, cell)?;
    let mut live = cell.live();
    if let Some(at) = command.at_frame {
        check_at(path, at, live.character.frame())?;
    }
    let intent = match words {
        Some(words) => Some(Intent::Perform(words)),
        None => intent(path, command, cell, &live)?,
    };
    let outcome = match intent {
        Some(intent) => {
            let style = match &intent {
                Intent::Locomote(locomotion) => Some(locomotion.style.clone()),
                Intent::FollowPath(path) => Some(path.style.clone()),
                _ => None,
            };
            let outcome = (live.character)
                .give(command.sequence, command.at_frame, intent)
                .map_err(|refusal| refused(&path.sized(cell.size()), refusal))?;
            if let (CommandOutcome::Accepted, Some(style)) = (outcome, style) {
                live.style = style;
            }
            outcome
        }
        None if priority.is_some() => live.character.note_command(command.sequence),
        None => {
            let wanted = "locomote, follow_path, interact, skill, perform, end_interaction, cancel or drop, or a priority without an intent";
            return Err(path.field("intent").error("is missing", wanted).into());
        }
    };
    if let (CommandOutcome::Accepted, Some(priority)) = (outcome, priority) {
        live.priority = priority;
    }
    if outcome == CommandOutcome::Accepted {
        live.record_command(command);
    }
    drop(live);
    cell.touch();
    Ok(outcome)
}

/// The sentence that a command asks for, if any. It is checked without the session's lock, because
/// that takes long.
fn words(
    path: &Path<'_>,
    command: &v1::Command,
    cell: &SessionCell,
) -> Result<Option<PerformCommand>, SessionError> {
    let Some(Asked::Perform(asked)) = &command.intent else {
        return Ok(None);
    };
    (cell.pack().words().command(&path.field("perform"), asked)).map(Some)
}

/// The intent of a command in the native convention. `None` for sentences: [`words`] reads those.
fn intent(
    path: &Path<'_>,
    command: &v1::Command,
    cell: &SessionCell,
    live: &Live,
) -> Result<Option<Intent>, SessionError> {
    Ok(match &command.intent {
        Some(Asked::Locomote(asked)) => {
            let locomotion = locomotion(&path.field("locomote"), asked, cell, live)?;
            Some(Intent::Locomote(locomotion))
        }
        Some(Asked::FollowPath(asked)) => {
            let path = path.sized(cell.size());
            let path = follow_path(&path.field("follow_path"), asked, cell, live)?;
            Some(Intent::FollowPath(path))
        }
        Some(Asked::Interact(asked)) => Some(interact(&path.field("interact"), asked)?),
        Some(Asked::Skill(asked)) => Some(skill(&path.field("skill"), asked)?),
        Some(Asked::EndInteraction(_)) => Some(Intent::EndInteraction),
        Some(Asked::Cancel(_)) => Some(Intent::Cancel),
        Some(Asked::Drop(_)) => Some(Intent::Drop),
        Some(Asked::Perform(_)) | None => None,
    })
}

fn interact(path: &Path<'_>, asked: &v1::Interact) -> Result<Intent, FieldError> {
    let length = asked.instance.len();
    if !(1..=MAX_ID_BYTES).contains(&length) {
        return Err(path.field("instance").error(
            format!("has {length} bytes"),
            format!("1 to {MAX_ID_BYTES} bytes"),
        ));
    }
    Ok(Intent::Interact {
        instance: Arc::from(asked.instance.as_str()),
        variant: chosen(&path.field("variant"), &asked.variant)?,
        approach: chosen(&path.field("approach"), &asked.approach)?,
    })
}

fn skill(path: &Path<'_>, asked: &v1::UseSkill) -> Result<Intent, FieldError> {
    let found = asked.name.chars().count();
    if !(1..=MAX_NAME_CHARS).contains(&found) {
        return Err(path.field("name").error(
            format!("has {found} characters"),
            format!("1 to {MAX_NAME_CHARS} characters"),
        ));
    }
    Ok(Intent::Skill {
        name: Arc::from(asked.name.as_str()),
        variant: chosen(&path.field("variant"), &asked.variant)?,
    })
}

/// A name that may be left out.
fn chosen(path: &Path<'_>, name: &str) -> Result<Option<String>, FieldError> {
    match name.chars().count() {
        0 => Ok(None),
        1..=MAX_NAME_CHARS => Ok(Some(name.to_owned())),
        found => Err(path.error(
            format!("has {found} characters"),
            format!("at most {MAX_NAME_CHARS}, or none"),
        )),
    }
}

/// The error of a command that the character refused.
fn refused(path: &Path<'_>, refusal: CommandError) -> SessionError {
    let interact = path.field("interact");
    let skill = path.field("skill");
    let follow = path.field("follow_path");
    let first = follow.element("points", 0);
    let field = match &refusal {
        CommandError::TooManyCommands => path.field("intent"),
        CommandError::PathTooFar { .. } => first.field("position"),
        CommandError::UnknownSkill { .. } | CommandError::SkillByPath => skill.field("name"),
        CommandError::TooShort { what: "skill", .. } => skill.field("name"),
        CommandError::UnknownSkillVariant { .. } => skill.field("variant"),
        CommandError::UnknownVariant { .. } => interact.field("variant"),
        CommandError::UnknownApproach { .. } => interact.field("approach"),
        _ => interact.field("instance"),
    };
    let field = field.to_string();
    let refusal = match refusal {
        CommandError::PathTooFar { off_m, most_m } => CommandError::PathTooFar {
            off_m: path.metres(off_m),
            most_m: path.metres(most_m),
        },
        refusal => refusal,
    };
    SessionError::Refused { field, refusal }
}

fn check_at(path: &Path<'_>, at: u64, frame: u64) -> Result<(), FieldError> {
    let latest = frame.saturating_add(MAX_FRAMES_AHEAD);
    match at <= latest {
        true => Ok(()),
        false => Err(path.field("at_frame").error(
            format!("is {at}, and the session is at frame {frame}"),
            format!("at most {latest}"),
        )),
    }
}

/// The style called `name`. An empty name means the character's present style.
fn style(path: &Path<'_>, name: &str, cell: &SessionCell, live: &Live) -> Result<Arc<Style>, SessionError> {
    if name.is_empty() {
        return Ok(live.style.clone());
    }
    let styles = cell.pack().styles();
    let found = styles.get(name);
    found.ok_or_else(|| unknown_style(&path.field("style"), name, &styles))
}

/// The path that a message asks for, in the native convention.
fn follow_path(
    path: &Path<'_>,
    asked: &v1::FollowPath,
    cell: &SessionCell,
    live: &Live,
) -> Result<PathCommand, SessionError> {
    let measure = cell.measure();
    let style = style(path, &asked.style, cell, live)?;
    // Of a list that is too long, no more points are read than are needed to refuse it.
    let points = asked.points.iter().take(PATH_POINTS.end() + 1).enumerate();
    let point = |(index, point): (usize, &v1::PathPoint)| {
        let path = path.element("points", index);
        let missing = || path.field("position").error("is missing", "a place");
        let heading = |value| units::heading(&path.field("heading"), value, measure);
        let place = point.position.ok_or_else(missing)?;
        Ok(AskedPoint {
            position: units::vector(&path.field("position"), place, MAX_DISTANCE_M, measure)?,
            heading: point.heading.map(heading).transpose()?,
            time_s: point.time,
        })
    };
    let points = points.map(point).collect::<Result<Vec<_>, FieldError>>()?;
    let speed_mps = asked.speed.map(|speed| speed / measure.units_per_metre());
    Ok(PathCommand::new(path, &points, speed_mps, asked.r#loop, style)?)
}

/// The locomotion that a message asks for, in the native convention.
fn locomotion(
    path: &Path<'_>,
    locomote: &v1::Locomote,
    cell: &SessionCell,
    live: &Live,
) -> Result<LocomotionCommand, SessionError> {
    let measure = cell.measure();
    let style = style(path, &locomote.style, cell, live)?;
    let facing = |value| units::heading(&path.field("facing"), value, measure);
    let height = |value| height(&path.field("height"), value, cell);
    Ok(LocomotionCommand {
        velocity: velocity(path, locomote, cell)?,
        facing: locomote.facing.map(facing).transpose()?,
        gait: gait(&path.field("gait"), &locomote.gait, &style)?,
        height_m: locomote.height.map(height).transpose()?,
        style,
    })
}

fn velocity(path: &Path<'_>, locomote: &v1::Locomote, cell: &SessionCell) -> Result<Vec3, FieldError> {
    let Some(given) = locomote.velocity else {
        return Ok(Vec3::ZERO);
    };
    let path = path.field("velocity");
    let measure = cell.measure();
    let velocity = units::vector(&path, given, MAX_VELOCITY_MPS, measure)?;
    match velocity.y == 0.0 {
        true => Ok(velocity),
        false => {
            let up = velocity.y * measure.units_per_metre();
            let path = path.field(units::up_axis(measure.convention()));
            Err(path.error(format!("is {up}, but the velocity must be horizontal"), "0"))
        }
    }
}

fn height(path: &Path<'_>, value: f32, cell: &SessionCell) -> Result<f32, FieldError> {
    let value = units::within(path, value, 0.0, MAX_HEIGHT_M * cell.measure().units_per_metre())?;
    let height_m = value / cell.convention().units_per_metre();
    Ok(match cell.pack().worn() {
        Some(worn) => worn.height_in(height_m),
        None => height_m,
    })
}

fn gait(path: &Path<'_>, name: &str, style: &Arc<Style>) -> Result<Option<String>, FieldError> {
    if name.is_empty() {
        return Ok(None);
    }
    if style.gaits.iter().any(|gait| gait.name == name) {
        return Ok(Some(name.to_owned()));
    }
    let start: String = name.chars().take(64).collect();
    let gaits: Vec<&str> = style.gaits.iter().map(|gait| gait.name.as_str()).collect();
    Err(path.error(
        format!("the style {} has no gait {start:?}", style.name),
        gaits.join(", "),
    ))
}
