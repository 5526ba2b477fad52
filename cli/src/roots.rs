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

/// A root of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Root {
    /// Counted from the first context frame.
    frame: u32,
    at: Option<Vec2>,
    height_m: Option<f32>,
    heading: Option<f32>,
}

impl Root {
    /// The key in a request, with lengths divided by `scale`.
    pub(super) fn key(self, scale: f32) -> RootKey {
        let mut key = RootKey::new(self.frame);
        if let Some(at) = self.at {
            key = key.ground(at / scale);
        }
        if let Some(height_m) = self.height_m {
            key = key.height(height_m / scale);
        }
        if let Some(heading) = self.heading {
            key = key.heading(heading);
        }
        key
    }
}

/// Reads the roots of a file, whose frames count as `from` does, the last context frame.
pub(super) fn read_roots(path: &Path, from: usize) -> Result<Vec<Root>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    parse(&text, from).map_err(|why| Failure::file(path, why))
}

fn parse(text: &str, from: usize) -> Result<Vec<Root>, String> {
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
        let at = match entry.at.as_ref().map(|at| (&**at.get_ref(), at.span())) {
            None => None,
            Some((&[x, z], _)) => Some(Vec2::new(x, z)),
            Some((_, span)) => {
                let line = line(span.start);
                return Err(format!(
                    "line {line}: `at` is not a place; allowed: [x, z] in metres"
                ));
            }
        };
        Ok(Root {
            frame: inside,
            at,
            height_m: entry.height_m,
            heading: entry.heading_deg.map(f32::to_radians),
        })
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
        let keys = |scale: f32| -> Vec<RootKey> {
            let roots = parse(text, 30).unwrap().into_iter();
            roots.map(|root| root.key(scale)).collect()
        };
        assert_eq!(keys(1.0), wanted);
        // Of a character of half the size.
        assert_eq!(keys(0.5)[0], RootKey::new(13).ground(Vec2::new(0.6, 3.0)));
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
