//! Locomotion styles, from which a command's velocity chooses target poses (paper section 6.1 and
//! appendix D).
//!
//! A [`Style`] is a set of [`Gait`]s, each a cycle of keyframes captured at one velocity. Styles
//! come as files (`styles/*.json` in a pack folder, the JSON form of the message `Style`) or over
//! the API. [`StyleTable`] has those of a pack. What planning needs beyond their values is worked
//! out once and kept with the style: [`cycles`].
//!
//! A style need not have a standing gait. Without one, standing takes the key of the slowest gait
//! with the highest root: the moment of a step at which the legs are under the body.

mod aside;
pub(crate) mod cycles;
mod file;
mod proto;
mod table;
mod takes;
#[cfg(any(test, feature = "testing"))]
#[allow(clippy::unwrap_used, reason = "for tests")]
pub mod testing;

use std::sync::{Arc, OnceLock};

use troupe_motion::model::ByPath;
use troupe_motion::{Quat, Skeleton};

pub use file::{StyleError, StyleProblem, load_folder};
pub use table::{MAX_ADDED_STYLES, PutError, StyleTable, UnknownStyle};
pub use takes::Take;

use cycles::Cycles;

/// Most characters of a style's or gait's name: letters, digits, '-', '_' or '.'.
pub const MAX_NAME_CHARS: usize = 64;
/// Most gaits of a style.
pub const MAX_GAITS: usize = 16;
/// Most keyframes of a gait.
pub const MAX_KEYS: usize = 32;
/// Most words of a style.
pub const MAX_WORDS: usize = 8;
/// Highest velocity of a gait along an axis (m/s), highest turning rate (rad/s), and highest
/// default speed (m/s).
pub const MAX_GAIT_VELOCITY: f32 = 10.0;
/// Highest momentary velocity of a keyframe along an axis (m/s), and highest turning rate (rad/s).
pub const MAX_KEY_VELOCITY: f32 = 50.0;
/// Longest cycle, frames.
pub const MAX_PERIOD_FRAMES: f32 = 300.0;
/// Fewest and most frames between plans.
pub const REPLAN_INTERVAL_FRAMES: std::ops::RangeInclusive<u32> = 3..=30;
/// Highest root ratio; 0 is the lowest.
pub const MAX_ROOT_RATIO: f32 = 1.2;
/// A slower gait stands, m/s. Speed over the ground plus 0.3 m times the turning rate in rad/s.
pub const STANDING_GAIT_MPS: f32 = 0.05;
/// If the heights of a style's gaits differ by more than this, metres, a command may choose a
/// height. Smaller differences are normal: a run is a few centimetres lower than a walk.
pub const HEIGHT_RANGE_M: f32 = 0.12;
/// A radian of turning counts as this much travel over the ground, metres.
pub const TURN_RADIUS_M: f32 = 0.3;

/// A way to move: the gaits that a command's velocity chooses from and blends.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// Unique in its pack.
    pub name: String,
    /// Speed that the style was captured at, m/s.
    pub default_speed_mps: f32,
    /// Frames between plans, 3 to 30.
    pub replan_interval_frames: u32,
    /// Token counts that a plan may have. Empty: as many as the horizon takes.
    pub allowed_token_counts: Vec<u32>,
    /// Whether it stands still: it plans only for commands and a low buffer.
    pub is_static: bool,
    /// How closely the root follows the spring's path, 0 to 1.2.
    pub root_ratio: f32,
    /// At least one, each with at least one key. For a style of words: the pose to stand in.
    pub gaits: Vec<Gait>,
    /// The words that say how to move, for a body that is planned for by paths; none for others.
    pub words: Option<Words>,
    /// Takes of walks by which the characters of a crowd differ. Those of the pack.
    pub takes: Arc<[Take]>,
    /// Whether it came with the pack.
    pub built_in: bool,
    /// What planning needs of the gaits. `Default::default()` for a new style.
    pub cache: StyleCache,
}

/// Words for a model of many bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Words {
    /// Words with their weights. Empty: whatever suits the path.
    pub weights: Vec<(String, f32)>,
    /// Highest speed of a path of this body, m/s.
    pub max_speed_mps: f32,
}

