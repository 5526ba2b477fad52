//! Commands of characters. They go to the server with the next step or tick.
//!
//! They may come from any thread at any time.

use std::ffi::c_char;

use glam::Vec3;
use troupe_client::{Act, LivePath, Locomotion, PathPoint, Performance};

use super::options::TroupeVec3;
use super::orders::Order;
use super::{Crowd, TroupeCrowd};
use crate::handles::{entry, get};
use crate::sized::{Versioned, array, given, read, text};
use crate::status::{Failure, TroupeStatus};

/// In `set`: `facing` counts.
pub const TROUPE_SET_FACING: u32 = 1;
/// In `set`: `height` counts.
pub const TROUPE_SET_HEIGHT: u32 = 2;
/// In `set`: `heading` counts.
pub const TROUPE_SET_HEADING: u32 = 4;
/// In `set`: `time_s` counts.
pub const TROUPE_SET_TIME: u32 = 8;
/// In `set`: `temperature` counts.
pub const TROUPE_SET_TEMPERATURE: u32 = 16;

/// How to move over the ground. All zeros: stand, in the current style.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeLocomotion {
    /// `sizeof(TroupeLocomotion)`.
    pub size: u32,
    /// `TROUPE_SET_FACING` and `TROUPE_SET_HEIGHT`, added up.
    pub set: u32,
    /// Velocity over the ground, metres a second in the world. Zero: stand.
    pub velocity: TroupeVec3,
    /// What to face, radians about the Y axis: 0 is +Z. Not set: the way it goes.
    pub facing: f32,
    /// Height of the first joint, metres, for styles that have a range of heights.
    pub height: f32,
    /// Zero.
    pub reserved: u32,
    /// Style to move in. Default: the current one.
    pub style: *const c_char,
    /// The only gait of the style to use. Default: those that suit the velocity.
    pub gait: *const c_char,
}

impl Versioned for TroupeLocomotion {
    const NAME: &'static str = "TroupeLocomotion";
}

/// A point of a path.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePathPoint {
    /// Place to pass, metres. Its height is ignored.
    pub position: TroupeVec3,
    /// What to face there, radians. Not set: along the path.
    pub heading: f32,
    /// Time of arrival, seconds from the command: increasing, and for all points or none.
    pub time_s: f32,
    /// `TROUPE_SET_HEADING` and `TROUPE_SET_TIME`, added up.
    pub set: u32,
}

/// A path to follow. The character goes to the first point, which is at most 5 m away, and stands
/// at the last.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePath {
    /// `sizeof(TroupePath)`.
    pub size: u32,
    /// Number of points: 2 to 1024.
    pub point_count: u32,
    /// `sizeof(TroupePathPoint)`.
    pub point_size: u32,
    /// Speed for points without times, metres a second: 0.05 to 15. Zero: the style's.
    pub speed: f32,
    /// 1: go on from the last point to the first, for ever.
    pub is_loop: u32,
    /// Zero.
    pub reserved: u32,
    /// The way, in order: `point_count` of them.
    pub points: *const TroupePathPoint,
    /// Style to move in. Default: the current one.
    pub style: *const c_char,
}

impl Versioned for TroupePath {
    const NAME: &'static str = "TroupePath";
}

/// A sentence to act out.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePerformance {
    /// `sizeof(TroupePerformance)`.
    pub size: u32,
    /// `TROUPE_SET_TEMPERATURE`, or zero.
    pub set: u32,
    /// The sentence: 1 to 1000 characters.
    pub text: *const c_char,
    /// Name of the pack that acts it out. Default: the server decides.
    pub pack: *const c_char,
    /// Length, 0.5 to 30 seconds. Zero: the model decides.
    pub seconds: f32,
    /// Temperature, 0 to 2. 0 takes the likeliest motion. Not set: the pack's.
    pub temperature: f32,
}

impl Versioned for TroupePerformance {
    const NAME: &'static str = "TroupePerformance";
}

