//! Sessions of a store that several servers share. A session opens, or comes here, after this
//! server has its lease. A scene and the sessions in it are on one server, so a session in a scene
//! needs the lease of both.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use super::away::Away;
use super::cell::SessionCell;
use super::coming::Coming;
use super::keep::{RESTORED, restore_session, scene_of};
use super::space::{Spaces, record_name};
use super::{SessionError, Sessions};
use crate::records::Kind;
use crate::records::shared::{Claim, Leases, Want};
use crate::wire::units::is_name;
use crate::world::Store;
use troupe_base::offload::offload;
use troupe_base::telemetry::{Counter, Labels, Telemetry};
use troupe_base::tenant::Tenant;

/// Most sessions that one call brings here.
const MAX_BROUGHT: usize = 4096;
/// Time after which the objects of a scene that came here are free, if the sessions that had them
/// have not come.
const ABSENT: Duration = Duration::from_secs(60);
/// What is said of a store that has been empty until now.
const FILLING: &str = "it has just been empty, and servers may still write their sessions";

/// How a server shares its sessions.
#[derive(Debug)]
pub(super) struct Sharing {
    leases: Arc<Leases>,
    spaces: Weak<Spaces>,
    adopted: Mutex<Vec<Adopted>>,
    coming: Coming,
    /// Records of scenes whose objects are not placed yet. Who waits for one may bring sessions,
    /// but not the other way round.
    placing: Coming,
    restored: Counter,
    left_out: Counter,
}

/// A scene that came here with its objects. Each waits for the session that has it.
#[derive(Debug)]
struct Adopted {
    tenant: Tenant,
    scene: String,
    since: Instant,
}

/// Leases that a call has taken. They are given up if it fails.
#[must_use]
pub(super) struct Taken<'a> {
    leases: Option<&'a Leases>,
    names: Vec<(Kind, String)>,
}

impl Taken<'_> {
    /// The call has succeeded.
    pub(super) fn keep(mut self) {
        self.names.clear();
    }
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        if let Some(leases) = self.leases.filter(|_| !self.names.is_empty()) {
            leases.release(&self.names);
        }
    }
}

impl Sessions {
    /// From now on, sessions are shared by `leases`.
    pub(super) fn share(&self, leases: Arc<Leases>, spaces: &Arc<Spaces>, telemetry: &Telemetry) {
        let counter = |result| telemetry.counter(&RESTORED, &Labels::default().with("result", result));
        self.set_sharing(Sharing {
            leases,
            spaces: Arc::downgrade(spaces),
            adopted: Mutex::default(),
            coming: Coming::default(),
            placing: Coming::default(),
            restored: counter("restored"),
            left_out: counter("left_out"),
        });
    }

    /// Takes the leases of sessions that are about to open. Without a shared store this does
    /// nothing, otherwise it blocks.
    pub(super) fn lease(&self, cells: &[Arc<SessionCell>], world: &Store) -> Result<Taken<'_>, SessionError> {
        match self.sharing() {
            Some(sharing) => sharing.open(self, cells, world),
            None => Ok(Taken {
                leases: None,
                names: Vec::new(),
            }),
        }
    }

    /// Whether other servers use the store, too.
    pub fn are_shared(&self) -> bool {
        self.sharing().is_some()
    }

    /// Takes the lease of a scene before a call changes its objects: they are on one server. An
    /// unknown scene has none. Without a shared store this does nothing, otherwise it may block.
    ///
    /// # Errors
    /// [`SessionError::Elsewhere`] or [`SessionError::NoStore`].
    pub fn own_scene(&self, scene: &str, world: &Store) -> Result<(), SessionError> {
        match self.sharing() {
            Some(sharing) if world.scenes().get(scene).is_ok() => sharing.own_scene(self, scene, world),
            _ => Ok(()),
        }
    }

    /// Brings sessions here from the shared store, if no other server has them. Calls for those
    /// that do not come say why.
    pub async fn bring(self: &Arc<Self>, ids: impl IntoIterator<Item = &String>) {
        let Some(sharing) = self.sharing().filter(|_| !self.is_draining()).cloned() else {
            return;
        };
        let now = self.time().now();
        let lacking = |id: &&String| is_name(id) && self.registry().lacks(id, now);
        let ids: BTreeSet<String> = ids
            .into_iter()
            .filter(lacking)
            .take(MAX_BROUGHT)
            .cloned()
            .collect();
        if ids.is_empty() {
            return;
        }
        let this = self.clone();
        let work = tokio::task::spawn_blocking(move || sharing.bring(&this, ids.into_iter().collect()));
        if let Err(error) = work.await {
            tracing::error!(%error, "sessions were not looked for in the shared store");
        }
    }
}

