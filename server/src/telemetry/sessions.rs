//! Metrics of live characters.

use metrics::{Counter, Gauge, Histogram, Key, Label, Recorder as _};

use super::{METADATA, Telemetry};
use troupe_character::live::{EventKind, FailReason, PlanCause, Stats};

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
const INTERACTIONS: &str = "troupe_interactions_total";
const FAILED_INTERACTIONS: &str = "troupe_failed_interactions_total";
const FALLS: &str = "troupe_falls_total";
const DROPPED_EVENTS: &str = "troupe_dropped_events_total";
const PRESSURE: &str = "troupe_crowd_pressure";
pub(super) const PLAN_INTERVAL: &str = "troupe_plan_interval_frames";
pub(super) const PLAN_LENGTH: &str = "troupe_plan_length_frames";

/// Upper bounds of the buckets of intervals and lengths of plans, in frames.
pub(super) const FRAME_BUCKETS: [f64; 14] = [
    4.0, 9.0, 12.0, 16.0, 20.0, 24.0, 26.0, 30.0, 34.0, 40.0, 46.0, 50.0, 54.0, 64.0,
];

/// Bands of priority as metric labels: below a third, below two, and above.
const BANDS: [&str; 3] = ["low", "middle", "high"];

pub(super) const DESCRIPTIONS: [(&str, &str); 17] = [
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
        INTERACTIONS,
        "Interactions with objects, by what became of them: started, done, failed or interrupted",
    ),
    (
        FAILED_INTERACTIONS,
        "Interactions that could not go on, by reason",
    ),
    (FALLS, "Times that the ground ended under a character"),
    (
        DROPPED_EVENTS,
        "Events of sessions that were dropped because nobody took them",
    ),
    (
        PRESSURE,
        "How much intervals and lengths of plans are stretched: 0 not at all, 1 to a plan a second, 2 as far as it goes",
    ),
    (
        PLAN_INTERVAL,
        "Frames from where a plan takes over to where the next one does, by band of priority",
    ),
    (PLAN_LENGTH, "Frames of a plan, by band of priority"),
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
    replans: [Counter; 4],
    late_plans: Counter,
    failed_plans: Counter,
    underruns: Counter,
    interactions: [Counter; 4],
    failed_interactions: [Counter; FailReason::ALL.len()],
    falls: Counter,
    dropped_events: Counter,
    lead_time: Histogram,
    pressure: Gauge,
    bands: [Band; 3],
}

#[derive(Clone, Debug)]
struct Band {
    interval: Histogram,
    length: Histogram,
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
            PlanCause::Object => 3,
        };
        self.replans[index].increment(1);
    }

    /// A character of this priority asks for a plan of `length` frames, where that is settled, `interval` frames after the
    /// one before, where there was one.
    pub fn paced(&self, priority: f32, interval: Option<u32>, length: Option<usize>) {
        let last = BANDS.len() - 1;
        let band = &self.bands[((priority * BANDS.len() as f32) as usize).min(last)];
        if let Some(interval) = interval {
            band.interval.record(f64::from(interval));
        }
        if let Some(length) = length {
            band.length.record(length as f64);
        }
    }

    /// Something happened to a character.
    pub fn happened(&self, kind: &EventKind) {
        let [started, done, failed, interrupted] = &self.interactions;
        match kind {
            EventKind::Started { .. } => started.increment(1),
            EventKind::Done { .. } => done.increment(1),
            EventKind::Interrupted { .. } => interrupted.increment(1),
            EventKind::Failed { reason, .. } => {
                failed.increment(1);
                let each = FailReason::ALL.iter().zip(&self.failed_interactions);
                for (_, counter) in each.filter(|(known, _)| *known == reason) {
                    counter.increment(1);
                }
            }
            EventKind::Fell { .. } => self.falls.increment(1),
            EventKind::Entered { .. }
            | EventKind::Reached { .. }
            | EventKind::Attached { .. }
            | EventKind::Released { .. }
            | EventKind::Landed { .. } => {}
        }
    }

    /// An event was dropped because nobody took it.
    pub fn event_dropped(&self) {
        self.dropped_events.increment(1);
    }

    /// The pressure on the crowd has changed.
    pub fn pressed(&self, pressure: f32) {
        self.pressure.set(f64::from(pressure));
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
        let pressure = Key::from_parts(PRESSURE, labels(None));
        let histogram = |name, band| {
            let key = Key::from_parts(name, labels(Some(("priority", band))));
            self.recorder.register_histogram(&key, &METADATA)
        };
        SessionMetrics {
            active: self.recorder.register_gauge(&active, &METADATA),
            closed: counter(EVICTIONS, Some(("reason", "closed"))),
            expired: counter(EVICTIONS, Some(("reason", "expired"))),
            frames_sent: counter(FRAMES_SENT, None),
            dropped_frames: counter(DROPPED_FRAMES, None),
            replans: ["command", "low_buffer", "interval", "object"]
                .map(|cause| counter(REPLANS, Some(("cause", cause)))),
            late_plans: counter(LATE_PLANS, None),
            failed_plans: counter(FAILED_PLANS, None),
            underruns: counter(UNDERRUNS, None),
            interactions: ["started", "done", "failed", "interrupted"]
                .map(|outcome| counter(INTERACTIONS, Some(("outcome", outcome)))),
            failed_interactions: FailReason::ALL
                .map(|reason| counter(FAILED_INTERACTIONS, Some(("reason", reason.word())))),
            falls: counter(FALLS, None),
            dropped_events: counter(DROPPED_EVENTS, None),
            lead_time: self.recorder.register_histogram(&lead_time, &METADATA),
            pressure: self.recorder.register_gauge(&pressure, &METADATA),
            bands: BANDS.map(|band| Band {
                interval: histogram(PLAN_INTERVAL, band),
                length: histogram(PLAN_LENGTH, band),
            }),
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
        sessions.paced(0.0, None, Some(64));
        sessions.paced(0.5, Some(9), Some(34));
        sessions.paced(1.0, Some(9), None);
        sessions.pressed(0.25);
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
        let instance: std::sync::Arc<str> = "chair".into();
        for reason in FailReason::ALL {
            sessions.happened(&EventKind::Failed {
                instance: instance.clone(),
                reason,
                message: String::new(),
            });
        }
        sessions.happened(&EventKind::Done { instance });
        sessions.happened(&EventKind::Fell { height_m: None });
        sessions.event_dropped();
        telemetry.streams(4);
        let text = telemetry.render();
        let failed = r#"troupe_interactions_total{model="human",version="1.0",outcome="failed"}"#;
        assert!(
            text.contains(&format!("{failed} {}", FailReason::ALL.len())),
            "{text}"
        );
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
            r#"troupe_plan_interval_frames_bucket{model="human",version="1.0",priority="middle",le="9"} 1"#,
            r#"troupe_plan_length_frames_sum{model="human",version="1.0",priority="low"} 64"#,
            r#"troupe_plan_interval_frames_count{model="human",version="1.0",priority="high"} 1"#,
            r#"troupe_crowd_pressure{model="human",version="1.0"} 0.25"#,
            r#"troupe_interactions_total{model="human",version="1.0",outcome="done"} 1"#,
            r#"troupe_interactions_total{model="human",version="1.0",outcome="started"} 0"#,
            r#"troupe_failed_interactions_total{model="human",version="1.0",reason="NOT_REACHED"} 1"#,
            r#"troupe_falls_total{model="human",version="1.0"} 1"#,
            r#"troupe_dropped_events_total{model="human",version="1.0"} 1"#,
            "troupe_streams_active 4",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