/// Adds a command.
fn order(
    crowd: TroupeCrowd,
    character: u32,
    make: impl FnOnce(&Crowd) -> Result<Order, Failure>,
) -> TroupeStatus {
    entry(|| {
        let crowd = get::<Crowd>(crowd.id)?;
        let order = make(&crowd)?;
        crowd.shared.orders.push(character, order)?;
        crowd.shared.commanded.notify_one();
        Ok(TroupeStatus::Ok)
    })
}

/// The flags of `set` that are allowed, and whether each is set.
fn flags<const N: usize>(set: u32, allowed: [u32; N]) -> Result<[bool; N], Failure> {
    let all: u32 = allowed.iter().sum();
    match set & !all {
        0 => Ok(allowed.map(|flag| set & flag != 0)),
        _ => Err(Failure::Range {
            field: "set",
            got: set.to_string(),
            allowed: format!("a sum of {allowed:?}"),
        }),
    }
}

/// Has a character move over the ground. This ends what it does otherwise. It may be called as
/// often as you like: of several the newest counts, and only changes go to the server.
///
/// # Safety
/// `locomotion` is null, or points to one whose `size` is set, and whose texts end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_move(
    crowd: TroupeCrowd,
    character: u32,
    locomotion: *const TroupeLocomotion,
) -> TroupeStatus {
    order(crowd, character, |_| {
        // SAFETY: the caller vouches for `locomotion` and its texts.
        unsafe {
            let from = read("locomotion", locomotion)?;
            let [facing, height] = flags(from.set, [TROUPE_SET_FACING, TROUPE_SET_HEIGHT])?;
            Ok(Order::Move(Locomotion {
                velocity: from.velocity.into(),
                facing: facing.then_some(from.facing),
                style: given("locomotion.style", from.style)?,
                gait: given("locomotion.gait", from.gait)?,
                height: height.then_some(from.height),
            }))
        }
    })
}

/// Has a character stand, in the current style.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_stand(crowd: TroupeCrowd, character: u32) -> TroupeStatus {
    order(crowd, character, |_| Ok(Order::Move(Locomotion::stand())))
}

/// Has a character follow a path. A note (`TROUPE_NOTE_KIND_ARRIVED`) says when it is at the end.
///
/// # Safety
/// `path` is null, or points to one whose `size` is set, with as many points as it says, and texts
/// that end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_follow_path(
    crowd: TroupeCrowd,
    character: u32,
    path: *const TroupePath,
) -> TroupeStatus {
    order(crowd, character, |_| {
        // SAFETY: the caller vouches for `path` and what it points to.
        let (from, points, style) = unsafe {
            let from = read("path", path)?;
            let points = array(
                ("path.points", from.points),
                ("path.point_size", from.point_size),
                ("path.point_count", from.point_count, 2, 1024),
            )?;
            (from, points, given("path.style", from.style)?)
        };
        let mut path = LivePath::default();
        for point in points {
            let [heading, time] = flags(point.set, [TROUPE_SET_HEADING, TROUPE_SET_TIME])?;
            path.points.push(PathPoint {
                position: point.position.into(),
                heading: heading.then_some(point.heading),
                time_s: time.then_some(point.time_s),
            });
        }
        path.speed = Some(from.speed).filter(|&speed| speed != 0.0);
        path.style = style;
        path.is_loop = from.is_loop != 0;
        Ok(Order::Act(path.into()))
    })
}

/// Has a character go straight to a place, metres, and stand there. It sets out from where the last
/// frame that came shows it. `speed` is in metres a second; zero: the style's. A note
/// (`TROUPE_NOTE_KIND_ARRIVED`) says when it is there.
///
/// # Safety
/// `style` is null, or ends with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_go_to(
    crowd: TroupeCrowd,
    character: u32,
    position: TroupeVec3,
    speed: f32,
    style: *const c_char,
) -> TroupeStatus {
    order(crowd, character, |open| {
        // SAFETY: the caller vouches for `style`.
        let style = unsafe { given("style", style) }?;
        let here = open.shared.exchange.place(character as usize).unwrap_or_default();
        let mut path = LivePath::through([here, Vec3::from(position)]);
        path.speed = Some(speed).filter(|&speed| speed != 0.0);
        path.style = style;
        Ok(Order::Act(path.into()))
    })
}

