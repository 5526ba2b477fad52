//! What a crowd is opened with.

use std::ffi::c_char;
use std::time::Duration;

use glam::Vec3;
use troupe_client::{DriveOptions, FrameOptions, Rate, SessionOptions};

use crate::sized::{Versioned, array, given, read};
use crate::status::Failure;

/// Characters of a crowd, at most.
pub const TROUPE_MOST_CHARACTERS: u32 = 1024;

/// For times: never.
pub const TROUPE_NEVER: u32 = 0xffff_ffff;

/// Three numbers.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TroupeVec3 {
    /// To a character's left that faces ahead.
    pub x: f32,
    /// Up.
    pub y: f32,
    /// Ahead.
    pub z: f32,
}

impl From<TroupeVec3> for Vec3 {
    fn from(of: TroupeVec3) -> Self {
        Self::new(of.x, of.y, of.z)
    }
}

/// Who advances a crowd.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TroupeClock {
    /// The server, at a steady rate. Read the newest frames when you want them.
    Server = 0,
    /// The caller, with `troupe_crowd_step`. The same seeds, commands and steps give the same
    /// frames.
    Caller = 1,
}

/// Form of rotations.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TroupeRotation {
    /// Unit quaternions: x, y, z, w.
    Quaternion = 0,
    /// The first two columns of the matrix: six numbers.
    SixD = 1,
}

/// A character of a new crowd. Fields that are zero take their defaults.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeCharacter {
    /// The same seed, commands and steps give the same frames. Any seed but zero gives the
    /// character a posture and a gait of its own.
    pub seed: u64,
    /// Where it stands at first, metres. Its height is the pack's.
    pub position: TroupeVec3,
    /// What it faces at first, radians about the Y axis: 0 is +Z, a quarter turn is +X.
    pub heading: f32,
    /// Its first style. Default: the pack's.
    pub style: *const c_char,
}

/// What a crowd is opened with. Fields that are zero take their defaults.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeCrowdOptions {
    /// `sizeof(TroupeCrowdOptions)`.
    pub size: u32,
    /// A `TroupeClock`.
    pub clock: u32,
    /// Frames a second: 30, 50 or 60. Zero: 30.
    pub rate_hz: u32,
    /// A `TroupeRotation`.
    pub rotation: u32,
    /// 1: frames have the joints' positions in the world, too.
    pub joint_positions: u32,
    /// Time without a step or stream after which the server closes a character, milliseconds: 1000
    /// to 86400000. Zero: a minute.
    pub ttl_ms: u32,
    /// On the server's clock, the time for which a connection that breaks is opened again, to go on
    /// after the last frame that came, milliseconds. Zero: 10000. `TROUPE_NEVER`: the crowd ends.
    pub reconnect_ms: u32,
    /// Number of `characters`: 1 to `TROUPE_MOST_CHARACTERS`.
    pub character_count: u32,
    /// `sizeof(TroupeCharacter)`.
    pub character_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Who is in it: `character_count` of them.
    pub characters: *const TroupeCharacter,
    /// Name of the scene on the server that they live in. Default: none, flat ground.
    pub scene: *const c_char,
}

impl Versioned for TroupeCrowdOptions {
    const NAME: &'static str = "TroupeCrowdOptions";
}

/// Options that were read.
#[derive(Debug)]
pub(crate) struct Wanted {
    pub(crate) by_server: bool,
    pub(crate) as_six_d: bool,
    pub(crate) frames: FrameOptions,
    pub(crate) drive: DriveOptions,
    pub(crate) sessions: Vec<SessionOptions>,
    pub(crate) places: Vec<Vec3>,
}

/// Reads the options.
///
/// # Safety
/// `from` is null, or points to options whose `size` is set, with an array of characters as large
/// as they say, and texts that end with NUL.
pub(crate) unsafe fn wanted(from: *const TroupeCrowdOptions) -> Result<Wanted, Failure> {
    // SAFETY: the caller vouches for all of these.
    unsafe {
        let from = read("options", from)?;
        let characters = array(
            ("options.characters", from.characters),
            ("options.character_size", from.character_size),
            (
                "options.character_count",
                from.character_count,
                1,
                TROUPE_MOST_CHARACTERS,
            ),
        )?;
        let scene = given("options.scene", from.scene)?;
        let mut sessions = Vec::with_capacity(characters.len());
        for of in &characters {
            let style = given("options.characters[].style", of.style)?;
            let mut options = SessionOptions::new()
                .seed(of.seed)
                .at(of.position.into(), of.heading);
            if let Some(style) = style {
                options = options.style(style);
            }
            if let Some(scene) = &scene {
                options = options.scene(scene);
            }
            if from.ttl_ms > 0 {
                options = options.ttl(Duration::from_millis(from.ttl_ms.into()));
            }
            sessions.push(options);
        }
        let frames = FrameOptions {
            rate: rate(from.rate_hz)?,
            positions: one_of("options.joint_positions", from.joint_positions, "0 or 1")?,
            ..FrameOptions::default()
        };
        Ok(Wanted {
            by_server: !one_of("options.clock", from.clock, "a TroupeClock: 0 or 1")?,
            as_six_d: one_of("options.rotation", from.rotation, "a TroupeRotation: 0 or 1")?,
            frames,
            drive: DriveOptions {
                frames,
                reconnect: reconnect(from.reconnect_ms),
                ..DriveOptions::default()
            },
            sessions,
            places: characters.iter().map(|of| of.position.into()).collect(),
        })
    }
}

fn rate(hz: u32) -> Result<Rate, Failure> {
    match hz {
        0 | 30 => Ok(Rate::Hz30),
        50 => Ok(Rate::Hz50),
        60 => Ok(Rate::Hz60),
        other => Err(Failure::Range {
            field: "options.rate_hz",
            got: other.to_string(),
            allowed: "30, 50 or 60".to_owned(),
        }),
    }
}

fn one_of(field: &'static str, got: u32, allowed: &str) -> Result<bool, Failure> {
    match got {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Failure::Range {
            field,
            got: other.to_string(),
            allowed: allowed.to_owned(),
        }),
    }
}

fn reconnect(ms: u32) -> Option<Duration> {
    match ms {
        0 => DriveOptions::default().reconnect,
        TROUPE_NEVER => None,
        ms => Some(Duration::from_millis(ms.into())),
    }
}
