//! A character of the user's own: its file, its body, and motion written onto it.

use std::path::Path;

use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::glb::{self, FileJoints};
use troupe_motion::read::{OptionName, Options, Understood};
use troupe_motion::retarget::Figure;

use crate::clip::Onto;
use crate::failure::Failure;
use crate::term::{Term, plain};
use crate::understand::{ending, note_as, understand_character};

/// What decides how a character's file is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hints<'a> {
    /// TOML with the character's parts.
    pub(crate) parts: Option<&'a Path>,
    /// Metres a unit of the file.
    pub(crate) unit_m: Option<f64>,
    /// Joint that is the root.
    pub(crate) root: Option<&'a str>,
    /// The option that names the file, without dashes: those of unit and root begin with it.
    pub(crate) option: &'static str,
}

/// A character that was read.
pub(crate) struct Character<'a> {
    pub(crate) path: &'a Path,
    pub(crate) figure: Figure,
    /// Where the body's joints are in the file. Files of robots are not written to.
    joints: FileJoints,
}

impl<'a> Character<'a> {
    /// Reads a character's file, and notes what was understood of it.
    ///
    /// # Errors
    /// [`Failure::Input`] with the file, what is wrong with it, and the option that decides.
    pub(crate) fn read(path: &'a Path, hints: Hints<'_>, term: &Term) -> Result<Self, Failure> {
        if matches!(ending(path).as_deref(), Some("urdf" | "xml")) {
            let skeleton = Onto::robot_of(path, &[], &[])?;
            let doc = read_parts(hints.parts)?;
            let figure = Figure::of_robot(skeleton.into(), &doc);
            let figure = figure.map_err(|why| Failure::file(path, plain(&why.to_string())))?;
            let joints = FileJoints::default();
            return Ok(Self { path, figure, joints });
        }
        let options = Options {
            unit_m: hints.unit_m,
            root: hints.root.map(str::to_owned),
            ..Options::default()
        };
        let words = |text: &str| reworded(text, hints.option);
        let found = understand_character(path, options);
        let found = found.map_err(|why| Failure::file(path, words(&why.to_string())))?;
        note_as(path, &found.report, term, &words);
        Ok(Self {
            path,
            figure: figure(path, &found, hints.parts)?,
            joints: found.file_joints(),
        })
    }

    /// Writes the character's file with a clip on its skeleton as one more animation.
    ///
    /// # Errors
    /// [`Failure::Input`] if the file takes none, and [`Failure::Other`] if it cannot be written.
    pub(crate) fn write(&self, clip: &Clip, out: &Path, name: &str) -> Result<(), Failure> {
        let bytes = std::fs::read(self.path).map_err(|e| Failure::file(self.path, e))?;
        let made = glb::add_animation_at(&bytes, &self.joints, clip, name);
        let made = made.map_err(|e| Failure::file(self.path, e))?;
        std::fs::write(out, made).map_err(|e| Failure::output(out, e))
    }
}

/// Whether a file can hold a character with its mesh and skin.
pub(crate) fn is_whole(path: &Path) -> bool {
    matches!(ending(path).as_deref(), Some("glb" | "vrm"))
}

/// The body of a file. `parts` is a file with corrections.
///
/// # Errors
/// [`Failure::Input`] with the file, and what of the body is not found.
pub(crate) fn figure(path: &Path, found: &Understood, parts: Option<&Path>) -> Result<Figure, Failure> {
    let figure = found.figure(&read_parts(parts)?);
    figure.map_err(|why| Failure::file(parts.unwrap_or(path), plain(&why.to_string())))
}

/// Corrections of a body's parts.
fn read_parts(path: Option<&Path>) -> Result<PartsDoc, Failure> {
    let Some(path) = path else {
        return Ok(PartsDoc::default());
    };
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    toml::from_str(&text).map_err(|e| Failure::file(path, e))
}

/// The reader's advice with the options of a character: `--to-unit` for `--unit`. What it has no
/// option for, `troupe clip convert` has.
fn reworded(text: &str, option: &str) -> String {
    let of_character = [OptionName::Unit, OptionName::Root];
    let mut made = of_character.iter().fold(text.to_owned(), |text, of| {
        text.replace(of.flag(), &format!("--{option}-{}", of.name()))
    });
    let mut others = OptionName::all().filter(|of| !of_character.contains(of));
    if others.any(|of| text.contains(of.flag())) {
        made += "; `troupe clip convert` has the option, and writes a file that needs none";
    }
    made
}

#[cfg(test)]
mod tests {
    use troupe_motion::glb::write_glb;

    use super::*;

    const NONE: Hints<'_> = Hints {
        parts: None,
        unit_m: None,
        root: None,
        option: "to",
    };

    #[test]
    fn advice_names_options_that_the_command_has() {
        assert_eq!(
            reworded("the unit is unclear; --unit m or --unit cm decides", "to"),
            "the unit is unclear; --to-unit m or --to-unit cm decides"
        );
        assert_eq!(
            reworded("--root Hips decides", "onto"),
            "--onto-root Hips decides"
        );
        let up = reworded("the axis is unclear; --up y or --up z decides", "to");
        assert!(up.contains("--up z decides; `troupe clip convert` has"), "{up}");
    }

    /// The walk of the examples as a character's file, `scale` times as large.
    fn hero(scale: f32) -> Vec<u8> {
        let walk = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/walk.bvh");
        let mut clip = understand_character(&walk, Options::default()).unwrap().clip;
        let skeleton = std::sync::Arc::make_mut(&mut clip.skeleton);
        skeleton
            .joints
            .iter_mut()
            .for_each(|joint| joint.offset_m *= scale);
        clip.root_positions.iter_mut().for_each(|root| *root *= scale);
        write_glb(&clip).unwrap()
    }

    #[test]
    fn a_unit_that_is_unclear_is_decided_by_the_characters_option() {
        let path = std::env::temp_dir().join(format!("troupe-character-{}.glb", std::process::id()));
        // About 26 m tall in metres, and 26 cm in centimetres.
        std::fs::write(&path, hero(15.0)).unwrap();
        let term = Term::new(true);
        let failure = Character::read(&path, NONE, &term).err().unwrap().to_string();
        assert!(
            failure.contains("--to-unit cm or --to-unit m decides"),
            "{failure}"
        );
        let hints = Hints {
            unit_m: Some(0.01),
            ..NONE
        };
        let read = Character::read(&path, hints, &term).unwrap();
        assert_eq!(read.joints.unit_m, 0.01);
        let wrong = Hints {
            root: Some("Tie"),
            ..hints
        };
        let failure = Character::read(&path, wrong, &term).err().unwrap().to_string();
        assert!(failure.contains("--to-root is \"Tie\""), "{failure}");
        std::fs::remove_file(path).unwrap();
    }
}
