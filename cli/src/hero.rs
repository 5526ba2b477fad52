//! Motion of a pack on a character of the user's own: the `--onto` of commands that make motion.

use std::path::{Path, PathBuf};

use clap::Args;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::glb;
use troupe_motion::retarget::{Certificate, Figure, Retargeter, retarget};
use troupe_motion::skeleton::Skeleton;

use crate::context::Context;
use crate::failure::Failure;
use crate::files::{Format, Layout};
use crate::reading::Reading;
use crate::retarget::{character, is_whole, shortened};
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

    /// Write the motion even if what the character keeps of it is beyond the bar.
    #[arg(long, requires = "onto", help_heading = CHARACTER)]
    pub(crate) force: bool,
}

/// A character that was read.
pub(crate) struct Hero<'a> {
    path: &'a Path,
    figure: Figure,
    force: bool,
}

impl OntoHero {
    /// Reads the character, if there is one.
    pub(crate) fn read(&self, term: &Term) -> Result<Option<Hero<'_>>, Failure> {
        let Some(path) = &self.onto else {
            return Ok(None);
        };
        let figure = character(path, self.onto_parts.as_deref(), term)?;
        Ok(Some(Hero {
            path,
            figure,
            force: self.force,
        }))
    }
}

impl Hero<'_> {
    /// Length of the character's legs by those of a pack's skeleton.
    pub(crate) fn scale(&self, from: &Skeleton) -> Result<f32, Failure> {
        let legs_m = Figure::legs_m(from);
        let why = "the legs of the pack's body are not found";
        let legs_m = legs_m.ok_or_else(|| Failure::file(self.path, why))?;
        Ok(self.figure.leg_m() / legs_m)
    }

    /// A clip of a pack's body on the character. `whole` is motion of that body from which its
    /// stance is seen: the clip itself, or more of it.
    pub(crate) fn wear(&self, clip: &Clip, whole: &Clip, term: &Term) -> Result<Clip, Failure> {
        let failure = |why: &dyn std::fmt::Display| Failure::file(self.path, why);
        let source = Figure::of_clip(whole, None, &PartsDoc::default()).map_err(|e| failure(&e))?;
        let retargeter = Retargeter::new(source, self.figure.clone());
        let mut retargeter = retargeter.map_err(|e| failure(&e))?;
        let certified = Certificate::of(&retargeter).faults();
        self.judge(shortened(certified), term)?;
        let (made, figures) = retarget(&mut retargeter, clip).map_err(|e| failure(&e))?;
        self.judge(figures.faults(), term)?;
        Ok(made)
    }

    /// Refuses faults, or notes them with --force.
    fn judge(&self, faults: Vec<String>, term: &Term) -> Result<(), Failure> {
        if !faults.is_empty() && !self.force {
            let why = format!("{}; --force writes the motion all the same", faults.join("; "));
            return Err(Failure::file(self.path, why));
        }
        for fault in faults {
            term.note(format_args!("{}: {fault}", self.path.display()));
        }
        Ok(())
    }
}

/// How motion is written: onto the character's own file, or in a format.
pub(crate) enum Writer<'a> {
    Dress(&'a Path),
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
        if let Some(hero) = hero.filter(|hero| layout.is_none() && is_whole(hero.path) && is_whole(out)) {
            return Ok(Self::Dress(hero.path));
        }
        let format = Format::of_layout(out, layout)?;
        match hero {
            Some(hero) if format.is_for_robots() && hero.figure.skeleton().robot.is_none() => {
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
            Self::Dress(to) => {
                let bytes = std::fs::read(to).map_err(|e| Failure::file(to, e))?;
                let made = glb::add_animation(&bytes, clip, name).map_err(|e| Failure::file(to, e))?;
                std::fs::write(out, made).map_err(|e| Failure::output(out, e))
            }
        }
    }
}
