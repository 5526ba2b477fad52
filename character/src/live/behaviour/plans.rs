//! What becomes of the plans that were asked for.

use super::{Behaviour, Body, Doing};
use crate::primitives::object::KeyframeError;

impl Behaviour {
    /// The plan of this number was asked for, as was said last.
    pub(in crate::live) fn asked(&mut self, number: u64) {
        if let Doing::Using(using) = &mut self.doing {
            using.asked(number);
        }
    }

    /// A plan took over; `off` is how far it was from the keyframes.
    pub(in crate::live) fn landed(&mut self, number: u64, off: &[KeyframeError], body: &mut Body<'_>) {
        let from = body.timeline.last_splice().unwrap_or_default();
        let key = body.timeline.buffer().last();
        if let Doing::Using(using) = &mut self.doing {
            using.landed(number, off, (from, key));
        }
        self.turn_in_hand();
        match &self.doing {
            Doing::Using(using) if using.in_sets() => using.rest_arm(body),
            Doing::Locomotion | Doing::Using(_) => body.carry.due(from),
            Doing::Falling(_) => {}
        }
        self.settle_arm(body.carry.settled(), body);
        body.footing.changed(from);
    }

    /// A plan will not come.
    pub(in crate::live) fn lost(&mut self, number: u64, body: &mut Body<'_>) {
        let Doing::Using(using) = &mut self.doing else {
            return;
        };
        if let Some(refused) = using.lost(number) {
            self.fail(body.timeline.frame(), body, refused);
        }
    }
}
