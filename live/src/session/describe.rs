//! Messages about sessions, in the convention of each session.

use std::time::Instant;

use troupe_motion::GlobalRoot;
use troupe_motion::conventions::Convention;
use troupe_motion::root::wrap_angle;
use troupe_proto::v1;

use super::cell::{Live, SessionCell};
use super::events;
use crate::wire::units;
use troupe_character::live::{Stats, View};

/// The state of a session at `now`.
pub(super) fn session(cell: &SessionCell, now: Instant) -> v1::Session {
    session_of(cell, &cell.live(), now)
}

/// [`session`] for callers that hold the session's lock.
pub(super) fn session_of(cell: &SessionCell, live: &Live, now: Instant) -> v1::Session {
    let View {
        frame,
        root,
        speed_mps,
        buffered_frames,
        last_sequence,
        stats,
    } = live.character.view();
    let (convention, measure) = (cell.convention(), cell.measure());
    let worn = cell.pack().worn();
    let root = worn.map_or(root, |worn| worn.root_out(root));
    let shown = (live.dress.as_ref()).and_then(|dress| dress.root_at_cursor(&live.character));
    let root = GlobalRoot::new(shown.unwrap_or(root.position), root.heading);
    v1::Session {
        id: cell.id().to_string(),
        pack: cell.pack().name().to_owned(),
        body: cell.pack().body_name().to_owned(),
        style: live.style.name.clone(),
        seed: cell.seed(),
        convention: units::convention_name(convention).into(),
        frame,
        position: Some(units::position(root.position, convention)),
        heading: heading(root, convention),
        speed: speed_mps * measure.scale(),
        last_sequence,
        clock: v1::Clock::from(cell.owner()).into(),
        ttl_ms: cell.ttl().as_millis() as u32,
        expires_in_ms: cell.left(now).as_millis() as u32,
        buffered_frames,
        stats: Some(stats_of(&stats, live.events.dropped())),
        priority: live.priority,
        scene: cell.scene().map(ToString::to_string).unwrap_or_default(),
        activity: Some(events::activity(live.character.activity())),
        held: events::held(&live.character, 0, measure),
        skeleton: worn.map(|worn| worn.name().to_string()).unwrap_or_default(),
        recorded: live.recorder.is_some(),
    }
}

/// A root's heading in the session's convention, -π to π radians.
pub(super) fn heading(root: GlobalRoot, convention: Convention) -> f32 {
    convention.heading_from_native(wrap_angle(root.heading))
}

fn stats_of(stats: &Stats, events_dropped: u64) -> v1::SessionStats {
    v1::SessionStats {
        plans_for_command: stats.plans_for_command,
        plans_for_low_buffer: stats.plans_for_low_buffer,
        plans_for_interval: stats.plans_for_interval,
        late_plans: stats.late_plans,
        underruns: stats.underruns,
        failed_plans: stats.failed_plans,
        events_dropped,
        plans_for_object: stats.plans_for_object,
    }
}