impl Sessions {
    /// Checks that no other server has a scene, before a call reads its objects here. `field` is
    /// the field of the request that has the name. Without a shared store this does nothing.
    ///
    /// # Errors
    /// [`SessionError::Elsewhere`] or [`SessionError::NoStore`].
    pub async fn check_scene(&self, name: &str, field: &str) -> Result<(), SessionError> {
        let Some(sharing) = self.sharing().filter(|_| !self.is_draining()).cloned() else {
            return Ok(());
        };
        let record = record_name(self.registry().tenant(), name);
        let is_here = sharing.leases.has(Kind::Scene, &record) && !sharing.placing.has(&record);
        if !is_name(name) || is_here {
            return Ok(());
        }
        let (name, field) = (name.to_owned(), field.to_owned());
        offload(usize::MAX, 0, move || {
            drop(sharing.placing.begin(vec![record.clone()], |_| false));
            match sharing.leases.other_owner(Kind::Scene, &record) {
                Ok(None) => Ok(()),
                Ok(Some((owner, ends_in))) => Err(elsewhere("scene", &name, owner, ends_in, field)),
                Err(error) => Err(SessionError::NoStore {
                    reason: error.to_string(),
                    field,
                }),
            }
        })
        .await?
    }
}

impl Sharing {
    fn own_scene(&self, sessions: &Sessions, scene: &str, world: &Store) -> Result<(), SessionError> {
        let tenant = sessions.registry().tenant();
        let name = record_name(tenant, scene);
        let keeps = |name: &str| self.leases.keeps(Kind::Scene, name);
        let placing = self.placing.begin(vec![name.clone()], |name| !keeps(name));
        if placing.ids.is_empty() {
            return Ok(());
        }
        let claims = self.leases.claim(&[(Kind::Scene, name, Want::Any)]);
        let claims = claims.map_err(|error| SessionError::NoStore {
            reason: error.to_string(),
            field: "scene".to_owned(),
        })?;
        for claim in claims {
            if let Some(record) = accepted("scene", scene, "scene".to_owned(), claim)? {
                self.adopt(tenant, scene, &record, world, sessions.time().now());
            }
        }
        Ok(())
    }

