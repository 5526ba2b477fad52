//! What happens to a character.

use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Note {
    /// The character is on the server.
    Opened,
    /// The character could not be opened, or left. No frames come from now on.
    Failed(String),
    /// The server refused a command. The character goes on as before.
    Refused(String),
    /// The character came to the end of its path.
    Arrived {
        /// Distance from the last point, metres.
        off_m: f32,
    },
    /// The character began to act out a sentence.
    Performing(String),
    /// A performance ended, for this reason.
    Performed(String),
    /// Anything else.
    Happened {
        /// Name of the event in `event.proto`, or `resumed`.
        kind: &'static str,
        /// The object that it is about.
        subject: String,
        /// What there is to say of it.
        detail: String,
    },
}

impl Note {
    /// The connection broke, and the character goes on after its last frame.
    pub(super) fn resumed(lost_commands: u64) -> Self {
        Self::Happened {
            kind: "resumed",
            subject: String::new(),
            detail: format!("{lost_commands} commands were lost"),
        }
    }

    /// The note of an event. None: this library does not know its kind.
    pub(super) fn of(event: &v1::SessionEvent) -> Option<Self> {
        let happened = |kind, subject: &str, detail: String| Self::Happened {
            kind,
            subject: subject.to_owned(),
            detail,
        };
        Some(match event.kind.as_ref()? {
            Kind::Started(of) => happened("started", &of.instance, of.definition.clone()),
            Kind::Entered(of) => happened("entered", &of.instance, of.set.clone()),
            Kind::Reached(of) => happened("reached", &of.instance, of.set.clone()),
            Kind::Attached(of) => happened("attached", &of.instance, of.socket.clone()),
            Kind::Released(of) => happened("released", &of.instance, String::new()),
            Kind::Done(of) => happened("done", &of.instance, String::new()),
            Kind::Failed(of) => happened("failed", &of.instance, format!("{}: {}", of.reason, of.message)),
            Kind::Interrupted(of) => happened("interrupted", &of.instance, String::new()),
            Kind::Fell(of) => happened("fell", "", format!("{} m", of.height.unwrap_or_default())),
            Kind::Landed(of) => happened("landed", "", format!("{} m, {} m/s", of.height, of.speed)),
            Kind::Arrived(of) => Self::Arrived { off_m: of.off },
            Kind::Performing(of) => Self::Performing(of.text.clone()),
            Kind::Performed(of) => Self::Performed(of.reason.clone()),
            Kind::Bounded(of) => happened(
                "bounded",
                "",
                format!("{} m/s instead of {} m/s", of.speed, of.wanted_speed),
            ),
        })
    }
}
