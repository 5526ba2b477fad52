//! Scenes by name, shared by sessions.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use arc_swap::ArcSwap;

use super::resident::{Resident, Residents};
use super::{Holder, MAX_ID_BYTES, MAX_SCENES, Scene};
use crate::document::check::listed;

/// A scene that many read and some change. Reading takes no lock, and never sees half of a change.
#[derive(Debug, Default)]
pub struct SceneCell {
    scene: ArcSwap<Scene>,
    pub(super) residents: Residents,
    /// Held by the one writer.
    writing: Mutex<()>,
}

impl SceneCell {
    /// A cell that holds `scene`.
    pub fn new(scene: Scene) -> Self {
        Self {
            scene: ArcSwap::from_pointee(scene),
            residents: Residents::default(),
            writing: Mutex::new(()),
        }
    }

    /// Number of sessions in the scene.
    pub fn residents(&self) -> usize {
        self.residents.count()
    }

    /// The scene as it is now. The snapshot does not change afterwards.
    pub fn snapshot(&self) -> Arc<Scene> {
        self.scene.load_full()
    }

    /// Changes the scene. Everything that `change` does becomes visible at once, or nothing if it
    /// fails. Put many changes into one call: each call copies the list of instances and the trees.
    ///
    /// # Errors
    /// Those of `change`.
    pub fn update<T, E>(&self, change: impl FnOnce(&mut Scene) -> Result<T, E>) -> Result<T, E> {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scene = Scene::clone(&self.scene.load());
        let answer = change(&mut scene)?;
        self.scene.store(Arc::new(scene));
        Ok(answer)
    }

    /// Frees everything that `by` has reserved or holds. Returns the number of objects.
    pub fn free_all(&self, by: &Holder) -> usize {
        self.free_each(|holder| holder == by)
    }

    /// Frees everything that holders have for whom `gone` is true. Returns the number of objects.
    pub fn free_each(&self, gone: impl Fn(&Holder) -> bool) -> usize {
        let changed = self.update(|scene| match scene.free_all(gone) {
            // A scene with nothing to free is not published again.
            0 => Err(()),
            freed => Ok(freed),
        });
        changed.unwrap_or(0)
    }
}

/// All scenes of a server, by name.
#[derive(Debug, Default)]
pub struct SceneTable {
    scenes: ArcSwap<BTreeMap<String, Arc<SceneCell>>>,
    writing: Mutex<()>,
}

/// Why the table was not changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// The name is too long, or empty.
    #[error("the name of a scene is {0} bytes long; allowed: 1 to {MAX_ID_BYTES} bytes")]
    Name(usize),
    /// A scene of this name exists already.
    #[error("there is a scene {0:?} already")]
    Exists(String),
    /// No scene has this name.
    #[error("there is no scene {name:?}; there are: {}", listed(known.iter().map(String::as_str)))]
    Unknown {
        /// The unknown name.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// Sessions are in the scene.
    #[error("{sessions} sessions are in scene {name:?}; allowed: a scene without sessions")]
    InUse {
        /// Name of the scene.
        name: String,
        /// Number of its sessions.
        sessions: usize,
    },
    /// The table holds [`MAX_SCENES`] scenes.
    #[error("there are {MAX_SCENES} scenes, the most that there may be")]
    Full,
}

impl SceneTable {
    /// The names of all scenes, sorted.
    pub fn names(&self) -> Vec<String> {
        self.scenes.load().keys().cloned().collect()
    }

    /// All scenes by name, as they are now.
    pub fn all(&self) -> Arc<BTreeMap<String, Arc<SceneCell>>> {
        self.scenes.load_full()
    }

    /// The scene of this name.
    ///
    /// # Errors
    /// [`TableError::Unknown`] if there is none.
    pub fn get(&self, name: &str) -> Result<Arc<SceneCell>, TableError> {
        let scenes = self.scenes.load();
        scenes.get(name).cloned().ok_or_else(|| unknown(name, &scenes))
    }

    /// Registers a session in the scene of this name. The scene cannot be removed while the
    /// [`Resident`] exists.
    ///
    /// # Errors
    /// [`TableError::Unknown`] if there is no such scene.
    pub fn enter(&self, name: &str) -> Result<Resident, TableError> {
        let cell = self.get(name)?;
        Resident::enter(name, &cell).ok_or_else(|| unknown(name, &self.scenes.load()))
    }

    /// Checks that a scene of this name exists, or could be added.
    ///
    /// # Errors
    /// [`TableError::Name`] or [`TableError::Full`] if not.
    pub fn room_for(&self, name: &str) -> Result<(), TableError> {
        let scenes = self.scenes.load();
        match name.len() {
            1..=MAX_ID_BYTES if scenes.contains_key(name) || scenes.len() < MAX_SCENES => Ok(()),
            1..=MAX_ID_BYTES => Err(TableError::Full),
            length => Err(TableError::Name(length)),
        }
    }

    /// Adds a scene.
    ///
    /// # Errors
    /// [`TableError::Exists`], [`TableError::Name`] or [`TableError::Full`].
    pub fn add(&self, name: &str, scene: Scene) -> Result<Arc<SceneCell>, TableError> {
        self.change(|scenes| {
            if scenes.contains_key(name) {
                return Err(TableError::Exists(name.to_owned()));
            }
            self.room_for(name)?;
            let cell = Arc::new(SceneCell::new(scene));
            scenes.insert(name.to_owned(), Arc::clone(&cell));
            Ok(cell)
        })
    }

