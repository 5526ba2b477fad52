//! Files of roots that a generated motion is to pass.

use std::path::Path;

use glam::Vec2;
use serde::Deserialize;
use toml::Spanned;
use troupe_client::{CONTEXT_FRAMES, RootKey};

use crate::failure::Failure;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    root: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    frame: Spanned<usize>,
    at: Option<Spanned<Vec<f32>>>,
    height_m: Option<f32>,
    heading_deg: Option<f32>,
}

/// Reads the roots of a file, whose frames count as `from` does, the last context frame.
pub(super) fn read_roots(path: &Path, from: usize) -> Result<Vec<RootKey>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    parse(&text, from).map_err(|why| Failure::file(path, why))
}

fn parse(text: &str, from: usize) -> Result<Vec<RootKey>, String> {
    let file: File = toml::from_str(text).map_err(|e| e.to_string())?;
    let start = (from + 1).saturating_sub(CONTEXT_FRAMES);
    let line = |at: usize| text[..at].matches('\n').count() + 1;
    let key = |entry: &Entry| {
        let frame = *entry.frame.get_ref();
        let inside = frame
            .checked_sub(start)
            .and_then(|frame| u32::try_from(frame).ok());
        let Some(inside) = inside else {
            let line = line(entry.frame.span().start);
            return Err(format!(
                "line {line}: frame {frame} is before the segment; allowed: {start} and more"
            ));
        };
        let mut key = RootKey::new(inside);
        if let Some(at) = &entry.at {
            let &[x, z] = &**at.get_ref() else {
                let line = line(at.span().start);
                return Err(format!(
                    "line {line}: `at` is not a place; allowed: [x, z] in metres"
                ));
            };
            key = key.ground(Vec2::new(x, z));
        }
        if let Some(height_m) = entry.height_m {
            key = key.height(height_m);
        }
        if let Some(degrees) = entry.heading_deg {
            key = key.heading(degrees.to_radians());
        }
        Ok(key)
    };
    file.root.iter().map(key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_count_from_the_first_context_frame() {
        let text = "
            [[root]]
            frame = 40
            at = [0.3, 1.5]

            [[root]]
            frame = 50
            at = [0.4, 2]
            height_m = 0.9
            heading_deg = 90
        ";
        let wanted = [
            RootKey::new(13).ground(Vec2::new(0.3, 1.5)),
            RootKey::new(23)
                .ground(Vec2::new(0.4, 2.0))
                .height(0.9)
                .heading(std::f32::consts::FRAC_PI_2),
        ];
        assert_eq!(parse(text, 30).unwrap(), wanted);
        assert_eq!(parse("", 30).unwrap(), []);
    }

    #[test]
    fn errors_name_their_line() {
        let early = parse("[[root]]\nframe = 26\nat = [0, 0]", 30).unwrap_err();
        assert_eq!(
            early,
            "line 2: frame 26 is before the segment; allowed: 27 and more"
        );
        for (text, wanted) in [
            ("[[root]]\nat = [0, 0]", "missing field `frame`"),
            ("[[root]]\nframe = -1\nat = [0, 0]", "line 2"),
            ("[[root]]\nframe = 40\nat = [0, 0, 0]", "line 3"),
            (
                "[[root]]\nframe = 40\nat = [0, 0]\nheight = 1",
                "unknown field `height`",
            ),
        ] {
            let why = parse(text, 30).unwrap_err();
            assert!(why.contains(wanted), "{why}");
        }
    }

    #[test]
    fn the_example_is_read() {
        let file = Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../examples/roots/bend.toml"
        ));
        assert!(!read_roots(file, 30).unwrap().is_empty());
    }
}
