//! Scenes and object definitions as servers share them. What comes from another server goes to no
//! folder, because folders are each server's own.

use super::store::KeptScene;
use super::{Store, StoreError, definition};
use crate::packs::PackTable;
use crate::uploads::Record;
use troupe_character::document::Format;
use troupe_character::object::DefinitionsError;
use troupe_character::scene::{NamedScene, SceneDoc, TableError};

impl Store {
    /// The record of a scene, with the present places of its objects. `None`: there is no such
    /// scene.
    ///
    /// # Errors
    /// The reason why it cannot be written.
    pub(crate) fn write_scene(&self, name: &str) -> Result<Option<Vec<u8>>, String> {
        let content = self.kept().get(name).map(|kept| kept.content);
        let Ok(cell) = self.scenes().get(name) else {
            return Ok(None);
        };
        let body = serde_json::to_vec(&cell.snapshot().to_doc(name)).map_err(|error| error.to_string())?;
        let record = Record {
            content: content.unwrap_or_default(),
            ..Record::new(&body)
        };
        record.write().map(Some)
    }

    /// Takes in a scene of another server. Objects of an upload that is here keep their places.
    ///
    /// # Errors
    /// The reason why the scene is left out. Then nothing has changed.
    pub(crate) fn take_scene(&self, name: &str, record: &[u8]) -> Result<(), String> {
        let record = Record::read(record)?;
        let mut kept = self.kept();
        let is_same = |kept: &KeptScene| kept.content == record.content;
        if self.scenes().get(name).is_ok() && kept.get(name).is_some_and(is_same) {
            return Ok(());
        }
        let doc: SceneDoc = serde_json::from_slice(record.body).map_err(|error| error.to_string())?;
        check_name(&doc.name, name)?;
        self.definitions().while_unchanged(|definitions| {
            let named = NamedScene::from_doc(doc, definitions).map_err(|error| error.to_string())?;
            let text = |error: StoreError| error.to_string();
            self.room_for_scene(name, &named.scene).map_err(text)?;
            let facts = KeptScene::with(record.content, &named.scene);
            self.show_scene(name, named.scene).map_err(text)?;
            kept.insert(name.to_owned(), facts);
            Ok(())
        })
    }

    /// Removes a scene that another server has removed. Answers false if sessions are in it: then
    /// it stays.
    pub(crate) fn drop_scene(&self, name: &str) -> bool {
        let mut kept = self.kept();
        if let Err(TableError::InUse { .. }) = self.scenes().remove(name) {
            return false;
        }
        kept.remove(name);
        true
    }

    /// The record of a definition. `None`: there is no such definition.
    ///
    /// # Errors
    /// The reason why it cannot be written.
    pub(crate) fn write_definition(&self, name: &str) -> Result<Option<Vec<u8>>, String> {
        let Ok(listed) = self.definitions().get(name) else {
            return Ok(None);
        };
        let body = serde_json::to_vec(&*listed.definition.doc).map_err(|error| error.to_string())?;
        let record = Record {
            pack: &listed.definition.pack,
            ..Record::new(&body)
        };
        record.write().map(Some)
    }

    /// Takes in a definition of another server, for a pack of `table`.
    ///
    /// # Errors
    /// The reason why the definition is left out. Then nothing has changed.
    pub(crate) fn take_definition(&self, name: &str, record: &[u8], table: &PackTable) -> Result<(), String> {
        let record = Record::read(record)?;
        let mut rigs = table.all().map(|loaded| &loaded.pack.rig);
        let rig = rigs.find(|rig| rig.name() == record.pack);
        let rig = rig.ok_or_else(|| format!("its pack {:?} is not loaded", record.pack))?;
        let text = std::str::from_utf8(record.body).map_err(|error| error.to_string())?;
        let read = definition::read_definition(text, Format::Json, name, rig);
        let read = read.map_err(|error| error.to_string())?;
        let _one = self.kept();
        self.room_for_definition(&read)
            .map_err(|error| error.to_string())?;
        let taken = self.definitions().upload(read, self.scenes());
        taken.map(drop).map_err(|error| error.to_string())
    }

    /// Removes a definition that another server has removed. Answers false if scenes have objects
    /// of it: then it stays.
    pub(crate) fn drop_definition(&self, name: &str) -> bool {
        let removed = self.remove_definition(&self.kept(), name);
        !matches!(
            removed,
            Err(StoreError::Definitions(DefinitionsError::InUse { .. }))
        )
    }
}

/// Checks that a record has the upload that the store calls by its name.
fn check_name(found: &str, wanted: &str) -> Result<(), String> {
    match found == wanted {
        true => Ok(()),
        false => Err(format!("the record has the name {found:?}; allowed: {wanted:?}")),
    }
}
