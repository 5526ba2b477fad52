//! Metrics of live characters.

use troupe_base::telemetry::{Counter, Gauge, Histogram, Labels, Metric, Telemetry};
use troupe_character::live::{EventKind, FailReason, PerformanceEnd, PlanCause, Stats};

const ACTIVE: Metric = Metric::new("troupe_sessions_active", "Open sessions");
const STREAMS: Metric = Metric::new("troupe_streams_active", "Open streams");
const EVICTIONS: Metric = Metric::new(
    "troupe_session_evictions_total",
    "Sessions that ended, by reason: closed, expired or moved to another server",
);
const FRAMES_SENT: Metric = Metric::new(
    "troupe_frames_sent_total",
    "Frames of characters handed to callers",
);
const DROPPED_FRAMES: Metric = Metric::new(
    "troupe_stream_dropped_frames_total",
    "Frames of characters that a stream did not send, because its reader or the server was slow",
);
const REPLANS: Metric = Metric::new(
    "troupe_replans_total",
    "Plans asked for, by cause: the command changed, the buffer ran low, or the interval went by",
);
const LATE_PLANS: Metric = Metric::new(
    "troupe_late_plans_total",
    "Plans that came after the frame at which they should have taken over",
);
const FAILED_PLANS: Metric = Metric::new(
    "troupe_failed_plans_total",
    "Plans that failed or met a full queue",
);
const UNDERRUNS: Metric = Metric::new(
    "troupe_underruns_total",
    "Times that a character had to slow down because its plan was late",
);
const FAST_HINGES: Metric = Metric::new(
    "troupe_fast_hinge_frames_total",
    "Frames of robots in which a hinge would have to be faster than it can",
);
const INTERACTIONS: Metric = Metric::new(
    "troupe_interactions_total",
    "Interactions with objects, by outcome: started, done, failed or interrupted",
);
const FAILED_INTERACTIONS: Metric = Metric::new(
    "troupe_failed_interactions_total",
    "Interactions that failed, by reason",
);
const PERFORMANCES: Metric = Metric::new(
    "troupe_performances_total",
    "Sentences that characters acted out, by outcome: started, done, interrupted, failed, late or restarted",
);
const FALLS: Metric = Metric::new(
    "troupe_falls_total",
    "Falls of characters, because the ground under them ended",
);
const DROPPED_EVENTS: Metric = Metric::new(
    "troupe_dropped_events_total",
    "Events of sessions that were dropped because no client took them",
);
const PRESSURE: Metric = Metric::new(
    "troupe_crowd_pressure",
    "Stretch of the intervals and lengths of plans of the client whose plans are slowest: 0 none, 1 to a plan a \
     second, 2 the maximum",
);
const PLAN_INTERVAL: Metric = Metric::new(
    "troupe_plan_interval_frames",
    "Frames between the takeovers of a plan and of the next, by band of priority",
);
const PLAN_LENGTH: Metric = Metric::new(
    "troupe_plan_length_frames",
    "Frames of a plan, by band of priority",
);
const LEAD_TIME: Metric = Metric::new(
    "troupe_lead_time_seconds",
    "Time from a plan's arrival to the frame at which it takes over, in the character's time",
);

/// Bands of priority as metric labels: below 1/3, below 2/3, and the rest.
const BANDS: [&str; 3] = ["low", "middle", "high"];

/// Why a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eviction {
    /// A client closed it.
    Closed,
    /// No client used it for its time to live.
    Expired,
    /// Another server has taken it over.
    Moved,
}

/// The metrics of one pack's sessions.
#[derive(Clone, Debug)]
pub struct SessionMetrics {
    active: Gauge,
    closed: Counter,
    expired: Counter,
    moved: Counter,
    frames_sent: Counter,
    dropped_frames: Counter,
    replans: [Counter; 4],
    late_plans: Counter,
    failed_plans: Counter,
    underruns: Counter,
    fast_hinges: Counter,
    interactions: [Counter; 4],
    failed_interactions: [Counter; FailReason::ALL.len()],
    falls: Counter,
    performances: [Counter; 1 + PerformanceEnd::WORDS.len()],
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
    /// Registers the metrics of a pack's sessions.
    pub fn new(telemetry: &Telemetry, model: &str, version: &str) -> Self {
        let labels = Labels::of_pack(model, version);
        let counter = |metric| telemetry.counter(metric, &labels);
        let each = |metric, key, value| telemetry.counter(metric, &labels.with(key, value));
        let histogram = |metric, band| telemetry.histogram(metric, &labels.with("priority", band));
        Self {
            active: telemetry.gauge(&ACTIVE, &labels),
            closed: each(&EVICTIONS, "reason", "closed"),
            expired: each(&EVICTIONS, "reason", "expired"),
            moved: each(&EVICTIONS, "reason", "moved"),
            frames_sent: counter(&FRAMES_SENT),
            dropped_frames: counter(&DROPPED_FRAMES),
            replans: ["command", "low_buffer", "interval", "object"]
                .map(|cause| each(&REPLANS, "cause", cause)),
            late_plans: counter(&LATE_PLANS),
            failed_plans: counter(&FAILED_PLANS),
            underruns: counter(&UNDERRUNS),
            fast_hinges: counter(&FAST_HINGES),
            interactions: ["started", "done", "failed", "interrupted"]
                .map(|outcome| each(&INTERACTIONS, "outcome", outcome)),
            failed_interactions: FailReason::ALL
                .map(|reason| each(&FAILED_INTERACTIONS, "reason", reason.word())),
            falls: counter(&FALLS),
            performances: ["started", "done", "interrupted", "failed", "late", "restarted"]
                .map(|outcome| each(&PERFORMANCES, "outcome", outcome)),
            dropped_events: counter(&DROPPED_EVENTS),
            lead_time: telemetry.histogram(&LEAD_TIME, &labels),
            pressure: telemetry.gauge(&PRESSURE, &labels),
            bands: BANDS.map(|band| Band {
                interval: histogram(&PLAN_INTERVAL, band),
                length: histogram(&PLAN_LENGTH, band),
            }),
        }
    }

