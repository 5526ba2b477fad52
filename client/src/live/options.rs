//! Options of sessions and of frames.

use std::time::Duration;

use glam::Vec3;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use crate::inbetween::{CONTEXT_FRAMES, Key};
use crate::pack::Pack;

/// Options of a new character. By default it stands at the origin in the pack's default style, with
/// seed 0.
///
/// ```
/// use glam::Vec3;
/// use troupe_client::SessionOptions;
///
/// let guard = SessionOptions::new().style("walk").seed(7).at(Vec3::new(4.0, 0.0, 2.0), 0.5);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionOptions {
    message: v1::SessionOptions,
    convention: Convention,
}

impl SessionOptions {
    /// The default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the id, unique on the server: 1 to 64 letters, digits, `-`, `_` or `.`. Without it the
    /// server makes one.
    #[must_use]
    pub fn id(mut self, id: impl Into<String>) -> Self {
        self.message.id = id.into();
        self
    }

    /// Sets the first style.
    #[must_use]
    pub fn style(mut self, style: impl Into<String>) -> Self {
        self.message.style = style.into();
        self
    }

    /// The same seed, commands and steps give the same frames.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.message.seed = seed;
        self
    }

    /// Sets axes, handedness and unit of all input and output of the session.
    #[must_use]
    pub fn convention(mut self, convention: Convention) -> Self {
        self.convention = convention;
        self
    }

    /// Sets the scene of the character. By default it has none.
    #[must_use]
    pub fn scene(mut self, name: impl Into<String>) -> Self {
        self.message.scene = name.into();
        self
    }

    /// Has the server record the session, for
    /// [`Client::recording_of`](crate::Client::recording_of). A session in a scene cannot be
    /// recorded.
    #[must_use]
    pub fn record(mut self, record: bool) -> Self {
        self.message.record = record;
        self
    }

    /// Sets the place at which it stands at first, in its convention, and its heading, radians. The
    /// height is the pack's.
    #[must_use]
    pub fn at(mut self, position: Vec3, heading: f32) -> Self {
        let Vec3 { x, y, z } = position;
        self.message.position = Some(v1::Vec3 { x, y, z });
        self.message.heading = heading;
        self
    }

    /// Sets four consecutive frames before the first, the oldest first, in its convention. Excludes
    /// [`Self::at`].
    #[must_use]
    pub fn context(mut self, frames: &[Key; CONTEXT_FRAMES]) -> Self {
        self.message.context = frames.iter().map(Key::to_message).collect();
        self
    }

    /// Sets the time without a command, step or stream after which it expires: 1 s to a day, a
    /// minute by default.
    #[must_use]
    pub fn ttl(mut self, ttl: Duration) -> Self {
        self.message.ttl_ms = Some(u32::try_from(ttl.as_millis()).unwrap_or(u32::MAX));
        self
    }

    /// Sets the frames from the cursor to the start of a new plan: 2 to 12, 4 by default.
    #[must_use]
    pub fn look_ahead_frames(mut self, frames: u32) -> Self {
        self.message.look_ahead_frames = Some(frames);
        self
    }

    /// Sets the frames between plans, 3 to 30. Default: the style's.
    #[must_use]
    pub fn replan_interval_frames(mut self, frames: u32) -> Self {
        self.message.replan_interval_frames = Some(frames);
        self
    }

    /// Sets how closely the root follows the path of the spring, 0 to 1.2: 0 leaves it to the
    /// networks, 1 follows the spring. Default: the style's.
    #[must_use]
    pub fn root_ratio(mut self, ratio: f32) -> Self {
        self.message.root_ratio = Some(ratio);
        self
    }

    /// Sets the temperature, 0 to 2. Above 0 poses are sampled with the seed, and roots by packs
    /// that can.
    #[must_use]
    pub fn temperature(mut self, temperature: f32) -> Self {
        self.message.temperature = temperature;
        self
    }

    /// Sets the priority for plans, which counts if there are more characters than the server can
    /// serve: 0 is far from the camera, 1 the hero, 0.5 the default.
    #[must_use]
    pub fn priority(mut self, priority: f32) -> Self {
        self.message.priority = Some(priority);
        self
    }

    /// The options on the wire, for a pack and one of its bodies.
    pub(crate) fn to_message(&self, pack: &Pack) -> v1::SessionOptions {
        v1::SessionOptions {
            pack: pack.name().to_owned(),
            body: pack.body().to_owned(),
            skeleton: pack.worn().to_owned(),
            convention: convention_to_wire(self.convention).into(),
            ..self.message.clone()
        }
    }
}

