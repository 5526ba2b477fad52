//! The styles of one pack: its own, and those that users added.

use std::collections::BTreeMap;
use std::path::{Path as FilePath, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use arc_swap::ArcSwap;
use troupe_motion::Skeleton;

use super::file::{self, StyleError, StyleProblem, load_folder};
use super::takes::{self, Take};
use super::{PLAIN, Style, aside};
use troupe_motion::model::Rig;

/// Most styles that users may add to a pack.
pub const MAX_ADDED_STYLES: usize = 256;
/// Folder of a pack's own styles inside the pack's folder.
const FOLDER: &str = "styles";
/// The style of sessions that name none, if the pack has it.
const PREFERRED_DEFAULT: &str = "normal";
/// The same for a pack whose styles are words.
const PREFERRED_WORD: &str = "walk";

type Styles = BTreeMap<String, Arc<Style>>;

/// The styles of one pack. Reading takes no lock, and never sees half of a change. A session keeps
/// its style when the style is replaced.
#[derive(Debug)]
pub struct StyleTable {
    pack: String,
    skeleton: Arc<Skeleton>,
    takes: ArcSwap<Arc<[Take]>>,
    styles: ArcSwap<Styles>,
    /// Where added styles are kept for the next start; none if they are not.
    folder: Option<PathBuf>,
    /// Held by the one writer.
    writing: Mutex<()>,
}

impl crate::saved::Styles for StyleTable {
    fn find(&self, name: &str) -> Option<Arc<Style>> {
        self.get(name)
    }
}

/// No style has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.text())]
pub struct UnknownStyle {
    /// Name of the pack.
    pub pack: String,
    /// The unknown name. Empty if the default was asked for and the pack has none.
    pub name: String,
    /// The names that exist.
    pub known: Vec<String>,
}

impl UnknownStyle {
    fn text(&self) -> String {
        let Self { pack, name, known } = self;
        if known.is_empty() {
            format!("pack {pack} has no styles; add one, or give the pack a folder {FOLDER}/")
        } else {
            format!("pack {pack} has no style {name:?}; it has {}", known.join(", "))
        }
    }
}

/// Why a style was not added.
#[derive(Debug, thiserror::Error)]
pub enum PutError {
    /// The name belongs to one of the pack's own styles.
    #[error("style {0:?} came with the pack and cannot be replaced")]
    BuiltIn(String),
    /// The pack has [`MAX_ADDED_STYLES`] added styles.
    #[error("the pack has {MAX_ADDED_STYLES} added styles, the most that it may have")]
    TooMany,
    /// The style could not be written to the folder of added styles.
    #[error("style {name:?} cannot be written to its folder: {cause}")]
    Keep {
        /// Name of the style.
        name: String,
        /// The file system's error.
        cause: std::io::Error,
    },
}

impl StyleTable {
    /// Loads the pack's own styles from the folder `styles` inside `pack_folder`, and added styles
    /// from `folder`/`pack name`. Either folder may be missing. Without `folder`, added styles last
    /// until the server stops.
    ///
    /// # Errors
    /// [`StyleError`] with the file and what is wrong with it.
    pub fn load(rig: &Rig, pack_folder: &FilePath, folder: Option<PathBuf>) -> Result<Self, StyleError> {
        let own = match &rig.by_path {
            Some(body) => Style::all_of(body),
            None => load_folder(&pack_folder.join(FOLDER), rig, true)?,
        };
        let takes = match rig.by_path {
            Some(_) => Arc::default(),
            None => takes::load(pack_folder, &rig.skeleton)?,
        };
        let own = own.into_iter().map(|style| ready(style, &rig.skeleton, &takes));
        Self::with_added(own.collect(), takes, rig, folder)
    }

    /// A table with the same styles of the pack, and its own added styles, kept in
    /// `folder`/`pack name`.
    ///
    /// # Errors
    /// [`StyleError`], as [`StyleTable::load`].
    pub fn beside(&self, rig: &Rig, folder: Option<PathBuf>) -> Result<Self, StyleError> {
        let mut own = Styles::clone(&self.styles.load());
        own.retain(|_, style| style.built_in);
        Self::with_added(own, Arc::clone(&self.takes.load()), rig, folder)
    }

    fn with_added(
        mut own: Styles,
        takes: Arc<[Take]>,
        rig: &Rig,
        folder: Option<PathBuf>,
    ) -> Result<Self, StyleError> {
        let folder = folder.map(|folder| folder.join(rig.name()));
        let mut added = match &folder {
            Some(folder) => load_folder(folder, rig, false)?,
            None => Vec::new(),
        };
        let wrong = |path: PathBuf, problem| Err(StyleError { path, problem });
        if added.len() > MAX_ADDED_STYLES {
            return wrong(
                folder.unwrap_or_default(),
                StyleProblem::TooMany(MAX_ADDED_STYLES),
            );
        }
        added.retain(|style| {
            let taken = own.contains_key(&style.name);
            if taken {
                let path = folder
                    .clone()
                    .unwrap_or_default()
                    .join(format!("{}.json", style.name));
                let problem = StyleProblem::BuiltIn;
                tracing::warn!(error = %StyleError { path, problem }, "skipped a style that cannot be used");
            }
            !taken
        });
        own.extend((added.into_iter()).map(|style| ready(style, &rig.skeleton, &takes)));
        Ok(Self {
            pack: rig.name().to_owned(),
            skeleton: Arc::clone(&rig.skeleton),
            takes: ArcSwap::from_pointee(takes),
            styles: ArcSwap::from_pointee(own),
            folder,
            writing: Mutex::new(()),
        })
    }

    /// The style of this name.
    pub fn get(&self, name: &str) -> Option<Arc<Style>> {
        self.styles.load().get(name).cloned()
    }

    /// All styles, sorted by name.
    pub fn list(&self) -> Vec<Arc<Style>> {
        self.styles.load().values().cloned().collect()
    }

    /// The style of sessions that name none: `normal`, or the first by name if the pack has no such
    /// style. If styles are words: `walk` or none.
    pub fn default_style(&self) -> Option<Arc<Style>> {
        let styles = self.styles.load();
        let of_words = styles.values().any(|style| style.words.is_some());
        let preferred = match of_words {
            true => styles.get(PREFERRED_WORD).or_else(|| styles.get(PLAIN)),
            false => styles.get(PREFERRED_DEFAULT),
        };
        preferred.or_else(|| styles.values().next()).cloned()
    }

    /// The style of this name, or the default style for an empty name.
    ///
    /// # Errors
    /// [`UnknownStyle`] with the names that exist. A pack need not have styles.
    pub fn resolve(&self, name: &str) -> Result<Arc<Style>, UnknownStyle> {
        let style = if name.is_empty() {
            self.default_style()
        } else {
            self.get(name)
        };
        style.ok_or_else(|| UnknownStyle {
            pack: self.pack.clone(),
            name: name.to_owned(),
            known: self.styles.load().keys().cloned().collect(),
        })
    }

    /// Adds a checked style, or replaces an added one. Blocks while it writes the style to the
    /// folder of added styles, if there is one.
    ///
    /// # Errors
    /// [`PutError`]; then nothing has changed.
    pub fn put(&self, style: Style) -> Result<Arc<Style>, PutError> {
        self.add(style, self.folder.as_deref())
    }

    /// As [`StyleTable::put`], for a style that another server has added. It goes to no folder.
    ///
    /// # Errors
    /// [`PutError`]; then nothing has changed.
    pub fn take(&self, style: Style) -> Result<Arc<Style>, PutError> {
        self.add(style, None)
    }

    fn add(&self, style: Style, folder: Option<&FilePath>) -> Result<Arc<Style>, PutError> {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut styles = Styles::clone(&self.styles.load());
        let added = styles.values().filter(|style| !style.built_in).count();
        match styles.get(&style.name) {
            Some(there) if there.built_in => return Err(PutError::BuiltIn(style.name)),
            None if added >= MAX_ADDED_STYLES => return Err(PutError::TooMany),
            _ => {}
        }
        let style = Style {
            built_in: false,
            ..style
        };
        if let Some(folder) = folder {
            file::write_file(folder, &style).map_err(|cause| PutError::Keep {
                name: style.name.clone(),
                cause,
            })?;
        }
        let (name, style) = ready(style, &self.skeleton, &self.takes.load());
        styles.insert(name, Arc::clone(&style));
        self.styles.store(Arc::new(styles));
        Ok(style)
    }

    /// Replaces the pack's own styles with those of `newer`, the table of another version of the
    /// pack with the same skeleton. Added styles stay, except those with a name that the pack's own
    /// styles now have.
    pub fn renew(&self, newer: &Self) {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let takes = newer.takes.load_full();
        let mut styles = Styles::clone(&newer.styles.load());
        styles.retain(|_, style| style.built_in);
        for (name, style) in &**self.styles.load() {
            if style.built_in || styles.contains_key(name) {
                continue;
            }
            let mut style = Style::clone(style);
            if style.words.is_none() {
                style.takes = Arc::clone(&takes);
            }
            styles.insert(name.clone(), Arc::new(style));
        }
        self.takes.store(takes);
        self.styles.store(Arc::new(styles));
    }
}

/// A style with everything that planning needs of it.
fn ready(mut style: Style, skeleton: &Skeleton, takes: &Arc<[Take]>) -> (String, Arc<Style>) {
    style.gaits.extend(aside::build(&style, skeleton));
    if style.words.is_none() {
        style.takes = Arc::clone(takes);
    }
    style.cycles(skeleton);
    (style.name.clone(), Arc::new(style))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::{TempFolder, walker_rig, walker_style};

    fn named(name: &str) -> Style {
        Style {
            name: name.to_owned(),
            ..walker_style()
        }
    }

    /// The table of a pack whose folder has the styles `names`, with added styles in another
    /// folder.
    fn table_with(
        folder: &TempFolder,
        names: &[&str],
        added: Option<PathBuf>,
    ) -> Result<StyleTable, StyleError> {
        for name in names {
            file::write_file(&folder.path().join(FOLDER), &named(name)).unwrap();
        }
        StyleTable::load(&walker_rig(), folder.path(), added)
    }

    #[test]
    fn a_pack_without_styles_has_an_empty_table_that_says_so() {
        let folder = TempFolder::new("no-styles");
        let table = table_with(&folder, &[], None).unwrap();
        assert!(table.list().is_empty() && table.default_style().is_none());
        let error = table.resolve("").unwrap_err();
        assert!(error.to_string().contains("walkers has no styles"), "{error}");
        table.put(named("mine")).unwrap();
        assert_eq!(table.resolve("").unwrap().name, "mine");
    }

    #[test]
    fn another_version_brings_its_own_styles_and_leaves_the_added_ones() {
        let (old, new) = (TempFolder::new("renew-old"), TempFolder::new("renew-new"));
        let table = table_with(&old, &["brisk", "gone"], None).unwrap();
        table.put(named("mine")).unwrap();
        table.put(named("taken")).unwrap();
        table.renew(&table_with(&new, &["brisk", "taken"], None).unwrap());
        let listed: Vec<_> = (table.list().iter())
            .map(|style| (style.name.clone(), style.built_in))
            .collect();
        let expected = [("brisk", true), ("mine", false), ("taken", true)];
        assert_eq!(listed, expected.map(|(name, own)| (name.to_owned(), own)));
        assert!(matches!(table.put(named("taken")), Err(PutError::BuiltIn(_))));
        table.put(named("mine")).unwrap();
    }

    #[test]
    fn the_default_is_normal_or_the_first() {
        let folder = TempFolder::new("default-style");
        let table = table_with(&folder, &["zany", "brisk"], None).unwrap();
        assert_eq!(table.default_style().unwrap().name, "brisk");
        table.put(named("normal")).unwrap();
        assert_eq!(table.resolve("").unwrap().name, "normal");
        let error = table.resolve("zen").unwrap_err();
        assert_eq!(error.known, ["brisk", "normal", "zany"]);
        assert!(
            error
                .to_string()
                .contains("no style \"zen\"; it has brisk, normal, zany")
        );
    }

    #[test]
    fn built_in_styles_stay_and_added_ones_are_replaced_and_kept() {
        let (folder, added) = (TempFolder::new("own-styles"), TempFolder::new("added-styles"));
        let load = || table_with(&folder, &["normal"], Some(added.path().to_owned()));
        let table = load().unwrap();
        assert!(table.get("normal").unwrap().built_in);
        assert!(matches!(table.put(named("normal")), Err(PutError::BuiltIn(name)) if name == "normal"));

        let first = table.put(named("mine")).unwrap();
        assert!(!first.built_in);
        let mut faster = named("mine");
        faster.default_speed_mps = 2.5;
        faster.built_in = true;
        table.put(faster).unwrap();
        assert_eq!(
            first.default_speed_mps,
            walker_style().default_speed_mps,
            "a session keeps its style"
        );
        let again = load().unwrap().get("mine").unwrap();
        assert_eq!(
            (again.default_speed_mps, again.built_in),
            (2.5, false),
            "kept over a restart"
        );

        // A name that the pack has taken since, and a file that is not a style, are skipped.
        let folder = added.path().join("walkers");
        file::write_file(&folder, &named("normal")).unwrap();
        std::fs::write(folder.join("broken.json"), "{").unwrap();
        let again = load().unwrap();
        assert!(again.get("normal").unwrap().built_in);
        assert!(again.get("broken").is_none() && again.get("mine").is_some());

        // A style of another server is not kept.
        again.take(named("theirs")).unwrap();
        assert!(again.get("theirs").is_some() && load().unwrap().get("theirs").is_none());
    }

    #[test]
    fn the_number_of_added_styles_is_bounded() {
        let folder = TempFolder::new("many-styles");
        let table = table_with(&folder, &["normal"], None).unwrap();
        for index in 0..MAX_ADDED_STYLES {
            table.put(named(&format!("style-{index}"))).unwrap();
        }
        assert!(matches!(table.put(named("one-more")), Err(PutError::TooMany)));
        table.put(named("style-7")).unwrap();
        assert_eq!(table.list().len(), MAX_ADDED_STYLES + 1);
    }

    #[test]
    fn a_style_that_cannot_be_kept_is_not_added() {
        let folder = TempFolder::new("blocked-styles");
        let file = folder.path().join("file");
        std::fs::write(&file, "in the way").unwrap();
        let table = table_with(&folder, &["normal"], None).unwrap();
        let table = StyleTable {
            folder: Some(file),
            ..table
        };
        assert!(matches!(table.put(named("mine")), Err(PutError::Keep { .. })));
        assert!(table.get("mine").is_none());
    }
}
