//! Sessions and scenes that another server has taken over.

use super::{Keeper, Stamp};
use crate::records::{Kind, Lost, Tended};
use crate::session::away::Away;
use crate::session::space::of_record;

impl Keeper {
    /// Ends what another server has taken over, and notes what must be written again.
    pub(super) fn settle(&mut self, tended: Tended) {
        for (kind, name) in tended.forgotten {
            match kind {
                Kind::Session => drop(self.sessions.insert(name, Stamp::NONE)),
                Kind::Scene => drop(self.scenes.insert(name, u64::MAX)),
            }
        }
        for lost in &tended.lost {
            match lost.kind {
                Kind::Session => self.give_up(&lost.name, lost),
                Kind::Scene => self.give_up_scene(lost),
            }
        }
    }

    /// Ends a session here. Its record stays, because it is another server's.
    fn give_up(&mut self, name: &str, lost: &Lost) {
        self.sessions.remove(name);
        self.unkept_sessions.remove(name);
        // Of a session whose scene was lost, this server has the lease.
        self.records.give_up(Kind::Session, name);
        let (tenant, id) = of_record(name);
        let Some(space) = self.spaces.known(&tenant) else {
            return;
        };
        let now = space.sessions.time().now();
        let away = Away::of(lost.owner.clone(), lost.ends_in, now);
        if space.sessions.registry().give_up(id, away, now) {
            tracing::warn!(
                session = name,
                owner = lost.owner,
                "another server has taken a session over"
            );
        }
    }

    /// Ends all sessions of a scene here: they and its objects must be on one server.
    fn give_up_scene(&mut self, lost: &Lost) {
        self.scenes.remove(&lost.name);
        self.unkept_scenes.remove(&lost.name);
        let (tenant, scene) = of_record(&lost.name);
        let Some(space) = self.spaces.known(&tenant) else {
            return;
        };
        for cell in space.sessions.registry().everything() {
            if cell.scene().is_some_and(|of| **of == *scene) {
                self.give_up(&space.record_name(cell.id()), lost);
            }
        }
    }
}
