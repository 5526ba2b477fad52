//! Loading of kept sessions, for fuzz targets.

use crate::{Service, ServiceError};
use troupe_character::Path;
use troupe_character::live::World;
use troupe_character::saved::Surroundings;
use troupe_character::scene::Holder;
use troupe_live::session::{Space, read_record};
use troupe_live::world::WorldError;

impl Service {
    /// Reads the record of a session like the server does when it starts.
    ///
    /// # Errors
    /// Why the server would skip the session.
    pub fn read_session(&self, id: &str, record: &[u8]) -> Result<(), String> {
        let space = self.space().map_err(|error| error.to_string())?;
        read_record(id, record, &space.packs, &space.store)
    }

    /// The surroundings of a character of `pack` in `scene`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such pack or scene.
    pub fn surroundings(&self, pack: &str, scene: &str, session: &str) -> Result<Surroundings, ServiceError> {
        let Space { packs, store, .. } = &**self.space()?;
        let pack = packs.find(&Path::root(), pack, "")?;
        let cell = store.scenes().get(scene).map_err(|error| WorldError::Scene {
            error,
            field: "scene".to_owned(),
        })?;
        Ok(Surroundings {
            rig: pack.rig().clone(),
            styles: pack.styles(),
            skills: pack.loaded().skills.clone(),
            world: Some(World {
                scene: cell,
                definitions: store.definitions().clone(),
                holder: Holder::new(session),
                scale: 1.0,
            }),
        })
    }
}
