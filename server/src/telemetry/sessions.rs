//! Metrics of live characters.

use metrics::{Counter, Gauge, Histogram, Key, Label, Recorder as _};

use super::{METADATA, Telemetry};
use crate::session::{PlanCause, Stats};

pub(super) const ACTIVE: &str = "troupe_sessions_active";
pub(super) const STREAMS: &str = "troupe_streams_active";
pub(super) const LEAD_TIME: &str = "troupe_lead_time_seconds";
const EVICTIONS: &str = "troupe_session_evictions_total";
const FRAMES_SENT: &str = "troupe_frames_sent_total";
const DROPPED_FRAMES: &str = "troupe_stream_dropped_frames_total";
const REPLANS: &str = "troupe_replans_total";
const LATE_PLANS: &str = "troupe_late_plans_total";
const FAILED_PLANS: &str = "troupe_failed_plans_total";
const UNDERRUNS: &str = "troupe_underruns_total";

pub(super) const DESCRIPTIONS: [(&str, &str); 10] = [
    (ACTIVE, "Open sessions"),
    (STREAMS, "Open streams"),
    (EVICTIONS, "Sessions that ended, by reason: closed or expired"),
    (FRAMES_SENT, "Frames of characters handed to callers"),
    (
        DROPPED_FRAMES,
        "Frames of characters that a stream did not send, because its reader or the server was slow",
    ),
    (
        REPLANS,
        "Plans asked for, by cause: the command changed, the buffer ran low, or the interval went by",
    ),
    (
        LATE_PLANS,
        "Plans that came after the frame where they were to take over",
    ),
    (FAILED_PLANS, "Plans that failed, or found the queue full"),
    (
        UNDERRUNS,
        "Times that a character had to slow down because its plan was late",
    ),
    (
        LEAD_TIME,
        "From a plan's arrival to the frame where it takes over, in the character's time",
    ),
];

/// Why a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eviction {
    /// A caller closed it.
    Closed,
    /// Nobody wanted anything of it for its time to live.
    Expired,
}

/// The metrics of one pack's sessions.
#[derive(Clone, Debug)]
pub struct SessionMetrics {
    active: Gauge,
    closed: Counter,
    expired: Counter,
    frames_sent: Counter,
    dropped_frames: Counter,
    replans: [Counter; 3],
    late_plans: Counter,
    failed_plans: Counter,
    underruns: Counter,
    lead_time: Histogram,
}

impl SessionMetrics {
    /// Sessions have opened.
    pub fn opened(&self, sessions: usize) {
        self.active.increment(sessions as f64);
    }

    /// A session has ended.
    pub fn ended(&self, why: Eviction) {
        self.active.decrement(1.0);
        match why {
            Eviction::Closed => self.closed.increment(1),
            Eviction::Expired => self.expired.increment(1),
        }
    }

    /// Frames went to a caller.
    pub fn sent(&self, frames: usize) {
        self.frames_sent.increment(frames as u64);
    }

    /// Frames of a stream were not sent.
    pub fn dropped(&self, frames: u64) {
        self.dropped_frames.increment(frames);
    }

    /// A plan was asked for.
    pub fn asked(&self, cause: PlanCause) {
        let index = match cause {
            PlanCause::Command => 0,
            PlanCause::LowBuffer => 1,
            PlanCause::Interval => 2,
        };
        self.replans[index].increment(1);
    }

    /// A plan came this long before the frame where it takes over.
    pub fn came(&self, lead_s: f64) {
        self.lead_time.record(lead_s);
    }

    /// What a character has done between two looks.
    pub fn progressed(&self, before: &Stats, now: &Stats) {
        let counters = [
            (&self.late_plans, before.late_plans, now.late_plans),
            (&self.failed_plans, before.failed_plans, now.failed_plans),
            (&self.underruns, before.underruns, now.underruns),
        ];
        for (counter, before, now) in counters {
            if now > before {
                counter.increment(now - before);
            }
        }
    }
}

impl Telemetry {
    /// The metrics of the sessions of one pack.
    pub fn sessions(&self, model: &str, version: &str) -> SessionMetrics {
        let labels = |extra: Option<(&'static str, &'static str)>| -> Vec<Label> {
            let pack = [
                Label::new("model", model.to_owned()),
                Label::new("version", version.to_owned()),
            ];
            let extra = extra.map(|(key, value)| Label::new(key, value));
            pack.into_iter().chain(extra).collect()
        };
        let counter = |name, extra| self.counter(name, labels(extra));
        let active = Key::from_parts(ACTIVE, labels(None));
        let lead_time = Key::from_parts(LEAD_TIME, labels(None));
        SessionMetrics {
            active: self.recorder.register_gauge(&active, &METADATA),
            closed: counter(EVICTIONS, Some(("reason", "closed"))),
            expired: counter(EVICTIONS, Some(("reason", "expired"))),
            frames_sent: counter(FRAMES_SENT, None),
            dropped_frames: counter(DROPPED_FRAMES, None),
            replans: ["command", "low_buffer", "interval"]
                .map(|cause| counter(REPLANS, Some(("cause", cause)))),
            late_plans: counter(LATE_PLANS, None),
            failed_plans: counter(FAILED_PLANS, None),
            underruns: counter(UNDERRUNS, None),
            lead_time: self.recorder.register_histogram(&lead_time, &METADATA),
        }
    }

    /// Notes how many streams are open.
    pub fn streams(&self, open: usize) {
        let key = Key::from_name(STREAMS);
        self.recorder.register_gauge(&key, &METADATA).set(open as f64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_of_sessions_carry_pack_reason_and_cause() {
        let telemetry = Telemetry::new().unwrap();
        let sessions = telemetry.sessions("human", "1.0");
        sessions.opened(3);
        sessions.ended(Eviction::Expired);
        sessions.sent(200);
        sessions.dropped(7);
        sessions.asked(PlanCause::LowBuffer);
        sessions.came(0.06);
        let now = Stats {
            late_plans: 5,
            underruns: 2,
            ..Stats::default()
        };
        let before = Stats {
            late_plans: 3,
            underruns: 2,
            ..Stats::default()
        };
        sessions.progressed(&before, &now);
        telemetry.streams(4);
        let text = telemetry.render();
        for line in [
            r#"troupe_sessions_active{model="human",version="1.0"} 2"#,
            r#"troupe_session_evictions_total{model="human",version="1.0",reason="expired"} 1"#,
            r#"troupe_session_evictions_total{model="human",version="1.0",reason="closed"} 0"#,
            r#"troupe_frames_sent_total{model="human",version="1.0"} 200"#,
            r#"troupe_stream_dropped_frames_total{model="human",version="1.0"} 7"#,
            r#"troupe_replans_total{model="human",version="1.0",cause="low_buffer"} 1"#,
            r#"troupe_lead_time_seconds_bucket{model="human",version="1.0",le="0.0667"} 1"#,
            r#"troupe_late_plans_total{model="human",version="1.0"} 2"#,
            r#"troupe_underruns_total{model="human",version="1.0"} 0"#,
            "troupe_streams_active 4",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
