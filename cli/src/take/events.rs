//! The events of a character in its scene, for people and for programs.

use std::fmt;

use glam::{Quat, Vec3};
use serde_json::{Value, json};
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use crate::failure::Failure;
use crate::output::print;

/// Frames a second of a session's timeline.
pub(super) const TIMELINE_HZ: f32 = 30.0;

/// An event and its time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Event {
    /// Frame of the clip.
    pub(crate) frame: usize,
    /// The same in seconds.
    pub(crate) time_s: f32,
    /// The event as the server sends it.
    pub(crate) kind: Kind,
}

/// A new place of an object.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Moved {
    /// First frame of the clip with this place.
    pub(crate) frame: usize,
    /// Id of the object.
    pub(crate) instance: String,
    /// Place of its origin, native convention, metres.
    pub(crate) position: Vec3,
    /// Rotation in the world.
    pub(crate) rotation: Quat,
    /// Whether it is in the hand.
    pub(crate) in_hand: bool,
}

/// The events of a character in its scene so far.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub(super) events: Vec<Event>,
    pub(super) moved: Vec<Moved>,
    /// Whether it is known to hold a keyframe.
    holds: bool,
}

impl Seen {
    /// Takes the events of a step of one frame, and the object in the hand. The frame is `frame` of
    /// the clip and `first_frame` of the timeline. Returns whether an interaction ended.
    pub(super) fn step(
        &mut self,
        frame: usize,
        hz: f32,
        first_frame: u64,
        events: &[v1::SessionEvent],
        held: Option<&v1::HeldObject>,
    ) -> bool {
        if let Some(held) = held {
            self.moved(frame, &held.instance, (held.position, held.rotation), true);
        }
        let mut is_over = false;
        for event in events {
            let Some(kind) = event.kind.clone() else { continue };
            match &kind {
                Kind::Released(put) => {
                    self.moved(frame, &put.instance, (put.position, put.rotation), false);
                }
                Kind::Entered(_) => self.holds = false,
                Kind::Done(_) | Kind::Failed(_) | Kind::Interrupted(_) => {
                    is_over = true;
                    self.holds = false;
                }
                _ => {}
            }
            // Events come with the frame of their time, or a little later.
            let late_s = first_frame.saturating_sub(event.frame) as f32 / TIMELINE_HZ;
            let frame = frame.saturating_sub((late_s * hz).round() as usize);
            self.events.push(Event {
                frame,
                time_s: frame as f32 / hz,
                kind,
            });
        }
        is_over
    }

    fn moved(
        &mut self,
        frame: usize,
        instance: &str,
        (position, rotation): (Option<v1::Vec3>, Option<v1::Quat>),
        in_hand: bool,
    ) {
        self.moved.push(Moved {
            frame,
            instance: instance.to_owned(),
            position: position.map_or(Vec3::ZERO, |p| Vec3::new(p.x, p.y, p.z)),
            rotation: rotation.map_or(Quat::IDENTITY, |q| Quat::from_xyzw(q.x, q.y, q.z, q.w)),
            in_hand,
        });
    }

    /// Notes that it holds a keyframe. Returns whether that is news.
    pub(super) fn began_to_hold(&mut self) -> bool {
        !std::mem::replace(&mut self.holds, true)
    }
}

impl Event {
    /// The event as the server gives it, with its time.
    pub(crate) fn to_json(&self) -> Value {
        let message = v1::SessionEvent {
            kind: Some(self.kind.clone()),
            ..v1::SessionEvent::default()
        };
        let mut event = json!(message);
        // The frame counts the session's timeline, which a clip does not have.
        if let Some(fields) = event.as_object_mut() {
            fields.remove("frame");
        }
        json!({ "time_s": self.time_s, "event": event })
    }
}

impl fmt::Display for Event {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:6.2} s  {}", self.time_s, InWords(&self.kind))
    }
}

/// Prints a line for each event.
pub(crate) fn print_events(events: &[Event]) -> Result<(), Failure> {
    events.iter().try_for_each(|event| print(&event.to_string()))
}

/// An event in words.
pub(crate) struct InWords<'a>(pub(crate) &'a Kind);

