use std::sync::Arc;
use std::time::Instant;

use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use super::super::drive::roster::Roster;
use super::super::encode::Form;
use super::super::registry::tests::Setup;
use super::super::{Registry, TimeSource};
use super::*;
use troupe_base::telemetry::Telemetry;
use troupe_character::live::{FailReason, SUB_FRAMES};
use troupe_character::scene::{Scene, SceneTable, Transform};
use troupe_motion::conventions::Convention;

fn event(frame: u64, kind: EventKind) -> CharacterEvent {
    CharacterEvent { frame, kind }
}

fn done(frame: u64) -> CharacterEvent {
    event(
        frame,
        EventKind::Done {
            instance: "chair".into(),
        },
    )
}

fn metrics() -> SessionMetrics {
    SessionMetrics::new(&Telemetry::new().unwrap(), "human", "1")
}

#[test]
fn the_oldest_events_are_dropped_and_counted() {
    let (mut queue, metrics) = (EventQueue::default(), metrics());
    let collect = |queue: &mut EventQueue, frames: std::ops::Range<u64>| {
        queue.collect(|fresh| fresh.extend(frames.map(done)), &metrics);
    };
    assert_eq!(queue.take(0, "a", Convention::Native.into()), None);
    collect(&mut queue, 0..60);
    collect(&mut queue, 60..70);
    let taken = queue.take(3, "a", Convention::Native.into()).unwrap();
    let frames: Vec<u64> = taken.events.iter().map(|event| event.frame).collect();
    assert_eq!(frames, (6..70).collect::<Vec<_>>());
    assert_eq!(
        (taken.slot, taken.session_id.as_str(), taken.events_dropped),
        (3, "a", 6)
    );
    assert_eq!(queue.take(3, "a", Convention::Native.into()), None, "taken once");
    collect(&mut queue, 70..71);
    let taken = queue.take(3, "a", Convention::Native.into()).unwrap();
    assert_eq!(
        (taken.events.len(), taken.events_dropped, queue.dropped()),
        (1, 6, 6)
    );
}

#[test]
fn places_and_heights_are_in_the_sessions_convention_and_errors_in_metres() {
    let unreal = |kind| super::kind(kind, Convention::Unreal.into());
    let at = Transform::new(Vec3::new(1.0, 2.0, 3.0), yaw(0.5));
    let Kind::Released(released) = unreal(EventKind::Released {
        instance: "cup".into(),
        transform: at,
    }) else {
        panic!("another kind");
    };
    let position = released.position.unwrap();
    assert_eq!((position.x, position.y, position.z), (300.0, -100.0, 200.0));
    let q = released.rotation.unwrap();
    let back = Convention::Unreal.rotation_to_native(Quat::from_xyzw(q.x, q.y, q.z, q.w));
    assert!(back.dot(at.rotation).abs() > 0.999_999);
    assert_eq!(
        unreal(EventKind::Fell { height_m: Some(1.5) }),
        Kind::Fell(v1::CharacterFell { height: Some(150.0) })
    );
    assert_eq!(
        unreal(EventKind::Landed {
            height_m: 1.5,
            speed_mps: 5.0
        }),
        Kind::Landed(v1::CharacterLanded {
            height: 150.0,
            speed: 5.0
        })
    );
    let far = KeyframeError {
        root_m: 0.1,
        heading: std::f32::consts::PI,
        joint_m: 0.2,
    };
    let Kind::Reached(reached) = unreal(EventKind::Reached {
        instance: "cup".into(),
        set: "reach".to_owned(),
        keyframe: 1,
        before: far,
        after: KeyframeError::default(),
        early_frames: 3,
    }) else {
        panic!("another kind");
    };
    assert_eq!(reached.early_frames, 3);
    let before = reached.before.unwrap();
    assert_eq!(
        (before.root_m, before.heading_deg, before.joint_m),
        (0.1, 180.0, 0.2)
    );
    let Kind::Failed(failed) = unreal(EventKind::Failed {
        instance: "cup".into(),
        reason: FailReason::NotReached,
        message: "too far".to_owned(),
    }) else {
        panic!("another kind");
    };
    assert_eq!(
        (failed.reason.as_str(), failed.message.as_str()),
        ("NOT_REACHED", "too far")
    );
}

#[test]
fn ends_of_performances_have_a_word_and_failures_a_message() {
    let ended_as = |end| {
        let kind = kind(EventKind::Performed { number: 7, end }, Convention::Unreal.into());
        match kind {
            Kind::Performed(ended) => (ended.sequence, ended.reason, ended.message),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        ended_as(PerformanceEnd::Late),
        (7, "LATE".to_owned(), String::new())
    );
    let failed = PerformanceEnd::Failed("no frames".to_owned());
    assert_eq!(ended_as(failed), (7, "FAILED".to_owned(), "no frames".to_owned()));
    let text: Arc<str> = "wave".into();
    let performing = activity(Activity::Performing { text });
    assert_eq!(
        (performing.kind(), performing.text.as_str()),
        (v1::ActivityKind::Performing, "wave")
    );
}

#[test]
fn activities_name_object_and_set() {
    let instance: Arc<str> = "chair".into();
    let set = "sit".to_owned();
    let held = activity(Activity::Held { instance, set });
    assert_eq!(
        (held.kind(), held.instance.as_str(), held.set.as_str()),
        (v1::ActivityKind::Held, "chair", "sit")
    );
    assert_eq!(activity(Activity::Locomotion), v1::Activity::default());
}

/// What happens on a stream waits in its sessions while the stream has no room for it.
#[tokio::test]
async fn a_tick_takes_what_happened_or_leaves_it() {
    let scenes = SceneTable::default();
    scenes.add("yard", Scene::default()).unwrap();
    let setup = Setup::new(2).await;
    let inside = setup.cell_in("inside", Some(scenes.enter("yard").unwrap()));
    let cells = [setup.cell("outside"), inside.clone()];
    let registry = Arc::new(Registry::new(4));
    registry
        .insert(&cells, Instant::now(), |_| String::new())
        .unwrap();
    let mut roster = Roster::new(registry, TimeSource::default(), 4, false, &Arc::default());
    let form = Form {
        encoding: v1::Encoding::F32,
        positions: false,
        six_d: false,
    };
    let attached = roster
        .attach(&["outside".to_owned(), "inside".to_owned()], form)
        .await;
    inside
        .live()
        .events
        .collect(|fresh| fresh.push(done(0)), &metrics());
    roster.tick(SUB_FRAMES, form, None).await;
    let mut happened = Vec::new();
    let (frames, _) = roster.tick(SUB_FRAMES, form, Some(&mut happened)).await;
    assert!(frames.held.is_empty());
    let slot = attached.sessions[1].slot;
    let taken: Vec<_> = happened
        .iter()
        .map(|of| (of.slot, of.session_id.as_str(), of.events.len()))
        .collect();
    assert_eq!(taken, [(slot, "inside", 1)]);
    happened.clear();
    roster.tick(SUB_FRAMES, form, Some(&mut happened)).await;
    assert!(happened.is_empty());
}