/// Frames a second. The motion of a session is the same at every rate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Rate {
    /// 30, the rate of the networks.
    #[default]
    Hz30,
    /// 50, interpolated.
    Hz50,
    /// 60, interpolated.
    Hz60,
}

impl Rate {
    /// Frames a second.
    pub fn hz(self) -> u32 {
        match self {
            Self::Hz30 => 30,
            Self::Hz50 => 50,
            Self::Hz60 => 60,
        }
    }

    /// Time from one frame to the next.
    pub fn period(self) -> Duration {
        Duration::from_secs(1) / self.hz()
    }
}

/// Encoding of frames on the wire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// 32-bit floats, as exact as in the server.
    #[default]
    F32,
    /// Under half the bytes of [`Encoding::F32`]. Roots are exact to 0.1 mm, rotations to 0.01
    /// degrees (see [`troupe_motion::codec`] for the bounds).
    Compact,
    /// MuJoCo's `qpos` as 32-bit floats: a quarter of the bytes of [`Encoding::F32`], for packs
    /// with a robot.
    Qpos,
}

impl Encoding {
    pub(crate) fn to_wire(self) -> i32 {
        match self {
            Self::F32 => v1::Encoding::F32,
            Self::Compact => v1::Encoding::Compact,
            Self::Qpos => v1::Encoding::Qpos,
        }
        .into()
    }
}

/// Options of frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameOptions {
    /// Frames a second.
    pub rate: Rate,
    /// Encoding on the wire.
    pub encoding: Encoding,
    /// Whether frames have world joint positions too.
    pub positions: bool,
}

pub(crate) fn convention_to_wire(convention: Convention) -> v1::Convention {
    match convention {
        Convention::Native => v1::Convention::Native,
        Convention::Unreal => v1::Convention::Unreal,
        Convention::Unity => v1::Convention::Unity,
        Convention::Ros => v1::Convention::Ros,
    }
}

pub(crate) fn convention_from_wire(convention: v1::Convention) -> Convention {
    match convention {
        v1::Convention::Native => Convention::Native,
        v1::Convention::Unreal => Convention::Unreal,
        v1::Convention::Unity => Convention::Unity,
        v1::Convention::Ros => Convention::Ros,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn human() -> Pack {
        let mut message = crate::pack::tests::message();
        message.name = "human".to_owned();
        Pack::try_from(message).unwrap()
    }

    #[test]
    fn options_reach_the_wire() {
        let options = SessionOptions::new()
            .id("guard")
            .style("walk")
            .seed(9)
            .convention(Convention::Unreal)
            .at(Vec3::new(1.0, 2.0, 3.0), 0.5)
            .ttl(Duration::from_secs(2))
            .look_ahead_frames(6);
        let message = options.to_message(&human());
        assert_eq!(
            (message.id.as_str(), message.pack.as_str(), message.style.as_str()),
            ("guard", "human", "walk")
        );
        assert_eq!(message.convention(), v1::Convention::Unreal);
        assert_eq!(message.position.map(|p| [p.x, p.y, p.z]), Some([1.0, 2.0, 3.0]));
        assert_eq!(
            (
                message.ttl_ms,
                message.look_ahead_frames,
                message.replan_interval_frames
            ),
            (Some(2000), Some(6), None)
        );
        // A time beyond the range of the field becomes the maximum.
        let long = SessionOptions::new().ttl(Duration::from_secs(1 << 40));
        assert_eq!(long.to_message(&human()).ttl_ms, Some(u32::MAX));
    }

    #[test]
    fn conventions_come_back() {
        for convention in Convention::ALL {
            assert_eq!(convention_from_wire(convention_to_wire(convention)), convention);
        }
    }
}
