//! What happens in an interaction frame by frame: its events, and what they do to the object.

use std::sync::Arc;

use super::super::EventKind;
use super::hand::{Hand, Refused};
use super::using::Using;
use super::{Behaviour, CharacterParts, Doing};
use crate::object::{Action, Moment};
use crate::primitives::object::{Input, Output};

impl Behaviour {
    /// Emits what has happened up to a frame, and does it to the object.
    pub(super) fn pass(&mut self, frame: i64, parts: &mut CharacterParts<'_>) -> Result<(), Refused> {
        self.pass_to(frame, frame, parts)
    }

    /// [`Behaviour::pass`] up to a frame that may lie ahead. Everything in it counts as of frame
    /// `now` at the latest.
    pub(super) fn pass_to(
        &mut self,
        frame: i64,
        now: i64,
        parts: &mut CharacterParts<'_>,
    ) -> Result<(), Refused> {
        let Doing::Using(using) = &mut self.doing else {
            return Ok(());
        };
        using.interaction.on(Input::At(frame), &mut using.outputs);
        let mut outputs = std::mem::take(&mut using.outputs);
        for output in outputs.drain(..) {
            match output.no_later_than(now) {
                Output::Entered(at, set) => {
                    let event = |using: &Using| EventKind::Entered {
                        instance: Arc::clone(&using.instance),
                        set: using.set_name(set),
                    };
                    self.emit_of(at, event);
                    self.run_events(set, Moment::Start, at, parts)?;
                }
                Output::Reached(at, set) => {
                    self.emit_reached(at, set, parts);
                    self.run_events(set, Moment::Reached, at, parts)?;
                }
                Output::Left(at, set) => self.run_events(set, Moment::End, at, parts)?,
                Output::Over(at) => {
                    self.emit_of(at, |using| EventKind::Done {
                        instance: Arc::clone(&using.instance),
                    });
                    if let Doing::Using(using) = std::mem::replace(&mut self.doing, Doing::Locomotion) {
                        self.unreserve(&using);
                    }
                    self.left_off = true;
                    if let Some(intent) = self.waiting.take() {
                        self.take_up(intent, now, parts);
                    }
                }
            }
        }
        if let Doing::Using(using) = &mut self.doing {
            // Keeps the list's memory.
            using.outputs = outputs;
        }
        Ok(())
    }

    fn emit_of(&mut self, at: i64, event: impl FnOnce(&Using) -> EventKind) {
        if let Doing::Using(using) = &self.doing {
            let event = event(using);
            self.events.push(at, event);
        }
    }

    /// Emits that the keyframes of a set were reached, or left early.
    fn emit_reached(&mut self, at: i64, set: usize, parts: &CharacterParts<'_>) {
        let Doing::Using(using) = &self.doing else { return };
        let Some(made) = using.made.iter().rev().find(|made| made.stretch.set == set) else {
            return;
        };
        let last = made.keys.len().saturating_sub(1);
        let name = using.set_name(set);
        let instance = Arc::clone(&using.instance);
        let early = (made.stretch.key - at).max(0);
        let events: Vec<_> = (made.keys.iter().enumerate())
            .skip(if early > 0 { last } else { 0 })
            .map(|(nth, key)| {
                let frame = at - (last - nth) as i64;
                let mut shown = parts.shown(frame);
                shown.root.y -= made.ground;
                let after = key.error(&parts.rig.skeleton, shown.posed());
                let before = made.off.get(nth).copied().unwrap_or_default();
                let kind = EventKind::Reached {
                    instance: Arc::clone(&instance),
                    set: name.clone(),
                    keyframe: nth as u32,
                    before,
                    after,
                    early_frames: early as u32,
                };
                (frame, kind)
            })
            .collect();
        for (frame, kind) in events {
            self.events.push(frame, kind);
        }
    }

    /// Does to the object what the set lists for a moment.
    fn run_events(
        &mut self,
        set: usize,
        moment: Moment,
        at: i64,
        parts: &CharacterParts<'_>,
    ) -> Result<(), Refused> {
        let Doing::Using(using) = &self.doing else {
            return Ok(());
        };
        let definition = Arc::clone(using.definition());
        let variant = using.interaction.variant();
        let instance = Arc::clone(&using.instance);
        let events = definition.sets.get(set).map(|set| set.events.as_slice());
        for event in events
            .unwrap_or_default()
            .iter()
            .filter(|event| event.at == moment)
        {
            let shown = parts.shown(at);
            match event.action {
                Action::Attach(socket) if self.hand.is_none() => {
                    let taken = Hand::take(
                        &self.world,
                        &parts.rig.skeleton,
                        &instance,
                        (&definition, variant),
                        socket,
                        at,
                        shown.posed(),
                    )?;
                    let socket = taken
                        .socket()
                        .map(|socket| socket.name.clone())
                        .unwrap_or_default();
                    self.hand = Some(taken);
                    let instance = Arc::clone(&instance);
                    self.events.push(at, EventKind::Attached { instance, socket });
                }
                Action::Release => {
                    let Some(hand) = &self.hand else { continue };
                    let from = hand.transform(&parts.rig.skeleton, at as f64, shown.posed());
                    let transform = hand.put_down(&self.world, from)?;
                    let instance = Arc::clone(&hand.instance);
                    self.hand = None;
                    self.events.push(at, EventKind::Released { instance, transform });
                }
                Action::Attach(_) => {}
            }
        }
        Ok(())
    }
}
