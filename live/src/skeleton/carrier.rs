//! Packs that plan paths for bodies of other packs.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use troupe_character::style::{Style, StyleTable};
use troupe_motion::model::{Capability, Rig};
use troupe_motion::retarget::RetargetError;

use super::store::Skeletons;
use super::worn::{Worn, figure_of, same};
use crate::packs::{LoadedPack, PackTable};

/// The pack that comes first among those with another body.
const FIRST: &str = "human";
/// The word for how a body usually goes. A pack without such a style has its default one for it.
const USUAL: &str = "walk";
/// Left axes of the same bodies differ by less.
const SAME_AXIS: f32 = 1e-3;
/// Most styles that an error lists.
const LISTED: usize = 32;
/// Most characters of a word that an error repeats.
const MAX_ECHO: usize = 64;

/// Packs among which one is chosen to plan paths for a body of another pack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Among {
    /// Those that plan better than UniMoGen's own network: for robots, of the same body or of a
    /// robot. docs/unimogen.md has the figures, and those of other packs, which are worse.
    Better,
    /// All that walk.
    All,
}

/// A pack that plans paths for a body of another pack.
#[derive(Debug, Clone)]
pub struct Carrier {
    /// Its one skeleton walks.
    pub loaded: Arc<LoadedPack>,
    /// How it walks.
    pub style: Arc<Style>,
    /// The way to the body. None: both are the same body.
    pub worn: Option<Arc<Worn>>,
}

/// Why no pack plans the paths of a body of another pack.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoCarrier {
    /// No pack that walks is loaded.
    #[error("no pack is loaded that walks along paths")]
    NoPack,
    /// The motion of no pack that walks can be carried over.
    #[error("the motion of {pack} cannot be carried over: {why}")]
    Apart {
        /// The first of the packs that walk.
        pack: String,
        /// Why its motion cannot be carried over.
        why: RetargetError,
    },
    /// No pack that walks has the style.
    #[error("no pack that walks has the style {word:?}")]
    NoStyle {
        /// The word that was asked for, cut to 64 characters.
        word: String,
        /// The first of the packs that walk.
        pack: String,
        /// Styles of that pack, at most 32.
        styles: Vec<String>,
    },
}

/// The ways from packs to bodies of other packs, by the body's pack and place and the other pack.
/// A name of a pack has the same bodies as long as the server runs, so there are at most as many as
/// pairs of names.
#[derive(Debug, Default)]
pub(super) struct Ways(Mutex<BTreeMap<(String, usize, String), Way>>);

type Way = Result<Arc<Worn>, RetargetError>;

impl Ways {
    fn all(&self) -> MutexGuard<'_, BTreeMap<(String, usize, String), Way>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The body with index `place` of a pack on the skeleton of `carrier`. The first call for a
    /// pair takes milliseconds.
    fn way(&self, (loaded, place): (&LoadedPack, usize), carrier: &LoadedPack, table: &PackTable) -> Way {
        let key = (
            loaded.pack.name().to_owned(),
            place,
            carrier.pack.name().to_owned(),
        );
        if let Some(known) = self.all().get(&key) {
            return known.clone();
        }
        let name = loaded.pack.bodies.get(place);
        let name = name.map_or_else(|| loaded.pack.name(), |body| &body.name);
        let made = figure_of(loaded, place, table)
            .and_then(|own| Worn::between(name, &own, figure_of(carrier, 0, table)?))
            .map(Arc::new);
        self.all().entry(key).or_insert(made).clone()
    }
}

/// What the order of packs goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Candidate<'a> {
    name: &'a str,
    is_same_body: bool,
    is_robot: bool,
}

impl<'a> Candidate<'a> {
    fn is(self, among: Among, for_robot: bool) -> bool {
        match among {
            Among::Better => for_robot && (self.is_same_body || self.is_robot),
            Among::All => true,
        }
    }

    /// The smallest comes first: the same body, another robot for robots, the pack `human`, and the
    /// first by name.
    fn rank(self, for_robot: bool) -> (bool, bool, bool, &'a str) {
        (
            !self.is_same_body,
            for_robot && !self.is_robot,
            self.name != FIRST,
            self.name,
        )
    }
}

