//! The character to open: by the arguments, or else by the path.

use std::path::PathBuf;

use clap::Args;
use troupe_client::SessionOptions;

use crate::path::Path;

const CHARACTER: &str = "Character";

/// Which character.
#[derive(Debug, Args)]
pub(crate) struct Character {
    /// Model pack. Default: the path's, or the server's default pack.
    #[arg(long, help_heading = CHARACTER, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(crate) pack: String,

    /// Scene of the server to live in. Default: the path's, if it has one.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(crate) scene: Option<String>,

    /// First style. Default: the path's, or the pack's.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(crate) style: Option<String>,

    /// The same seed, path and pack give the same frames. Default: the path's, or 0.
    #[arg(long, help_heading = CHARACTER)]
    pub(crate) seed: Option<u64>,

    /// File to write the server's recording of the session to, for `troupe replay`. Not in a scene.
    #[arg(long, help_heading = CHARACTER, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
}

/// The pack of the arguments, or else of the path; empty for the server's default pack.
pub(crate) fn pack_of<'a>(path: Option<&'a Path>, character: &'a Character) -> &'a str {
    match (
        character.pack.as_str(),
        path.and_then(|path| path.pack.as_deref()),
    ) {
        ("", Some(pack)) => pack,
        (pack, _) => pack,
    }
}

/// The scene of the arguments, or else of the path.
pub(crate) fn scene_of<'a>(path: Option<&'a Path>, character: &'a Character) -> Option<&'a str> {
    let of_path = || path.and_then(|path| path.scene.as_deref());
    character.scene.as_deref().or_else(of_path)
}

/// Options of the session, by the arguments or else by the path.
pub(crate) fn options_of(path: Option<&Path>, character: &Character) -> SessionOptions {
    let seed = character.seed.or(path.map(|p| p.seed)).unwrap_or_default();
    let mut options = SessionOptions::new()
        .seed(seed)
        .record(character.record.is_some());
    let style = character.style.as_ref().or(path.and_then(|p| p.style.as_ref()));
    if let Some(style) = style {
        options = options.style(style);
    }
    if let Some(scene) = scene_of(path, character) {
        options = options.scene(scene);
    }
    if let Some(path) = path {
        options = options.at(glam::Vec3::new(path.start.x, 0.0, path.start.y), path.heading);
    }
    options
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Arguments {
        #[command(flatten)]
        character: Character,
    }

    #[test]
    fn a_path_names_the_pack_unless_the_arguments_do() {
        let mut path = Path::parse("[[command]]\ntime_s = 0.0\nspeed = 1.0").unwrap();
        let none = Arguments::parse_from(["troupe"]).character;
        let human = Arguments::parse_from(["troupe", "--pack", "human"]).character;
        assert_eq!(pack_of(Some(&path), &none), "");
        path.pack = Some("g1".to_owned());
        assert_eq!(pack_of(Some(&path), &none), "g1");
        assert_eq!(pack_of(Some(&path), &human), "human");
        assert_eq!(pack_of(None, &human), "human");
    }
}
