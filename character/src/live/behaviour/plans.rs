//! What happens with the plans that a behaviour asked for.

use super::{Behaviour, CharacterParts, Doing};
use crate::primitives::object::KeyframeError;

impl Behaviour {
    /// Notes the number of the plan that [`Behaviour::settle`] asked for last.
    pub(in crate::live) fn asked(&mut self, number: u64) {
        if let Doing::Using(using) = &mut self.doing {
            using.asked(number);
        }
    }

    /// A plan took over; `off` is how far it was from the keyframes.
    pub(in crate::live) fn landed(
        &mut self,
        number: u64,
        off: &[KeyframeError],
        parts: &mut CharacterParts<'_>,
    ) {
        let from = parts.timeline.last_splice().unwrap_or_default();
        let key = parts.timeline.buffer().last();
        if let Doing::Using(using) = &mut self.doing {
            using.landed(number, off, (from, key));
        }
        self.turn_in_hand();
        match &self.doing {
            Doing::Using(using) if using.in_sets() => using.rest_arm(parts),
            Doing::Locomotion | Doing::Using(_) => parts.post.carry.due(from),
            Doing::Falling(_) => {}
        }
        self.settle_arm(parts.post.carry.settled(), parts);
        parts.post.footing.changed(from);
    }

    /// A plan will not arrive.
    pub(in crate::live) fn lost(&mut self, number: u64, parts: &mut CharacterParts<'_>) {
        let Doing::Using(using) = &mut self.doing else {
            return;
        };
        if let Some(refused) = using.lost(number) {
            self.fail(parts.timeline.frame(), parts, refused);
        }
    }
}