    fn open(
        &self,
        sessions: &Sessions,
        cells: &[Arc<SessionCell>],
        world: &Store,
    ) -> Result<Taken<'_>, SessionError> {
        let tenant = sessions.registry().tenant();
        let scenes: BTreeSet<&str> = cells
            .iter()
            .filter_map(|cell| cell.scene())
            .map(|name| &**name)
            .collect();
        let of_scenes = scenes
            .iter()
            .map(|name| (Kind::Scene, record_name(tenant, name), Want::Any));
        let of_cells = cells
            .iter()
            .map(|cell| (Kind::Session, record_name(tenant, cell.id()), Want::New));
        let asked: Vec<_> = of_scenes.chain(of_cells).collect();
        // A session with one of the ids may be coming, and its scene with it.
        let ids = cells.iter().map(|cell| cell.id().to_string());
        let _coming = self.coming.begin(ids.collect(), |_| true);
        let records = scenes.iter().map(|name| record_name(tenant, name));
        let placing = self.placing.begin(records.collect(), |_| true);
        let claims = self.leases.claim(&asked).map_err(|error| SessionError::NoStore {
            reason: error.to_string(),
            field: "sessions".to_owned(),
        })?;
        // All that was taken must be known before the first error.
        let names = asked
            .iter()
            .zip(&claims)
            .filter(|(_, claim)| matches!(claim, Claim::Taken(_)));
        let taken = Taken {
            leases: Some(&self.leases),
            names: names.map(|((kind, name, _), _)| (*kind, name.clone())).collect(),
        };
        let mut claims = claims.into_iter();
        for (scene, claim) in scenes.iter().zip(claims.by_ref()) {
            let index = cells
                .iter()
                .position(|cell| cell.scene().is_some_and(|name| &**name == *scene));
            let field = format!("sessions[{}].scene", index.unwrap_or_default());
            let record = accepted("scene", scene, field, claim)?;
            if let Some(record) = record {
                self.adopt(tenant, scene, &record, world, sessions.time().now());
            }
        }
        drop(placing);
        for (index, (cell, claim)) in cells.iter().zip(claims).enumerate() {
            accepted("session", cell.id(), format!("sessions[{index}].id"), claim)?;
        }
        Ok(taken)
    }

    /// Places the objects of a scene as its last server left them.
    fn adopt(&self, tenant: &Tenant, scene: &str, record: &[u8], world: &Store, now: Instant) {
        match world.restore_scene(scene, record) {
            Ok(()) => self
                .adopted
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(Adopted {
                    tenant: tenant.clone(),
                    scene: scene.to_owned(),
                    since: now,
                }),
            Err(reason) => tracing::warn!(
                scene,
                reason,
                "the objects of a scene cannot be restored and stay as in its file"
            ),
        }
    }

    fn bring(&self, sessions: &Sessions, ids: Vec<String>) {
        let registry = sessions.registry();
        let brought = self
            .coming
            .begin(ids, |id| registry.lacks(id, sessions.time().now()));
        let (ids, now) = (&brought.ids, sessions.time().now());
        if ids.is_empty() {
            return;
        }
        let usual_ttl = Duration::from_millis(sessions.limits().ttl_ms.into());
        if let Err(SessionError::TooMany { open, limit, .. }) = registry.room_for(ids.len(), usual_ttl, now) {
            let away = Away::no_room(open, limit, now);
            ids.iter()
                .for_each(|id| registry.note_away(id, away.clone(), now));
            return;
        }
        let name = |id: &String| record_name(registry.tenant(), id);
        let asked: Vec<_> = ids
            .iter()
            .map(|id| (Kind::Session, name(id), Want::Known))
            .collect();
        let claims = match self.leases.claim(&asked) {
            Ok(claims) => claims,
            Err(error) => {
                let away = Away::no_store(error.to_string(), now);
                ids.iter()
                    .for_each(|id| registry.note_away(id, away.clone(), now));
                return;
            }
        };
        if claims.iter().any(|claim| matches!(claim, Claim::Taken(Some(_)))) {
            self.catch_up();
        }
        for ((id, (_, name, _)), claim) in ids.iter().zip(&asked).zip(claims) {
            match claim {
                Claim::Taken(Some(record)) => self.revive(sessions, id, name, &record),
                Claim::Elsewhere { owner, ends_in } => {
                    registry.note_away(id, Away::of(owner, ends_in, now), now);
                }
                // It was elsewhere, and is closed.
                Claim::Unknown => registry.forget_away(id),
                Claim::Filling => {
                    let away = Away::no_store(FILLING.to_owned(), now);
                    registry.note_away(id, away, now);
                }
                // It is here, or a call opens one of this name.
                Claim::Had | Claim::Taken(None) | Claim::Exists => registry.forget_away(id),
            }
        }
    }

    /// Takes in the newest uploads, which sessions that come here may need.
    fn catch_up(&self) {
        let Some(spaces) = self.spaces.upgrade() else {
            return;
        };
        if let Some(Err(error)) = spaces.uploads().map(|uploads| uploads.round()) {
            tracing::warn!(%error, "sessions come here without the newest uploads");
        }
    }

    /// Opens a session whose lease this server has just taken.
    fn revive(&self, sessions: &Sessions, id: &str, name: &str, record: &[u8]) {
        match self.revived(sessions, name, record) {
            Ok(()) => self.restored.increment(1),
            Err(why) => {
                self.leases.release(&[(Kind::Session, name.to_owned())]);
                let now = sessions.time().now();
                match why {
                    NotRevived::Elsewhere(away) => sessions.registry().note_away(id, away, now),
                    NotRevived::Unfit(reason) => {
                        self.left_out.increment(1);
                        sessions.registry().forget_away(id);
                        tracing::warn!(
                            session = name,
                            reason,
                            "a session of the shared store cannot be restored"
                        );
                    }
                }
            }
        }
    }

    fn revived(&self, sessions: &Sessions, name: &str, record: &[u8]) -> Result<(), NotRevived> {
        let unfit = |reason: &dyn std::fmt::Display| NotRevived::Unfit(reason.to_string());
        let spaces = self.spaces.upgrade().ok_or_else(|| unfit(&"the server stops"))?;
        let tenant = sessions.registry().tenant();
        let space = spaces.of(tenant).map_err(|error| unfit(&error))?;
        if let Some(scene) = scene_of(record) {
            let now = sessions.time().now();
            let record = record_name(tenant, scene);
            let _placing = self.placing.begin(vec![record.clone()], |_| true);
            let asked = [(Kind::Scene, record, Want::Any)];
            let claims = self.leases.claim(&asked).map_err(|error| unfit(&error))?;
            match claims.into_iter().next() {
                Some(Claim::Taken(Some(objects))) => self.adopt(tenant, scene, &objects, &space.store, now),
                Some(Claim::Elsewhere { owner, ends_in }) => {
                    return Err(NotRevived::Elsewhere(Away::of(owner, ends_in, now)));
                }
                _ => {}
            }
        }
        restore_session(&spaces, name, record).map_err(|reason| unfit(&reason))?;
        tracing::info!(session = name, "a session has come from the shared store");
        Ok(())
    }

    /// Frees objects of scenes that came here long ago, if the sessions that had them have not.
    pub(super) fn free_absent(&self, now: Instant) {
        let mut adopted = self.adopted.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = |one: &Adopted| now.saturating_duration_since(one.since) >= ABSENT;
        let due: Vec<Adopted> = adopted.extract_if(.., |one| is_due(one)).collect();
        drop(adopted);
        let Some(spaces) = self.spaces.upgrade() else {
            return;
        };
        for Adopted { tenant, scene, .. } in due {
            if let Some(space) = spaces.known(&tenant)
                && let Ok(cell) = space.store.scenes().get(&scene)
            {
                cell.free_each(|holder| !space.sessions.registry().has(&holder.session));
            }
        }
    }
}

