//! Roots that replace the predicted ones.

use glam::Vec2;
use troupe_proto::v1;

/// The root in a frame of a segment, for [`InBetween::root`](crate::InBetween::root): any part of
/// place, height and heading. The networks make the rest.
///
/// ```
/// use glam::Vec2;
/// use troupe_client::RootKey;
///
/// // Half a metre to the left of the origin in frame 20, counted from the first context frame.
/// let key = RootKey::new(20).ground(Vec2::new(0.5, 0.0));
/// # assert_ne!(key, RootKey::new(20));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RootKey {
    message: v1::RootKey,
}

impl RootKey {
    /// The root of a frame. The first context frame is frame 0.
    pub fn new(frame: u32) -> Self {
        Self {
            message: v1::RootKey {
                frame,
                ..v1::RootKey::default()
            },
        }
    }

    /// Fixes its place over the ground: world X and Z, metres.
    #[must_use]
    pub fn ground(mut self, place_m: Vec2) -> Self {
        (self.message.x, self.message.z) = (Some(place_m.x), Some(place_m.y));
        self
    }

    /// Fixes the height of the root joint, metres.
    #[must_use]
    pub fn height(mut self, height_m: f32) -> Self {
        self.message.height = Some(height_m);
        self
    }

    /// Fixes the heading, radians about +Y.
    #[must_use]
    pub fn heading(mut self, heading: f32) -> Self {
        self.message.heading = Some(heading);
        self
    }

    /// The entry on the wire.
    pub(crate) fn to_message(self) -> v1::RootKey {
        self.message
    }
}
