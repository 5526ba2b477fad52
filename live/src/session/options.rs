//! The options of a new session: checks every value and converts it to the native convention.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use troupe_motion::conventions::Convention;
use troupe_motion::{GlobalRoot, Vec3};
use troupe_proto::v1;

use super::cell::SessionParts;
use super::id::{self, MAX_ID_CHARS};
use super::{LivePack, LivePacks, SessionError, SessionLimits};
use crate::skeleton::Dress;
use crate::wire::{ContextFrame, MAX_DISTANCE_M, MAX_TEMPERATURE, Measure, check_context, to_native, units};
use crate::world::{Store, WorldError};
use troupe_character::live::budget::MIDDLE_PRIORITY;
use troupe_character::live::{Character, CharacterOptions, Start, World};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::scene::{Holder, Resident};
use troupe_character::style::{Style, StyleTable};
use troupe_character::{FieldError, Path};
use troupe_motion::model::Capability;

/// Allowed time to live of a session, milliseconds.
pub const TTL_RANGE_MS: RangeInclusive<u32> = 1000..=86_400_000;
/// Look-ahead, frames: minimum, maximum and default.
const LOOK_AHEAD: (u32, u32, u32) = (2, 12, 4);
/// Frames between plans: minimum and maximum.
const INTERVAL: (u32, u32) = (3, 30);
/// Maximum root interpolation ratio.
const MAX_ROOT_RATIO: f32 = 1.2;

/// Checks the options of a session and makes its parts.
pub(super) fn parts(
    path: &Path<'_>,
    options: &v1::SessionOptions,
    packs: &LivePacks,
    store: &Store,
    limits: &SessionLimits,
) -> Result<SessionParts, SessionError> {
    let id = id::wanted(&path.field("id"), &options.id)?;
    let pack = packs.find(path, &options.pack, &options.body)?;
    pack.loaded().require(Capability::Live, path.field("pack"))?;
    let (pack, dress) = wearing(&path.field("skeleton"), &options.skeleton, pack, packs, store)?;
    let style = style(&path.field("style"), &options.style, &pack.styles())?;
    let convention = units::convention(&path.field("convention"), options.convention)?;
    let (start, given) = start(path, options, convention, &pack)?;
    let ttl = ttl(path, options, limits)?;
    let priority = options.priority.unwrap_or(MIDDLE_PRIORITY);
    let priority = units::priority(&path.field("priority"), priority)?;
    let character = character_options(path, options)?;
    let resident = resident(&path.field("scene"), &options.scene, store)?;
    let world = resident.as_ref().map(|resident| World {
        scene: resident.cell().clone(),
        definitions: store.definitions().clone(),
        holder: Holder::new(id.clone()),
        scale: pack.worn().map_or(1.0, |worn| worn.scale()),
    });
    let command = LocomotionCommand {
        velocity: Vec3::ZERO,
        facing: None,
        style: style.clone(),
        gait: None,
        height_m: None,
    };
    let character = Character::in_world(pack.rig().clone(), character, start, command, world);
    let character = character.with_skills(pack.loaded().skills.clone());
    Ok(SessionParts {
        id,
        convention,
        seed: options.seed,
        ttl,
        dress: dress.map(|dress| begun(dress, given.as_ref(), &character)),
        character,
        style,
        priority,
        pack,
        resident,
        woken: false,
    })
}

/// The pack whose characters wear the skeleton called `name`. An empty name means the pack's own.
fn wearing(
    path: &Path<'_>,
    name: &str,
    pack: Arc<LivePack>,
    packs: &LivePacks,
    store: &Store,
) -> Result<(Arc<LivePack>, Option<Dress>), SessionError> {
    if name.is_empty() {
        return Ok((pack, None));
    }
    let field = path.to_string();
    let (pack, dress) = store.skeletons().wear(&field, name, &pack, &packs.table())?;
    Ok((pack, Some(dress)))
}

/// What a character wears that begins at a pose of the client, if one is given.
fn begun(mut dress: Dress, given: Option<&ContextFrame>, character: &Character) -> Dress {
    if let Some(given) = given {
        dress.begin((given.root, &given.rotations), character);
    }
    dress
}

/// Enters the scene called `name`. An empty name means no scene.
fn resident(path: &Path<'_>, name: &str, store: &Store) -> Result<Option<Resident>, SessionError> {
    if name.is_empty() {
        return Ok(None);
    }
    let entered = store.scenes().enter(name);
    let entered = entered.map(Some).map_err(|error| WorldError::Scene {
        error,
        field: path.to_string(),
    });
    Ok(entered?)
}