    /// Removes a scene without sessions.
    ///
    /// # Errors
    /// [`TableError::Unknown`] or [`TableError::InUse`].
    pub fn remove(&self, name: &str) -> Result<Arc<SceneCell>, TableError> {
        self.change(|scenes| {
            let cell = scenes.get(name).ok_or_else(|| unknown(name, scenes))?;
            let in_use = |sessions| TableError::InUse {
                name: name.to_owned(),
                sessions,
            };
            cell.residents.close().map_err(in_use)?;
            scenes.remove(name).ok_or_else(|| unknown(name, scenes))
        })
    }

    fn change<T>(
        &self,
        change: impl FnOnce(&mut BTreeMap<String, Arc<SceneCell>>) -> Result<T, TableError>,
    ) -> Result<T, TableError> {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scenes = BTreeMap::clone(&self.scenes.load());
        let answer = change(&mut scenes)?;
        self.scenes.store(Arc::new(scenes));
        Ok(answer)
    }
}

fn unknown(name: &str, scenes: &BTreeMap<String, Arc<SceneCell>>) -> TableError {
    TableError::Unknown {
        name: name.chars().take(MAX_ID_BYTES).collect(),
        known: scenes.keys().cloned().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{boxed, place};
    use super::super::{SceneError, Transform};
    use super::*;

    #[test]
    fn a_snapshot_does_not_change_and_a_failed_change_has_no_effect() {
        let cell = SceneCell::new(Scene::new(0.0).unwrap());
        cell.update(|scene| scene.add("crate", "crate", boxed(0.5), place(1.0, 0.5, 2.0)))
            .unwrap();
        let before = cell.snapshot();
        let failed = cell.update(|scene| {
            scene.move_to("crate", place(5.0, 0.5, 5.0))?;
            scene.remove("no such object")
        });
        assert!(matches!(failed, Err(SceneError::Unknown { .. })));
        assert_eq!(cell.snapshot().revision(), before.revision());
        cell.update(|scene| scene.move_to("crate", place(5.0, 0.5, 5.0)))
            .unwrap();
        assert_eq!(before.instance("crate").unwrap().transform, place(1.0, 0.5, 2.0));
        assert_eq!(
            cell.snapshot().instance("crate").unwrap().transform,
            place(5.0, 0.5, 5.0)
        );
    }

    #[test]
    fn one_of_two_sessions_gets_an_object() {
        use super::super::Holder;
        let cell = SceneCell::new(Scene::new(0.0).unwrap());
        cell.update(|scene| scene.add("crate", "crate", boxed(0.5), Transform::IDENTITY))
            .unwrap();
        let got = std::thread::scope(|threads| {
            let tries: Vec<_> = (0..8)
                .map(|index| {
                    let cell = &cell;
                    threads.spawn(move || {
                        let by = Holder::new(index.to_string());
                        cell.update(|scene| scene.reserve("crate", &by)).is_ok()
                    })
                })
                .collect();
            tries
                .into_iter()
                .map(|one| one.join().unwrap())
                .filter(|&ok| ok)
                .count()
        });
        assert_eq!(got, 1);
    }

    #[test]
    fn scenes_are_found_by_name() {
        let table = SceneTable::default();
        let error = table.get("hall").unwrap_err();
        assert_eq!(error.to_string(), "there is no scene \"hall\"; there are: none");
        let yard = table.add("yard", Scene::default()).unwrap();
        assert!(Arc::ptr_eq(&yard, &table.get("yard").unwrap()));
        assert_eq!(
            table.add("yard", Scene::default()).unwrap_err(),
            TableError::Exists("yard".into())
        );
        assert_eq!(table.add("", Scene::default()).unwrap_err(), TableError::Name(0));
        let error = table.get("hall").unwrap_err();
        assert_eq!(error.to_string(), "there is no scene \"hall\"; there are: yard");
        for index in 1..MAX_SCENES {
            table.add(&format!("s{index}"), Scene::default()).unwrap();
        }
        assert_eq!(table.add("more", Scene::default()).unwrap_err(), TableError::Full);
        table.remove("yard").unwrap();
        assert!(table.get("yard").is_err() && table.names().len() == MAX_SCENES - 1);
    }

    #[test]
    fn a_scene_with_sessions_cannot_be_removed() {
        let table = SceneTable::default();
        table.add("yard", Scene::default()).unwrap();
        let (one, other) = (table.enter("yard").unwrap(), table.enter("yard").unwrap());
        assert_eq!((&**one.name(), one.cell().residents()), ("yard", 2));
        drop(one);
        let in_use = TableError::InUse {
            name: "yard".to_owned(),
            sessions: 1,
        };
        assert_eq!(table.remove("yard").unwrap_err(), in_use);
        drop(other);
        let cell = table.remove("yard").unwrap();
        assert!(matches!(table.enter("yard"), Err(TableError::Unknown { .. })));
        // A session that found the scene just before its removal cannot enter it any more.
        assert!(Resident::enter("yard", &cell).is_none() && cell.residents() == 0);
    }
}