/// Why a session was not restored.
enum NotRevived {
    /// Its scene is on another server.
    Elsewhere(Away),
    /// It cannot be restored here. Its record stays for servers that can.
    Unfit(String),
}

/// The record that a claim brings, or the error for the client.
fn accepted(
    what: &'static str,
    name: &str,
    field: String,
    claim: Claim,
) -> Result<Option<Vec<u8>>, SessionError> {
    match claim {
        Claim::Had => Ok(None),
        Claim::Taken(record) => Ok(record),
        Claim::Elsewhere { owner, ends_in } => Err(elsewhere(what, name, owner, ends_in, field)),
        // Only claims of what is known are answered that it is unknown.
        Claim::Exists | Claim::Unknown | Claim::Filling => Err(SessionError::Exists {
            id: name.to_owned(),
            field,
        }),
    }
}

/// Another server has a session or a scene.
fn elsewhere(
    what: &'static str,
    name: &str,
    owner: String,
    ends_in: Duration,
    field: String,
) -> SessionError {
    SessionError::Elsewhere {
        what,
        name: name.to_owned(),
        owner,
        ends_in_ms: u64::try_from(ends_in.as_millis()).unwrap_or(u64::MAX),
        field,
    }
}

#[cfg(test)]
#[path = "share_tests.rs"]
mod tests;