/// Has a character go to an object of its scene and use it. `variant` and `approach` may be null:
/// then the seed decides, and the nearest approach is taken. Do not move the character until it is
/// over, because that ends it.
///
/// # Safety
/// The texts are null, or end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_interact(
    crowd: TroupeCrowd,
    character: u32,
    object: *const c_char,
    variant: *const c_char,
    approach: *const c_char,
) -> TroupeStatus {
    order(crowd, character, |_| {
        // SAFETY: the caller vouches for the texts.
        unsafe {
            Ok(Order::Act(Act::Interact {
                instance: required("object", object)?,
                variant: given("variant", variant)?,
                approach: given("approach", approach)?,
            }))
        }
    })
}

/// Has a character do a skill of its pack where it stands. `variant` may be null: then the seed
/// decides.
///
/// # Safety
/// The texts are null, or end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_skill(
    crowd: TroupeCrowd,
    character: u32,
    name: *const c_char,
    variant: *const c_char,
) -> TroupeStatus {
    order(crowd, character, |_| {
        // SAFETY: the caller vouches for the texts.
        unsafe {
            Ok(Order::Act(Act::Skill {
                name: required("name", name)?,
                variant: given("variant", variant)?,
            }))
        }
    })
}

/// Has a character act out a sentence, and go on as before.
///
/// # Safety
/// `performance` is null, or points to one whose `size` is set, and whose texts end with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_crowd_perform(
    crowd: TroupeCrowd,
    character: u32,
    performance: *const TroupePerformance,
) -> TroupeStatus {
    order(crowd, character, |_| {
        // SAFETY: the caller vouches for `performance` and its texts.
        unsafe {
            let from = read("performance", performance)?;
            let [temperature] = flags(from.set, [TROUPE_SET_TEMPERATURE])?;
            Ok(Order::Act(Act::Perform(Performance {
                text: required("performance.text", from.text)?,
                pack: given("performance.pack", from.pack)?,
                seconds: Some(from.seconds).filter(|&seconds| seconds != 0.0),
                temperature: temperature.then_some(from.temperature),
            })))
        }
    })
}

/// Has a character leave what it holds, such as a seat, by its exit.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_end_interaction(crowd: TroupeCrowd, character: u32) -> TroupeStatus {
    order(crowd, character, |_| Ok(Order::Act(Act::EndInteraction)))
}

/// Has a character stop everything at once, drop the object in its hand, and stand.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_cancel(crowd: TroupeCrowd, character: u32) -> TroupeStatus {
    order(crowd, character, |_| Ok(Order::Act(Act::Cancel)))
}

/// Has a character put down the object in its hand.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_drop(crowd: TroupeCrowd, character: u32) -> TroupeStatus {
    order(crowd, character, |_| Ok(Order::Act(Act::Drop)))
}

/// Sets how much a character matters if there are more than the server can serve, 0 to 1: 0 is far
/// from the camera, 1 the hero, 0.5 the default. Every change is a command, so use steps of a
/// tenth.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_crowd_set_priority(
    crowd: TroupeCrowd,
    character: u32,
    priority: f32,
) -> TroupeStatus {
    order(crowd, character, |_| Ok(Order::Priority(priority)))
}

/// A text that may not be empty.
///
/// # Safety
/// As [`text`].
unsafe fn required(field: &'static str, from: *const c_char) -> Result<String, Failure> {
    if from.is_null() {
        return Err(Failure::Null(field));
    }
    // SAFETY: the caller vouches for `from`.
    unsafe { text(field, from) }
}
