//! Records of a scene's objects: where each object is, and which session has it. The scenes
//! themselves are kept as files.

use serde::{Deserialize, Serialize};

use super::Store;
use troupe_character::scene::{Holder, Instance, Scene, SceneError, State, Transform};

/// Version of the record format. Records of other versions are not restored.
const FORMAT: u32 = 1;

/// The objects of a scene.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    format: u32,
    /// [`super::store::KeptScene::content`] when the record was made. A record of other content is
    /// not restored.
    content: u64,
    objects: Vec<Object>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Object {
    id: String,
    definition: String,
    transform: Transform,
    state: Whose,
}

#[derive(Debug, Serialize, Deserialize)]
enum Whose {
    Free,
    ReservedBy(String),
    HeldBy(String),
}

impl Object {
    fn of(instance: &Instance) -> Self {
        let session = |by: &Holder| by.session.to_string();
        Self {
            id: instance.id.to_string(),
            definition: instance.object.to_string(),
            transform: instance.transform,
            state: match &instance.state {
                State::Free => Whose::Free,
                State::Reserved(by) => Whose::ReservedBy(session(by)),
                State::Held(by) => Whose::HeldBy(session(by)),
            },
        }
    }
}

impl Store {
    /// The record of a scene's objects. `None` for a scene that is neither kept as a file nor
    /// shared by servers.
    pub fn record_of(&self, name: &str, scene: &Scene) -> Option<Vec<u8>> {
        let content = self.kept().get(name).map(|file| file.content)?;
        let record = Record {
            format: FORMAT,
            content,
            objects: scene.instances().map(|instance| Object::of(instance)).collect(),
        };
        match postcard::to_allocvec(&record) {
            Ok(bytes) => Some(bytes),
            Err(error) => {
                tracing::error!(scene = name, %error, "the objects of a scene cannot be saved");
                None
            }
        }
    }

    /// Restores the objects of a scene from its record.
    ///
    /// # Errors
    /// The reason why the record cannot be used. Then nothing has changed.
    pub fn restore_scene(&self, name: &str, record: &[u8]) -> Result<(), String> {
        let record: Record = postcard::from_bytes(record).map_err(|error| error.to_string())?;
        if record.format != FORMAT {
            return Err(format!(
                "the record has format {}; allowed: {FORMAT}",
                record.format
            ));
        }
        let content = self.kept().get(name).map(|file| file.content);
        if content != Some(record.content) {
            return Err("the scene's file has changed since the record was written".to_owned());
        }
        let cell = self.scenes().get(name).map_err(|error| error.to_string())?;
        self.definitions()
            .while_unchanged(|definitions| {
                cell.update(|scene| {
                    let body = |name: &str| definitions.get(name).ok().map(|it| it.definition.body.clone());
                    let gone: Vec<_> = (scene.instances())
                        .filter(|there| !record.objects.iter().any(|object| *object.id == *there.id))
                        .map(|there| there.id.clone())
                        .collect();
                    for id in gone {
                        scene.remove(&id)?;
                    }
                    for object in &record.objects {
                        match (scene.instance(&object.id), body(&object.definition)) {
                            (Some(_), _) => scene.move_to(&object.id, object.transform)?,
                            (None, Some(body)) => {
                                scene.add(&object.id, &object.definition, body, object.transform)?;
                            }
                            (None, None) => {
                                tracing::warn!(
                                    scene = name,
                                    object = object.id,
                                    definition = object.definition,
                                    "an object is not restored, because its definition no longer exists"
                                );
                                continue;
                            }
                        }
                        match &object.state {
                            Whose::Free => {}
                            Whose::ReservedBy(by) => scene.reserve(&object.id, &Holder::new(by.as_str()))?,
                            Whose::HeldBy(by) => scene.hold(&object.id, &Holder::new(by.as_str()))?,
                        }
                    }
                    Ok::<_, SceneError>(())
                })
            })
            .map_err(|error| error.to_string())
    }

    /// Frees the objects of all sessions for which `stays` is false.
    pub fn free_all_but(&self, stays: impl Fn(&str) -> bool) {
        for cell in self.scenes().all().values() {
            cell.free_each(|holder| !stays(&holder.session));
        }
    }
}

#[cfg(test)]
#[path = "kept_tests.rs"]
mod tests;