impl fmt::Display for InWords<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Kind::Started(of) => {
                write!(out, "started {}, {}", of.instance, of.variant)?;
                match of.approach.is_empty() {
                    true => Ok(()),
                    false => write!(out, " from {}", of.approach),
                }
            }
            Kind::Entered(of) => write!(out, "entered {}", of.set),
            Kind::Reached(of) => {
                let before = of.before.unwrap_or_default();
                let after = of.after.unwrap_or_default();
                write!(
                    out,
                    "reached {}: root {:.1} cm, heading {:.1}°, joints {:.1} cm off",
                    of.set,
                    before.root_m * 100.0,
                    before.heading_deg,
                    before.joint_m * 100.0,
                )?;
                // A set that is left early is not drawn to its keyframe, so its error says nothing.
                if of.early_frames > 0 {
                    return write!(out, ", left {} frames early", of.early_frames);
                }
                write!(
                    out,
                    ", drawn to {:.1} cm, {:.1}°, {:.1} cm",
                    after.root_m * 100.0,
                    after.heading_deg,
                    after.joint_m * 100.0,
                )
            }
            Kind::Attached(of) => write!(out, "attached {} to {}", of.instance, of.socket),
            Kind::Released(of) => {
                let at = of.position.unwrap_or_default();
                write!(
                    out,
                    "released {} at {:.2} {:.2} {:.2} m",
                    of.instance, at.x, at.y, at.z
                )
            }
            Kind::Done(of) => write!(out, "done with {}", of.instance),
            Kind::Failed(of) => write!(out, "failed at {}: {}, {}", of.instance, of.reason, of.message),
            Kind::Interrupted(of) => write!(out, "broke off {}", of.instance),
            Kind::Fell(of) => match of.height {
                Some(metres) => write!(out, "fell, {metres:.2} m"),
                None => out.write_str("fell"),
            },
            Kind::Arrived(of) => write!(out, "arrived {:.1} s late, {:.2} m off", of.late, of.off),
            Kind::Bounded(of) => {
                write!(out, "goes at {:.2} m/s, not {:.2}", of.speed, of.wanted_speed)?;
                match of.facing {
                    Some(facing) => write!(out, ", and faces {:.0}° instead", facing.to_degrees()),
                    None => Ok(()),
                }
            }
            Kind::Performing(of) => match of.unknown_words.is_empty() {
                true => write!(out, "acts out {:?}", of.text),
                false => write!(
                    out,
                    "acts out {:?}; the pack does not know: {}",
                    of.text,
                    of.unknown_words.join(", ")
                ),
            },
            Kind::Performed(of) if of.message.is_empty() => write!(out, "performance over: {}", of.reason),
            Kind::Performed(of) => write!(out, "performance over: {}, {}", of.reason, of.message),
            Kind::Landed(of) => write!(out, "landed after {:.2} m at {:.1} m/s", of.height, of.speed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(frame: u64, kind: Kind) -> v1::SessionEvent {
        v1::SessionEvent {
            frame,
            kind: Some(kind),
        }
    }

    fn cup() -> String {
        "cup".to_owned()
    }

    #[test]
    fn objects_are_followed_from_the_hand_to_their_new_place() {
        let mut seen = Seen::default();
        let at = |x| Some(v1::Vec3 { x, y: 1.0, z: 0.0 });
        let held = v1::HeldObject {
            instance: cup(),
            position: at(1.0),
            ..v1::HeldObject::default()
        };
        assert!(!seen.step(9, 60.0, 104, &[], Some(&held)));
        let released = Kind::Released(v1::ObjectReleased {
            instance: cup(),
            position: at(2.0),
            rotation: None,
        });
        let done = Kind::Done(v1::InteractionDone { instance: cup() });
        // The first event comes two frames late, which are four frames of the clip at 60 Hz.
        assert!(seen.step(10, 60.0, 105, &[event(103, released), event(105, done)], None));
        let moved: Vec<_> = seen.moved.iter().map(|m| (m.frame, m.position.x)).collect();
        assert_eq!(moved, [(9, 1.0), (10, 2.0)]);
        let frames: Vec<_> = seen.events.iter().map(|e| e.frame).collect();
        assert_eq!(frames, [6, 10]);
        assert_eq!(seen.events[1].to_string(), "  0.17 s  done with cup");
        assert_eq!(seen.events[1].to_json()["event"]["done"]["instance"], "cup");
    }

    #[test]
    fn a_set_that_is_left_early_says_so() {
        let off = |root_m| v1::KeyframeError {
            root_m,
            ..v1::KeyframeError::default()
        };
        let text = |early_frames| {
            let reached = Kind::Reached(v1::KeyframeReached {
                set: "rise".to_owned(),
                before: Some(off(0.003)),
                after: Some(off(0.013)),
                early_frames,
                ..v1::KeyframeReached::default()
            });
            InWords(&reached).to_string()
        };
        let before = "reached rise: root 0.3 cm, heading 0.0°, joints 0.0 cm off";
        assert_eq!(text(10), format!("{before}, left 10 frames early"));
        assert_eq!(text(0), format!("{before}, drawn to 1.3 cm, 0.0°, 0.0 cm"));
    }

    #[test]
    fn a_hold_is_noted_once() {
        let mut seen = Seen::default();
        assert!(seen.began_to_hold() && !seen.began_to_hold());
        let entered = Kind::Entered(v1::SetEntered {
            instance: cup(),
            set: "lift".to_owned(),
        });
        seen.step(0, 30.0, 0, &[event(0, entered)], None);
        assert!(seen.began_to_hold());
    }
}
