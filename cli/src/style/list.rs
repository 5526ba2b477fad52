//! Lists of styles to build: which clips make which gaits.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::failure::Failure;

/// Styles to build, by name.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct StyleList {
    /// Styles by name.
    pub styles: BTreeMap<String, StyleEntry>,
}

impl StyleList {
    /// Reads a list.
    ///
    /// # Errors
    /// [`Failure::Input`] if the file cannot be read or is no list.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
        toml::from_str(&text).map_err(|e| Failure::file(path, e))
    }
}

/// One style.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct StyleEntry {
    /// Gait whose speed is the style's default. Default: `walk` if it exists, else the first gait
    /// that moves.
    pub(crate) speed_of: Option<String>,
    /// Frames between plans.
    #[serde(default = "usual_interval")]
    pub(crate) replan_interval_frames: u32,
    /// How closely the root follows the commanded path.
    #[serde(default)]
    pub(crate) root_ratio: f32,
    /// The style only stands.
    #[serde(default)]
    pub(crate) is_static: bool,
    /// Clips by the gait that they show.
    pub gaits: BTreeMap<String, GaitClips>,
}

/// The clips that show a gait.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub enum GaitClips {
    /// A whole clip, by its file's name without the ending.
    Clip(String),
    /// A part of one.
    Part(ClipPart),
    /// Several ways to stand, one a part.
    Parts(Vec<ClipPart>),
}

/// A part of a clip.
#[derive(Debug, Clone, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ClipPart {
    /// The file's name without the ending.
    pub clip: String,
    /// The only frame to look at.
    frame: Option<usize>,
    /// First frame.
    from: Option<usize>,
    /// Last frame.
    to: Option<usize>,
}

impl GaitClips {
    /// The clips, or parts of clips, that show the gait.
    pub fn parts(&self) -> Vec<ClipPart> {
        match self {
            Self::Clip(clip) => vec![ClipPart {
                clip: clip.clone(),
                ..ClipPart::default()
            }],
            Self::Part(part) => vec![part.clone()],
            Self::Parts(parts) => parts.clone(),
        }
    }
}

impl ClipPart {
    /// First and last frame.
    pub(crate) fn frames(&self) -> (Option<usize>, Option<usize>) {
        (self.frame.or(self.from), self.frame.or(self.to))
    }
}

/// Frames between plans of a style that says nothing else.
pub(super) const USUAL_INTERVAL_FRAMES: u32 = 9;

fn usual_interval() -> u32 {
    USUAL_INTERVAL_FRAMES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_whole_and_in_part() {
        let list: StyleList = toml::from_str(
            r#"
            [styles.calm]
            speed_of = "run"
            gaits.walk = "walk_1"
            gaits.run = { clip = "run_1", from = 10 }
            gaits.idle = [{ clip = "wave_1", frame = 3 }, { clip = "wave_2", from = 4, to = 9 }]
            "#,
        )
        .unwrap();
        let calm = &list.styles["calm"];
        assert_eq!((calm.replan_interval_frames, calm.is_static), (9, false));
        let frames = |gait: &str| {
            let parts = calm.gaits[gait].parts();
            parts
                .iter()
                .map(|p| (p.clip.clone(), p.frames()))
                .collect::<Vec<_>>()
        };
        assert_eq!(frames("walk"), [("walk_1".to_owned(), (None, None))]);
        assert_eq!(frames("run"), [("run_1".to_owned(), (Some(10), None))]);
        let idle = [
            ("wave_1".to_owned(), (Some(3), Some(3))),
            ("wave_2".to_owned(), (Some(4), Some(9))),
        ];
        assert_eq!(frames("idle"), idle);
    }

    #[test]
    fn a_misspelt_field_is_refused() {
        let text = "[styles.calm]\nreplan_intervall = 3\ngaits.walk = \"w\"";
        assert!(toml::from_str::<StyleList>(text).is_err());
    }
}
