//! Skeletons as servers share them. What comes from another server goes to no folder.

use std::sync::Arc;

use super::Skeletons;
use super::doc::SkeletonDoc;
use super::store::Own;
use crate::uploads::Record;
use crate::world::UploadMemory;

impl Skeletons {
    /// The record of a skeleton. `None`: there is no such skeleton.
    ///
    /// # Errors
    /// The reason why it cannot be written.
    pub(crate) fn write_shared(&self, name: &str) -> Result<Option<Vec<u8>>, String> {
        let Some(own) = self.all().get(name).cloned() else {
            return Ok(None);
        };
        let body = serde_json::to_vec(&own.doc).map_err(|error| error.to_string())?;
        Record::new(&body).write().map(Some)
    }

    /// Takes in a skeleton of another server. Whether it fits a pack is looked at when it is worn.
    ///
    /// # Errors
    /// The reason why the skeleton is left out, for now: perhaps sessions wear the one before. Then
    /// nothing has changed.
    pub(crate) fn take_shared(&self, name: &str, record: &[u8], memory: &UploadMemory) -> Result<(), String> {
        let record = Record::read(record)?;
        let doc: SkeletonDoc = serde_json::from_slice(record.body).map_err(|error| error.to_string())?;
        if doc.name != name {
            return Err(format!(
                "the record has the name {:?}; allowed: {name:?}",
                doc.name
            ));
        }
        let before = self.all().get(name).cloned();
        if before.as_ref().is_some_and(|before| before.doc == doc) {
            return Ok(());
        }
        let own = Arc::new(Own::new(doc)?);
        self.room(&own, before.as_deref(), memory)
            .map_err(|error| error.to_string())?;
        // While this lock is held, no session begins to wear the one before.
        let mut all = self.changing();
        if let Some(before) = before {
            before.check_unused().map_err(|error| error.to_string())?;
        }
        all.insert(Arc::from(name), own);
        Ok(())
    }

    /// Removes a skeleton that another server has removed. Answers false if sessions wear it: then
    /// it stays.
    pub(crate) fn drop_shared(&self, name: &str) -> bool {
        let mut all = self.changing();
        if all.get(name).is_some_and(|own| own.check_unused().is_err()) {
            return false;
        }
        all.remove(name);
        true
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use troupe_character::testing::{PERSON_HIPS_M, figure_of, joints_of, person};

    use super::super::doc::{BodyDoc, JointsDoc};
    use super::*;

    /// The record of a person's skeleton.
    pub(crate) fn person_record(name: &str, size: f32) -> Vec<u8> {
        let figure = figure_of(joints_of(&person(), size), None, size * PERSON_HIPS_M);
        let doc = SkeletonDoc {
            name: name.to_owned(),
            forced: false,
            notes: Vec::new(),
            body: BodyDoc::Joints(JointsDoc::of(&figure)),
        };
        let body = serde_json::to_vec(&doc).unwrap();
        Record::new(&body).write().unwrap()
    }
}
