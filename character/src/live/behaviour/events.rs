//! What happens in an interaction as the frames go by: events, and what they do with the object.

use std::sync::Arc;

use super::super::EventKind;
use super::hand::{Hand, Refused};
use super::using::Using;
use super::{Behaviour, Body, Doing};
use crate::object::{Action, Moment};
use crate::primitives::object::{Input, Output};

impl Behaviour {
    /// What has happened up to a frame: events, and what they do with the object.
    pub(super) fn pass(&mut self, frame: i64, body: &mut Body<'_>) -> Result<(), Refused> {
        self.pass_to(frame, frame, body)
    }

    /// [`Behaviour::pass`], up to a frame that may be to come; nothing happens later than at frame
    /// `now`.
    pub(super) fn pass_to(&mut self, frame: i64, now: i64, body: &mut Body<'_>) -> Result<(), Refused> {
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
                    self.tell_of(at, event);
                    self.run_events(set, Moment::Start, at, body)?;
                }
                Output::Reached(at, set) => {
                    self.tell_reached(at, set, body);
                    self.run_events(set, Moment::Reached, at, body)?;
                }
                Output::Left(at, set) => self.run_events(set, Moment::End, at, body)?,
                Output::Over(at) => {
                    self.tell_of(at, |using| EventKind::Done {
                        instance: Arc::clone(&using.instance),
                    });
                    if let Doing::Using(using) = std::mem::replace(&mut self.doing, Doing::Locomotion) {
                        self.unreserve(&using);
                    }
                    self.left_off = true;
                    if let Some(intent) = self.waiting.take() {
                        self.take_up(intent, now, body);
                    }
                }
            }
        }
        if let Doing::Using(using) = &mut self.doing {
            // The list is used again.
            using.outputs = outputs;
        }
        Ok(())
    }

    fn tell_of(&mut self, at: i64, event: impl FnOnce(&Using) -> EventKind) {
        if let Doing::Using(using) = &self.doing {
            let event = event(using);
            self.emit(at, event);
        }
    }

    /// The keyframes of a set were reached, or the last of them was left out.
    fn tell_reached(&mut self, at: i64, set: usize, body: &Body<'_>) {
        let Doing::Using(using) = &self.doing else { return };
        let Some(made) = using.made.iter().rev().find(|made| made.stretch.set == set) else {
            return;
        };
        let last = made.keys.len().saturating_sub(1);
        let name = using.set_name(set);
        let instance = Arc::clone(&using.instance);
        let early = (made.stretch.key - at).max(0);
        let told: Vec<_> = (made.keys.iter().enumerate())
            .skip(if early > 0 { last } else { 0 })
            .map(|(nth, key)| {
                let frame = at - (last - nth) as i64;
                let mut shown = body.shown(frame);
                shown.root.y -= made.ground;
                let after = key.error(&body.rig.skeleton, shown.posed());
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
        for (frame, kind) in told {
            self.emit(frame, kind);
        }
    }

    /// Does what a set has happen at a moment.
    fn run_events(&mut self, set: usize, moment: Moment, at: i64, body: &Body<'_>) -> Result<(), Refused> {
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
            let shown = body.shown(at);
            match event.action {
                Action::Attach(socket) if self.hand.is_none() => {
                    let taken = Hand::take(
                        &self.world,
                        &body.rig.skeleton,
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
                    self.emit(at, EventKind::Attached { instance, socket });
                }
                Action::Release => {
                    let Some(hand) = &self.hand else { continue };
                    let from = hand.transform(&body.rig.skeleton, at as f64, shown.posed());
                    let transform = hand.put_down(&self.world, from)?;
                    let instance = Arc::clone(&hand.instance);
                    self.hand = None;
                    self.emit(at, EventKind::Released { instance, transform });
                }
                Action::Attach(_) => {}
            }
        }
        Ok(())
    }
}