/// One way to move at one velocity: a cycle of keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct Gait {
    /// Unique in the style.
    pub name: String,
    /// Velocity to the left of the heading, m/s.
    pub left_mps: f32,
    /// Velocity along the heading, m/s.
    pub forward_mps: f32,
    /// Turning rate, rad/s.
    pub turn_rps: f32,
    /// Frames of a cycle; 0 for a standing gait.
    pub period_frames: f32,
    /// Poses at equal steps through the cycle, at least one.
    pub keys: Vec<StyleKey>,
    /// Whether it was built from the style's other gaits. Such a gait is not part of the style's
    /// message.
    pub built: bool,
}

/// A pose of a gait, relative to its heading.
#[derive(Debug, Clone, PartialEq)]
pub struct StyleKey {
    /// One rotation a joint: the first without the heading, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Height of the root joint, metres.
    pub height_m: f32,
    /// Velocity to the left, m/s.
    pub left_mps: f32,
    /// Velocity forward, m/s.
    pub forward_mps: f32,
    /// Angular velocity, rad/s.
    pub turn_rps: f32,
}

/// Name of the only gait in a style of words.
const STAND: &str = "stand";
/// Name of the style without words.
pub const PLAIN: &str = "plain";
/// Frames between plans of a style of words. With 9, joints accelerate 10 % more and paths are
/// followed half as closely (`troupe-eval bodies`).
const WORDS_INTERVAL_FRAMES: u32 = 15;

impl Style {
    /// A rough measure of its memory, with what planning derives from it, bytes.
    pub fn bytes(&self) -> usize {
        /// Bytes of a style or a gait without keys, of a key without joints, and of a joint of a
        /// key.
        const ITSELF: usize = 1 << 10;
        const KEY: usize = 256;
        const JOINT: usize = 48;
        let keys = self.gaits.iter().flat_map(|gait| &gait.keys);
        let keys: usize = keys.map(|key| KEY + JOINT * key.rotations.len()).sum();
        ITSELF * (1 + self.gaits.len()) + keys
    }

    /// A style of words for a body.
    pub fn of_words(name: &str, weights: Vec<(String, f32)>, body: &ByPath, built_in: bool) -> Self {
        let key = StyleKey {
            rotations: body.neutral.to_vec(),
            height_m: body.height_m,
            left_mps: 0.0,
            forward_mps: 0.0,
            turn_rps: 0.0,
        };
        Self {
            name: name.to_owned(),
            default_speed_mps: body.usual_speed_mps,
            replan_interval_frames: WORDS_INTERVAL_FRAMES,
            allowed_token_counts: Vec::new(),
            is_static: false,
            root_ratio: 1.0,
            gaits: vec![Gait {
                name: STAND.to_owned(),
                left_mps: 0.0,
                forward_mps: 0.0,
                turn_rps: 0.0,
                period_frames: 0.0,
                keys: vec![key],
                built: false,
            }],
            words: Some(Words {
                weights,
                max_speed_mps: body.max_speed_mps,
            }),
            takes: Arc::default(),
            built_in,
            cache: StyleCache::default(),
        }
    }

    /// The styles that every body has: one for each word, and a plain one.
    pub fn all_of(body: &ByPath) -> Vec<Self> {
        let words = body.words.iter().filter(|word| *word != PLAIN);
        let of_word = |word: &String| Self::of_words(word, vec![(word.clone(), 1.0)], body, true);
        let plain = Self::of_words(PLAIN, Vec::new(), body, true);
        words.map(of_word).chain([plain]).collect()
    }

    /// The pose to stand in: the first key of the first standing gait, otherwise the highest key of
    /// the slowest gait.
    ///
    /// # Panics
    /// If the style has no gait, or the gait no key, which a checked style never is.
    pub fn idle(&self) -> &StyleKey {
        let slowest = self.slowest_gait();
        let gait = &self.gaits[slowest];
        &gait.keys[if gait.stands() { 0 } else { gait.highest_key() }]
    }

    /// The gait of this name.
    pub fn gait(&self, name: &str) -> Option<&Gait> {
        self.gaits.iter().find(|gait| gait.name == name)
    }

