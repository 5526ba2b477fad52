//! Cast files: several characters and their paths.

use std::path::Path as FilePath;

use serde::Deserialize;
use toml::Spanned;

use super::read::{Check, File};
use super::script::{Path, Timed, When};
use crate::failure::Failure;

/// Characters that live at the same time, checked.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cast {
    pub(crate) title: Option<String>,
    /// Name of the scene on the server that all live in.
    pub(crate) scene: Option<String>,
    /// What each does. All have a style and the cast's scene, and none waits for what comes of what
    /// it does.
    pub(crate) paths: Vec<Path>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CastFile {
    title: Option<String>,
    scene: Option<String>,
    #[serde(default)]
    character: Vec<Spanned<File>>,
}

impl Cast {
    /// Reads a file.
    pub(crate) fn read(file: &FilePath) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
        Self::parse(&text).map_err(|why| Failure::file(file, why))
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// A sentence with the line and field at fault.
    fn parse(text: &str) -> Result<Self, String> {
        let file = toml::from_str::<CastFile>(text).map_err(|e| e.to_string().trim_end().to_owned())?;
        let check = Check { text };
        let mut paths = Vec::with_capacity(file.character.len());
        for character in &file.character {
            let mut path = check
                .path(character.get_ref())
                .map_err(|why| match why.starts_with("line ") {
                    true => why,
                    false => check.fault(character, why),
                })?;
            if path.scene.is_some() {
                let what = "a cast has one scene, and its characters none of their own";
                return Err(check.fault(character, what));
            }
            let is_later = |command: &Timed| !matches!(command.when, When::At(_));
            if path.commands.iter().any(is_later) {
                let what = "each command of a cast needs its time_s";
                return Err(check.fault(character, what));
            }
            if path.style.is_none() {
                return Err(check.fault(character, "style is missing"));
            }
            path.scene.clone_from(&file.scene);
            paths.push(path);
        }
        if paths.is_empty() {
            return Err("there is no [[character]] in it".to_owned());
        }
        Ok(Self {
            title: file.title,
            scene: file.scene,
            paths,
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    const TWO: &str = r#"
title = "Two"
scene = "court"

[[character]]
style = "proud"
start = [1.0, 2.0]
[[character.command]]
time_s = 0.0
speed = 1.2

[[character]]
style = "sad"
[[character.waypoint]]
at = [0.0, 3.0]
speed = 1.0
"#;

    #[test]
    fn each_character_has_its_own_path() {
        let cast = Cast::parse(TWO).unwrap();
        assert_eq!(cast.title.as_deref(), Some("Two"));
        let [one, two] = cast.paths.as_slice() else {
            panic!("{cast:?}")
        };
        assert_eq!(
            (one.start, one.style.as_deref()),
            (Vec2::new(1.0, 2.0), Some("proud"))
        );
        assert_eq!(
            (one.scene.as_deref(), two.scene.as_deref()),
            (Some("court"), Some("court"))
        );
        assert_eq!((one.commands.len(), two.waypoints.len()), (1, 1));
    }

    #[test]
    fn the_example_is_one() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/casts/plaza.toml");
        let cast = Cast::read(FilePath::new(file)).unwrap();
        let robots = cast.paths.iter().filter(|path| path.pack.is_some()).count();
        assert_eq!((cast.paths.len(), robots), (10, 2));
    }

    #[test]
    fn errors_name_their_line() {
        for (text, wanted) in [
            ("title = 'Empty'", "no [[character]]"),
            (
                &TWO.replace("speed = 1.2", "speed = 99.0"),
                "line 10: speed is 99",
            ),
            (
                &format!("{TWO}[[character]]\nstyle = 'sad'\n"),
                "line 17: there is neither",
            ),
            (
                &TWO.replace(
                    "speed = 1.2",
                    "interact = \"cup\"\n[[character.command]]\nafter = \"done\"",
                ),
                "line 5: each command",
            ),
            (
                &TWO.replace("style = \"sad\"", "style = \"sad\"\nscene = \"yard\""),
                "line 12: a cast has one scene",
            ),
            (&TWO.replace("style = \"sad\"", ""), "line 12: style is missing"),
            (&TWO.replace("style", "stile"), "stile"),
        ] {
            let why = Cast::parse(text).unwrap_err();
            assert!(why.contains(wanted), "{wanted}: {why}");
        }
    }
}
