//! Motion of a pack on a character of the user's own: the `--onto` of commands that make motion.

use std::path::{Path, PathBuf};

use clap::Args;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::retarget::{Certificate, Figure, Retargeter, retarget};
use troupe_motion::skeleton::Skeleton;

use crate::character::{Character, Hints, is_whole};
use crate::context::Context;
use crate::failure::Failure;
use crate::files::{Format, Layout};
use crate::kept;
use crate::reading::{Reading, unit_m};
use crate::term::Term;

const CHARACTER: &str = "Your character";

/// Whose motion it becomes.
#[derive(Debug, Default, Args)]
pub(crate) struct OntoHero {
    /// Carry the motion over to this character, as `retarget` does: a .glb or .vrm with a skin, a
    /// file of motion on its skeleton, or a robot's .urdf or .xml (MJCF). Places, lengths and
    /// speeds are in its size. A .glb or .vrm to write keeps mesh and skin.
    #[arg(long, value_name = "FILE", help_heading = CHARACTER)]
    pub(crate) onto: Option<PathBuf>,

    /// TOML with the character's parts, for those that are found wrongly. `troupe clip info
    /// --parts` prints what is found.
    #[arg(long, value_name = "FILE", requires = "onto", help_heading = CHARACTER)]
    pub(crate) onto_parts: Option<PathBuf>,

    /// Unit of length of the character's file: m, ft, dm, cmu, in, cm or mm. Default: the one in
    /// which the body has its size.
    #[arg(long, value_name = "UNIT", value_parser = unit_m, requires = "onto", help_heading = CHARACTER)]
    pub(crate) onto_unit: Option<f64>,

    /// Joint that is the character's root. Default: the one that carries the body.
    #[arg(long, value_name = "JOINT", requires = "onto", help_heading = CHARACTER)]
    pub(crate) onto_root: Option<String>,

    /// Write the motion even if what the character keeps of it is beyond the bar.
    #[arg(long, requires = "onto", help_heading = CHARACTER)]
    pub(crate) force: bool,
}

/// A character that was read.
pub(crate) struct Hero<'a> {
    character: Character<'a>,
    force: bool,
}

impl OntoHero {
    /// Reads the character, if there is one.
    pub(crate) fn read(&self, term: &Term) -> Result<Option<Hero<'_>>, Failure> {
        let Some(path) = &self.onto else {
            return Ok(None);
        };
        let hints = Hints {
            parts: self.onto_parts.as_deref(),
            unit_m: self.onto_unit,
            root: self.onto_root.as_deref(),
            option: "onto",
        };
        Ok(Some(Hero {
            character: Character::read(path, hints, term)?,
            force: self.force,
        }))
    }
}

impl Hero<'_> {
    /// Length of the character's legs by those of a pack's skeleton.
    pub(crate) fn scale(&self, from: &Skeleton) -> Result<f32, Failure> {
        let legs_m = Figure::legs_m(from);
        let why = "the legs of the pack's body are not found";
        let legs_m = legs_m.ok_or_else(|| Failure::file(self.character.path, why))?;
        Ok(self.character.figure.leg_m() / legs_m)
    }

    /// A clip of a pack's body on the character. `whole` is motion of that body from which its
    /// stance is seen: the clip itself, or more of it.
    pub(crate) fn wear(&self, clip: &Clip, whole: &Clip, term: &Term) -> Result<Clip, Failure> {
        let failure = |why: &dyn std::fmt::Display| Failure::file(self.character.path, why);
        let source = Figure::of_clip(whole, None, &PartsDoc::default()).map_err(|e| failure(&e))?;
        let retargeter = Retargeter::new(source, self.character.figure.clone());
        let mut retargeter = retargeter.map_err(|e| failure(&e))?;
        let certificate = Certificate::of(&retargeter);
        self.judge(kept::shortened(certificate.faults()), term)?;
        let (made, figures) = retarget(&mut retargeter, clip).map_err(|e| failure(&e))?;
        term.note(kept::table(&figures, &certificate));
        let faults = kept::faults(&mut retargeter, [clip, &made], &figures);
        self.judge(faults.map_err(|e| failure(&e))?, term)?;
        Ok(made)
    }

    /// Refuses faults, or notes them with --force.
    fn judge(&self, faults: Vec<String>, term: &Term) -> Result<(), Failure> {
        if !faults.is_empty() && !self.force {
            let why = format!("{}; --force writes the motion all the same", faults.join("; "));
            return Err(Failure::file(self.character.path, why));
        }
        for fault in faults {
            term.note(format_args!("{}: {fault}", self.character.path.display()));
        }
        Ok(())
    }
}

/// How motion is written: onto the character's own file, or in a format.
pub(crate) enum Writer<'a> {
    Dress(&'a Character<'a>),
    Plain(Format),
}

impl<'a> Writer<'a> {
    /// The writer of a file, checked before any work. Angles of a robot need one, or the pack's
    /// body is checked by `of_pack`.
    pub(crate) fn of(
        out: &Path,
        layout: Option<Layout>,
        hero: Option<&'a Hero<'_>>,
    ) -> Result<Self, Failure> {
        let is_dressed =
            |hero: &&Hero<'_>| layout.is_none() && is_whole(hero.character.path) && is_whole(out);
        if let Some(hero) = hero.filter(is_dressed) {
            return Ok(Self::Dress(&hero.character));
        }
        let format = Format::of_layout(out, layout)?;
        match hero {
            Some(hero) if format.is_for_robots() && hero.character.figure.skeleton().robot.is_none() => {
                let why = "it would hold a robot's angles, but the character is no robot";
                Err(Failure::file(out, why))
            }
            _ => Ok(Self::Plain(format)),
        }
    }

    /// Checks that motion of a server's pack can be written, if it goes onto no character.
    pub(crate) async fn check(
        &self,
        context: &Context,
        pack: &str,
        (out, hero): (&Path, Option<&Hero<'_>>),
    ) -> Result<(), Failure> {
        match (self, hero) {
            (Self::Plain(format), None) => format.check(context, pack, out).await,
            _ => Ok(()),
        }
    }

    /// The same for a known pack.
    pub(crate) fn fits(
        &self,
        pack: &troupe_client::Pack,
        (out, hero): (&Path, Option<&Hero<'_>>),
    ) -> Result<(), Failure> {
        match (self, hero) {
            (Self::Plain(format), None) => format.fits(pack, out),
            _ => Ok(()),
        }
    }

    /// Writes a clip. `name` is that of the animation that a character's file gets.
    pub(crate) fn write(
        &self,
        clip: &Clip,
        out: &Path,
        name: &str,
        reading: &Reading,
    ) -> Result<(), Failure> {
        match self {
            Self::Plain(format) => format.write(clip, out, reading),
            Self::Dress(character) => character.write(clip, out, name),
        }
    }
}
