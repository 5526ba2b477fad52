//! Which character to open, as the arguments and the path say.

use clap::Args;
use troupe_client::SessionOptions;

use crate::path::Path;

const CHARACTER: &str = "Character";

/// Which character.
#[derive(Debug, Args)]
pub(crate) struct Character {
    /// Model pack; without it the path's or the server's default.
    #[arg(long, help_heading = CHARACTER, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(crate) pack: String,

    /// Scene of the server to live in; without it the path's, or none.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(crate) scene: Option<String>,

    /// Style to begin with; without it the path's or the pack's.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(crate) style: Option<String>,

    /// The same seed, path and pack give the same frames; without it the path's, or 0.
    #[arg(long, help_heading = CHARACTER)]
    pub(crate) seed: Option<u64>,

    /// 0 takes the most likely poses; above, up to 2, they are sampled with the seed.
    #[arg(long, help_heading = CHARACTER, default_value_t = 0.0, value_name = "0-2")]
    pub(crate) temperature: f32,

    /// Frames between the cursor and the point where a new plan takes over; without it the
    /// server's.
    #[arg(long, help_heading = CHARACTER, value_name = "2-12")]
    pub(crate) look_ahead: Option<u32>,
}

/// The pack that the arguments or else the path ask for; empty for the server's default.
pub(crate) fn pack_of<'a>(path: Option<&'a Path>, character: &'a Character) -> &'a str {
    match (
        character.pack.as_str(),
        path.and_then(|path| path.pack.as_deref()),
    ) {
        ("", Some(pack)) => pack,
        (pack, _) => pack,
    }
}

/// The scene that the arguments or else the path ask for.
pub(crate) fn scene_of<'a>(path: Option<&'a Path>, character: &'a Character) -> Option<&'a str> {
    let of_path = || path.and_then(|path| path.scene.as_deref());
    character.scene.as_deref().or_else(of_path)
}

/// Options of the character that the arguments and the path ask for.
pub(crate) fn options_of(path: Option<&Path>, character: &Character) -> SessionOptions {
    let seed = character.seed.or(path.map(|p| p.seed)).unwrap_or_default();
    let mut options = SessionOptions::new()
        .seed(seed)
        .temperature(character.temperature);
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
    if let Some(frames) = character.look_ahead {
        options = options.look_ahead_frames(frames);
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
