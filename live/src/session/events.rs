//! Queued events of a session, and events as messages.

use std::collections::VecDeque;

use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use super::metrics::SessionMetrics;
use crate::wire::Measure;
use crate::wire::units::{position, quat};
use troupe_character::live::{
    Activity, Character, CharacterEvent, EventKind, HeldObject, KeyframeError, PerformanceEnd,
};

/// Maximum number of events that wait in a session. Beyond it, the oldest are dropped.
pub const MAX_WAITING_EVENTS: usize = 64;

/// The events of a session that no client has taken yet.
#[derive(Debug, Default)]
pub struct EventQueue {
    waiting: VecDeque<CharacterEvent>,
    dropped: u64,
    /// Reused buffer for new events of the character.
    fresh: Vec<CharacterEvent>,
}

impl EventQueue {
    /// Queues the character's new events and counts them in the metrics.
    pub(super) fn collect(
        &mut self,
        take_events: impl FnOnce(&mut Vec<CharacterEvent>),
        metrics: &SessionMetrics,
    ) {
        take_events(&mut self.fresh);
        for event in self.fresh.drain(..) {
            metrics.happened(&event.kind);
            if self.waiting.len() >= MAX_WAITING_EVENTS {
                self.waiting.pop_front();
                self.dropped += 1;
                metrics.event_dropped();
            }
            self.waiting.push_back(event);
        }
    }

    /// Number of events dropped since the session was created.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Takes all waiting events as a message for the session in `slot`. `None` without events.
    pub(super) fn take(&mut self, slot: u32, id: &str, measure: Measure) -> Option<v1::SessionEvents> {
        if self.waiting.is_empty() {
            return None;
        }
        let events = self.waiting.drain(..).map(|event| message(event, measure));
        Some(v1::SessionEvents {
            slot,
            session_id: id.to_owned(),
            events: events.collect(),
            events_dropped: self.dropped,
        })
    }
}

/// The object in a character's hand, as a message for the session in `slot`.
pub(super) fn held(character: &Character, slot: u32, measure: Measure) -> Option<v1::HeldObject> {
    let HeldObject {
        instance, transform, ..
    } = character.held()?;
    Some(v1::HeldObject {
        slot,
        instance: instance.to_string(),
        position: Some(position(transform.position, measure)),
        rotation: Some(quat(transform.rotation, measure.convention())),
    })
}

/// A character's activity as a message.
pub(super) fn activity(activity: Activity) -> v1::Activity {
    let of = |kind: v1::ActivityKind, instance: &str, set: String| v1::Activity {
        kind: kind.into(),
        instance: instance.to_owned(),
        set,
        ..v1::Activity::default()
    };
    match activity {
        Activity::Locomotion => v1::Activity::default(),
        Activity::Approaching { instance } => of(v1::ActivityKind::Approaching, &instance, String::new()),
        Activity::Interacting { instance, set } => of(v1::ActivityKind::Interacting, &instance, set),
        Activity::Held { instance, set } => of(v1::ActivityKind::Held, &instance, set),
        Activity::Falling => of(v1::ActivityKind::Falling, "", String::new()),
        Activity::Performing { text } => v1::Activity {
            text: text.to_string(),
            ..of(v1::ActivityKind::Performing, "", String::new())
        },
    }
}

fn message(event: CharacterEvent, measure: Measure) -> v1::SessionEvent {
    v1::SessionEvent {
        frame: event.frame,
        kind: Some(kind(event.kind, measure)),
    }
}

fn kind(kind: EventKind, measure: Measure) -> Kind {
    let unit = measure.units_per_metre();
    match kind {
        EventKind::Started {
            instance,
            definition,
            variant,
            approach,
            seed,
        } => Kind::Started(v1::InteractionStarted {
            instance: instance.to_string(),
            definition,
            variant,
            approach: approach.unwrap_or_default(),
            seed,
        }),
        EventKind::Entered { instance, set } => Kind::Entered(v1::SetEntered {
            instance: instance.to_string(),
            set,
        }),
        EventKind::Reached {
            instance,
            set,
            keyframe,
            before,
            after,
            early_frames,
        } => Kind::Reached(v1::KeyframeReached {
            instance: instance.to_string(),
            set,
            keyframe,
            before: Some(keyframe_error(before, measure)),
            after: Some(keyframe_error(after, measure)),
            early_frames,
        }),
        EventKind::Attached { instance, socket } => Kind::Attached(v1::ObjectAttached {
            instance: instance.to_string(),
            socket,
        }),
        EventKind::Released { instance, transform } => Kind::Released(v1::ObjectReleased {
            instance: instance.to_string(),
            position: Some(position(transform.position, measure)),
            rotation: Some(quat(transform.rotation, measure.convention())),
        }),
        EventKind::Done { instance } => Kind::Done(v1::InteractionDone {
            instance: instance.to_string(),
        }),
        EventKind::Failed {
            instance,
            reason,
            message,
        } => Kind::Failed(v1::InteractionFailed {
            instance: instance.to_string(),
            reason: reason.word().to_owned(),
            message,
        }),
        EventKind::Interrupted { instance } => Kind::Interrupted(v1::InteractionInterrupted {
            instance: instance.to_string(),
        }),
        EventKind::Fell { height_m } => Kind::Fell(v1::CharacterFell {
            height: height_m.map(|height| height * unit),
        }),
        EventKind::Performing {
            number,
            text,
            pack,
            unknown_words,
        } => Kind::Performing(v1::PerformanceStarted {
            sequence: number,
            text: text.to_string(),
            pack: pack.to_string(),
            unknown_words,
        }),
        EventKind::Performed { number, end } => Kind::Performed(v1::PerformanceEnded {
            sequence: number,
            reason: end.word().to_owned(),
            message: match end {
                PerformanceEnd::Failed(message) => message,
                _ => String::new(),
            },
        }),
        EventKind::Arrived { late_s, off_m } => Kind::Arrived(v1::PathArrived {
            late: late_s,
            off: off_m * unit,
        }),
        EventKind::Bounded {
            wanted_mps,
            speed_mps,
            facing,
        } => Kind::Bounded(v1::CommandBounded {
            wanted_speed: wanted_mps * measure.scale(),
            speed: speed_mps * measure.scale(),
            facing: facing.map(|facing| measure.heading_from_native(facing)),
        }),
        EventKind::Landed { height_m, speed_mps } => Kind::Landed(v1::CharacterLanded {
            height: height_m * unit,
            speed: speed_mps * measure.scale(),
        }),
    }
}

fn keyframe_error(error: KeyframeError, measure: Measure) -> v1::KeyframeError {
    v1::KeyframeError {
        root_m: error.root_m * measure.scale(),
        heading_deg: error.heading.to_degrees(),
        joint_m: error.joint_m * measure.scale(),
    }
}

#[cfg(test)]
#[path = "events_tests.rs"]
mod tests;