impl Skeletons {
    /// The pack that plans the paths of the body with index `place` of a pack, in the style that
    /// `word` names. None is for the default style. `among` says which packs may. The first call
    /// for a pair of bodies takes milliseconds.
    ///
    /// # Errors
    /// [`NoCarrier`] if none of them can.
    pub fn carrier(
        &self,
        (loaded, place): (&LoadedPack, usize),
        word: Option<&str>,
        table: &PackTable,
        among: Among,
    ) -> Result<Carrier, NoCarrier> {
        let rig = loaded.rig(place);
        let for_robot = rig.skeleton.robot.is_some();
        let may = |pack: &&Arc<LoadedPack>| carries(pack, rig) && candidate(pack, rig).is(among, for_robot);
        let mut packs: Vec<&Arc<LoadedPack>> = table.all().filter(may).collect();
        packs.sort_by_key(|pack| candidate(pack, rig).rank(for_robot));
        let mut error = NoCarrier::NoPack;
        let mut is_first = true;
        for pack in packs {
            let worn = match is_same_body(rig, pack.rig(0)) {
                true => Ok(None),
                false => self.ways.way((loaded, place), pack, table).map(Some),
            };
            let found = match (worn, style(&pack.styles[0], word)) {
                (Ok(worn), Some(style)) => {
                    return Ok(Carrier {
                        loaded: pack.clone(),
                        style,
                        worn,
                    });
                }
                (Err(why), _) => NoCarrier::Apart {
                    pack: pack.pack.name().to_owned(),
                    why,
                },
                (Ok(_), None) => no_style(word.unwrap_or_default(), pack),
            };
            if std::mem::take(&mut is_first) {
                error = found;
            }
        }
        Err(error)
    }
}

/// Whether a body stands on two legs, so that a pack of people or robots may plan its paths.
pub fn is_on_two_legs((loaded, place): (&LoadedPack, usize), table: &PackTable) -> bool {
    figure_of(loaded, place, table).is_ok_and(|figure| !figure.parts().on_fours)
}

/// Whether a pack walks, at the frame rate of a body.
fn carries(pack: &LoadedPack, rig: &Rig) -> bool {
    let has_bodies = !pack.pack.bodies.is_empty() || pack.pack.manifest.capabilities.has(Capability::Path);
    !has_bodies && pack.walks(0) && pack.rig(0).fps == rig.fps
}

fn candidate<'a>(pack: &'a LoadedPack, rig: &Rig) -> Candidate<'a> {
    Candidate {
        name: pack.pack.name(),
        is_same_body: is_same_body(rig, pack.rig(0)),
        is_robot: pack.rig(0).skeleton.robot.is_some(),
    }
}

/// Whether poses of one body are poses of the other: joints, hinges and contacts are the same.
pub fn is_same_body(one: &Rig, other: &Rig) -> bool {
    let (a, b) = (&one.skeleton, &other.skeleton);
    let contacts = |skeleton: &troupe_motion::Skeleton| {
        let contacts = skeleton.contacts.as_ref();
        contacts.map(|contacts| contacts.joints.clone())
    };
    same(one, other)
        && a.robot == b.robot
        && a.left_axis.distance(b.left_axis) < SAME_AXIS
        && contacts(a) == contacts(b)
}

/// The style that a word names.
fn style(styles: &StyleTable, word: Option<&str>) -> Option<Arc<Style>> {
    match word {
        None => styles.default_style(),
        Some(USUAL) => styles.get(USUAL).or_else(|| styles.default_style()),
        Some(word) => styles.get(word),
    }
}

fn no_style(word: &str, pack: &LoadedPack) -> NoCarrier {
    let styles = pack.styles[0].list().into_iter();
    NoCarrier::NoStyle {
        word: word.chars().take(MAX_ECHO).collect(),
        pack: pack.pack.name().to_owned(),
        styles: styles.take(LISTED).map(|style| style.name.clone()).collect(),
    }
}

#[cfg(test)]
#[path = "carrier_tests.rs"]
mod tests;
