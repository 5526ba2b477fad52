//! Breaking off: ending an interaction before its time, and letting go of the object in the hand.

use std::sync::Arc;

use super::hand::Refused;
use super::using::Using;
use super::{Behaviour, CharacterParts, Doing, EventKind, FailReason};
use crate::live::World;
use crate::primitives::LocomotionCommand;

impl Behaviour {
    /// Breaks off an interaction. Locomotion then follows `command`, or stands. Answers whether
    /// there was an interaction.
    pub(super) fn interrupt(
        &mut self,
        frame: i64,
        parts: &mut CharacterParts<'_>,
        command: Option<&LocomotionCommand>,
    ) -> bool {
        let Doing::Using(using) = &self.doing else {
            return false;
        };
        if using.leaves() {
            // Only its last few frames are left.
            self.go_through(frame, parts);
            return false;
        }
        let instance = Arc::clone(using.instance());
        self.events.push(frame, EventKind::Interrupted { instance });
        self.stop_using(frame, parts, command);
        true
    }

    /// Ends an interaction that locomotion is taking over from: everything left in it happens in
    /// this frame.
    pub(super) fn go_through(&mut self, frame: i64, parts: &mut CharacterParts<'_>) {
        if let Err(refused) = self.pass_to(i64::MAX, frame, parts) {
            self.fail(frame, parts, refused);
        }
    }

    /// Breaks off an interaction that cannot go on; the character stands.
    pub(super) fn fail(
        &mut self,
        frame: i64,
        parts: &mut CharacterParts<'_>,
        Refused { reason, message }: Refused,
    ) {
        let Doing::Using(using) = &self.doing else {
            return;
        };
        let instance = Arc::clone(using.instance());
        self.events.push(
            frame,
            EventKind::Failed {
                instance,
                reason,
                message,
            },
        );
        let waiting = self.waiting.take();
        self.stop_using(frame, parts, None);
        if let Some(intent) = waiting {
            self.take_up(intent, frame, parts);
        }
    }

    /// Frees what an interaction reserved. Locomotion then follows `command`, or stands. An object
    /// in the hand stays there.
    pub(super) fn stop_using(
        &mut self,
        frame: i64,
        parts: &mut CharacterParts<'_>,
        command: Option<&LocomotionCommand>,
    ) {
        if let Doing::Using(using) = std::mem::replace(&mut self.doing, Doing::Locomotion) {
            self.unreserve(&using);
            let command = command.cloned().unwrap_or_else(|| parts.standing());
            parts.move_on(frame, command, using.approaches());
            self.left_off = true;
            if let Some(hand) = &mut self.hand {
                hand.stays(frame);
            }
        }
    }

    pub(super) fn unreserve(&self, using: &Using) {
        if using.is_skill() {
            return;
        }
        let instance = &**using.instance();
        let World { scene, holder, .. } = &self.world;
        if scene
            .snapshot()
            .instance(instance)
            .is_some_and(|it| it.state.holder() == Some(holder))
        {
            // A scene with nothing to free is not published again.
            let _ = scene.update(|scene| match scene.unreserve(instance, holder) {
                true => Ok(()),
                false => Err(()),
            });
        }
    }

    /// Puts the object in the hand down by its rule, if there is a place for it.
    pub(super) fn drop_held(&mut self, frame: i64, parts: &CharacterParts<'_>) {
        let Some(hand) = &self.hand else { return };
        let at = hand.transform(&parts.rig.skeleton, frame as f64, parts.shown(frame).posed());
        let instance = Arc::clone(&hand.instance);
        let kind = match hand.put_down(&self.world, at) {
            Ok(transform) => {
                self.hand = None;
                EventKind::Released { instance, transform }
            }
            Err(Refused { reason, message }) => {
                if reason == FailReason::Removed {
                    self.hand = None;
                }
                EventKind::Failed {
                    instance,
                    reason,
                    message,
                }
            }
        };
        self.events.push(frame, kind);
    }

    /// Lets go of the object in the hand, wherever it lands.
    pub(super) fn let_go(&mut self, frame: i64, parts: &CharacterParts<'_>) {
        let Some(hand) = self.hand.take() else { return };
        let at = hand.transform(&parts.rig.skeleton, frame as f64, parts.shown(frame).posed());
        if let Some(transform) = hand.let_go(&self.world, at) {
            let instance = Arc::clone(&hand.instance);
            self.events
                .push(frame, EventKind::Released { instance, transform });
        }
    }
}