    /// Lowest and highest root that a command may choose, metres. `None` if the style has no such
    /// range.
    pub fn height_range_m(&self) -> Option<(f32, f32)> {
        let heights = || self.gaits.iter().filter(|gait| !gait.built).map(Gait::height_m);
        let (low, high) = (
            heights().fold(f32::INFINITY, f32::min),
            heights().fold(f32::NEG_INFINITY, f32::max),
        );
        (high - low > HEIGHT_RANGE_M).then_some((low, high))
    }

    /// Index of the slowest gait; of several, the first.
    pub(crate) fn slowest_gait(&self) -> usize {
        let mut slowest = 0;
        for (index, gait) in self.gaits.iter().enumerate() {
            if !gait.built
                && gait.pace_mps() < self.gaits[slowest].pace_mps()
                && !self.gaits[slowest].stands()
            {
                slowest = index;
            }
        }
        slowest
    }

    /// What planning needs of the gaits. The first call works it out, for the skeleton of the
    /// style's pack.
    pub(crate) fn cycles(&self, skeleton: &Skeleton) -> &Cycles {
        self.cache.0.get_or_init(|| Cycles::new(self, skeleton))
    }
}

impl Gait {
    /// Speed over the ground, m/s.
    pub fn speed_mps(&self) -> f32 {
        self.left_mps.hypot(self.forward_mps)
    }

    /// Speed over the ground and in turning, m/s.
    pub(crate) fn pace_mps(&self) -> f32 {
        self.speed_mps().hypot(self.turn_rps * TURN_RADIUS_M)
    }

    /// Whether the gait stays in place.
    pub fn stands(&self) -> bool {
        self.pace_mps() < STANDING_GAIT_MPS
    }

    /// Mean height of the root joint, metres; 0 without keys.
    pub fn height_m(&self) -> f32 {
        let sum: f32 = self.keys.iter().map(|key| key.height_m).sum();
        sum / self.keys.len().max(1) as f32
    }

    /// Index of the highest key; of several, the first.
    pub(crate) fn highest_key(&self) -> usize {
        let mut highest = 0;
        for (index, key) in self.keys.iter().enumerate() {
            if key.height_m > self.keys[highest].height_m {
                highest = index;
            }
        }
        highest
    }
}

/// What planning needs of a style's gaits, worked out at the first request. A copy of a style
/// starts without it.
#[derive(Default)]
pub struct StyleCache(OnceLock<Cycles>);

impl Clone for StyleCache {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for StyleCache {
    /// The cache follows from the style's values, so it never makes two styles differ.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl std::fmt::Debug for StyleCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.0.get().is_some() {
            "StyleCache(ready)"
        } else {
            "StyleCache(empty)"
        })
    }
}

#[cfg(test)]
mod tests {
    use super::testing::walker_style;
    use super::*;

    #[test]
    fn standing_takes_a_standing_gait_or_the_highest_key_of_the_slowest() {
        let mut style = walker_style();
        assert_eq!(style.idle(), &style.gait("idle").unwrap().keys[0]);
        style.gaits.retain(|gait| gait.speed_mps() > 0.0);
        let walk = style.gait("walk-back").unwrap();
        assert!(style.gaits.iter().all(|gait| gait.pace_mps() >= walk.pace_mps()));
        let top = walk.keys.iter().map(|key| key.height_m).fold(0.0, f32::max);
        assert_eq!(style.idle().height_m, top);
    }

    #[test]
    fn heights_that_differ_enough_make_a_range() {
        let mut style = walker_style();
        assert_eq!(style.height_range_m(), None);
        let mut crouch = style.gait("walk").unwrap().clone();
        crouch.name = "crouch".to_owned();
        for key in &mut crouch.keys {
            key.height_m -= 0.3;
        }
        style.gaits.push(crouch);
        let (low, high) = style.height_range_m().unwrap();
        assert!(high - low > 0.25 && high < 1.0, "{low} {high}");
    }

    #[test]
    fn a_copy_starts_without_the_cache() {
        let style = walker_style();
        style.cycles(&testing::walker());
        assert_eq!(format!("{:?}", style.cache), "StyleCache(ready)");
        assert_eq!(format!("{:?}", style.clone().cache), "StyleCache(empty)");
        assert_eq!(style.clone(), style);
    }
}