    /// Counts sessions that were opened.
    pub fn opened(&self, sessions: usize) {
        self.active.increment(sessions as f64);
    }

    /// Counts a session that has ended.
    pub fn ended(&self, why: Eviction) {
        self.active.decrement(1.0);
        match why {
            Eviction::Closed => self.closed.increment(1),
            Eviction::Expired => self.expired.increment(1),
            Eviction::Moved => self.moved.increment(1),
        }
    }

    /// Counts frames that were handed to a caller.
    pub fn sent(&self, frames: usize) {
        self.frames_sent.increment(frames as u64);
    }

    /// Counts frames that a stream did not send.
    pub fn dropped(&self, frames: u64) {
        self.dropped_frames.increment(frames);
    }

    /// Counts a request for a plan.
    pub fn asked(&self, cause: PlanCause) {
        let index = match cause {
            PlanCause::Command => 0,
            PlanCause::LowBuffer => 1,
            PlanCause::Interval => 2,
            PlanCause::Object => 3,
        };
        self.replans[index].increment(1);
    }

    /// Records a plan for a character of this priority. `interval` is the number of frames since
    /// the plan before, if there was one. `length` is the plan's number of frames, if known.
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

    /// Counts an event of a character.
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
            EventKind::Performing { .. } => self.performances[0].increment(1),
            EventKind::Performed { end, .. } => {
                let ends = PerformanceEnd::WORDS.iter().zip(&self.performances[1..]);
                for (_, counter) in ends.filter(|(word, _)| **word == end.word()) {
                    counter.increment(1);
                }
            }
            EventKind::Entered { .. }
            | EventKind::Reached { .. }
            | EventKind::Attached { .. }
            | EventKind::Released { .. }
            | EventKind::Landed { .. }
            | EventKind::Arrived { .. }
            | EventKind::Bounded { .. } => {}
        }
    }

    /// Counts an event that was dropped because no client took it.
    pub fn event_dropped(&self) {
        self.dropped_events.increment(1);
    }

    /// Counts a robot's frame in which a hinge would have to be faster than it can.
    pub fn too_fast(&self) {
        self.fast_hinges.increment(1);
    }

    /// Sets the stretch of intervals and lengths of plans, 0 to 2.
    pub fn pressed(&self, pressure: f32) {
        self.pressure.set(f64::from(pressure));
    }

    /// Records that a plan came `lead_s` seconds before the frame at which it takes over.
    pub fn came(&self, lead_s: f64) {
        self.lead_time.record(lead_s);
    }

    /// Counts the difference between two states of a character's statistics.
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

/// The gauge of open streams.
pub(super) fn streams(telemetry: &Telemetry) -> Gauge {
    telemetry.gauge(&STREAMS, &Labels::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_of_sessions_carry_pack_reason_and_cause() {
        let telemetry = Telemetry::new().unwrap();
        let sessions = SessionMetrics::new(&telemetry, "human", "1.0");
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
        sessions.too_fast();
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
        let end = PerformanceEnd::Failed("no frames".to_owned());
        sessions.happened(&EventKind::Performed { number: 1, end });
        sessions.event_dropped();
        streams(&telemetry).set(4.0);
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
            r#"troupe_fast_hinge_frames_total{model="human",version="1.0"} 1"#,
            r#"troupe_plan_interval_frames_bucket{model="human",version="1.0",priority="middle",le="9"} 1"#,
            r#"troupe_plan_length_frames_sum{model="human",version="1.0",priority="low"} 64"#,
            r#"troupe_plan_interval_frames_count{model="human",version="1.0",priority="high"} 1"#,
            r#"troupe_crowd_pressure{model="human",version="1.0"} 0.25"#,
            r#"troupe_interactions_total{model="human",version="1.0",outcome="done"} 1"#,
            r#"troupe_interactions_total{model="human",version="1.0",outcome="started"} 0"#,
            r#"troupe_failed_interactions_total{model="human",version="1.0",reason="NOT_REACHED"} 1"#,
            r#"troupe_performances_total{model="human",version="1.0",outcome="failed"} 1"#,
            r#"troupe_performances_total{model="human",version="1.0",outcome="started"} 0"#,
            r#"troupe_falls_total{model="human",version="1.0"} 1"#,
            r#"troupe_dropped_events_total{model="human",version="1.0"} 1"#,
            "troupe_streams_active 4",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