fn character_options(path: &Path<'_>, options: &v1::SessionOptions) -> Result<CharacterOptions, FieldError> {
    let (low, high, default) = LOOK_AHEAD;
    let look_ahead = options.look_ahead_frames.unwrap_or(default);
    let interval = |frames| {
        units::count_within(
            &path.field("replan_interval_frames"),
            frames,
            INTERVAL.0,
            INTERVAL.1,
        )
    };
    let ratio = |ratio| units::within(&path.field("root_ratio"), ratio, 0.0, MAX_ROOT_RATIO);
    Ok(CharacterOptions {
        seed: options.seed,
        look_ahead_frames: units::count_within(&path.field("look_ahead_frames"), look_ahead, low, high)?,
        replan_interval_frames: options.replan_interval_frames.map(interval).transpose()?,
        root_ratio: options.root_ratio.map(ratio).transpose()?,
        temperature: units::within(
            &path.field("temperature"),
            options.temperature,
            0.0,
            MAX_TEMPERATURE,
        )?,
    })
}

fn ttl(
    path: &Path<'_>,
    options: &v1::SessionOptions,
    limits: &SessionLimits,
) -> Result<Duration, FieldError> {
    let (low, high) = (*TTL_RANGE_MS.start(), *TTL_RANGE_MS.end());
    let ms = options.ttl_ms.unwrap_or(limits.ttl_ms);
    let ms = units::count_within(&path.field("ttl_ms"), ms, low, high)?;
    Ok(Duration::from_millis(ms.into()))
}

/// The style called `name`. An empty name means the pack's default style.
fn style(path: &Path<'_>, name: &str, styles: &StyleTable) -> Result<Arc<Style>, SessionError> {
    let found = match name {
        "" => styles.default_style(),
        name => styles.get(name),
    };
    found.ok_or_else(|| unknown_style(path, name, styles))
}

/// Maximum number of names in the error of an unknown style. One answer may have thousands of such
/// errors.
const MAX_LISTED_STYLES: usize = 32;

/// The error of an unknown style.
pub(super) fn unknown_style(path: &Path<'_>, name: &str, styles: &StyleTable) -> SessionError {
    SessionError::UnknownStyle {
        name: name.chars().take(MAX_ID_CHARS).collect(),
        field: path.to_string(),
        there_are: styles
            .list()
            .iter()
            .take(MAX_LISTED_STYLES)
            .map(|style| style.name.clone())
            .collect(),
    }
}

/// The start of a character. Also the last frame that the client gave on a skeleton of its own.
fn start(
    path: &Path<'_>,
    options: &v1::SessionOptions,
    convention: Convention,
    pack: &LivePack,
) -> Result<(Start, Option<ContextFrame>), FieldError> {
    if options.context.is_empty() {
        let place = options.position.unwrap_or_default();
        let measure = Measure::of(convention, pack.worn().map(|worn| &**worn));
        let position = units::vector(&path.field("position"), place, MAX_DISTANCE_M, measure)?;
        let heading = units::heading(&path.field("heading"), options.heading, measure)?;
        let root = GlobalRoot::new(position, heading);
        // The character's own first joint stands there.
        let root = pack.worn().map_or(root, |worn| {
            let own = GlobalRoot::new(worn.scale() * position, heading);
            let there = worn.root_in(own).position.with_y(position.y);
            GlobalRoot::new(there, heading)
        });
        return Ok((Start::Standing(root), None));
    }
    for (name, given) in [
        ("position", options.position.is_some()),
        ("heading", options.heading != 0.0),
    ] {
        if given {
            return Err(path
                .field(name)
                .error("cannot be combined with context", "only one of the two"));
        }
    }
    let native: Vec<v1::Keyframe> = options
        .context
        .iter()
        .map(|key| to_native(key, convention))
        .collect();
    let wanted = pack.rig().dims.context_frames;
    let checked = check_context(path, "context", &native, wanted, pack.shown());
    let mut frames = checked.map_err(|error| match convention {
        Convention::Native => error,
        // `qpos` always has MuJoCo's axes.
        _ if error.field.contains(".qpos") => error,
        _ => FieldError {
            message: format!("{}, in the native convention", error.message),
            ..error
        },
    })?;
    let own = pack.worn().map(|worn| {
        let given: Vec<_> = frames
            .iter()
            .map(|frame| (frame.root, &frame.rotations[..]))
            .collect();
        worn.back(&given)
    });
    let given = own.and_then(|carried| {
        let carried = carried
            .into_iter()
            .map(|(root, rotations)| ContextFrame { root, rotations });
        std::mem::replace(&mut frames, carried.collect()).pop()
    });
    let count = frames.len();
    let wrong = || {
        path.field("context")
            .error(format!("has {count} keyframes"), "exactly 4")
    };
    let frames: &mut [ContextFrame; 4] = frames.as_mut_slice().try_into().map_err(|_| wrong())?;
    let start = Start::Context {
        roots: [0, 1, 2, 3].map(|index| frames[index].root),
        rotations: frames
            .iter_mut()
            .flat_map(|frame| frame.rotations.drain(..))
            .collect(),
    };
    Ok((start, given))
}
