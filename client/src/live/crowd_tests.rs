//! Crowds and single sessions against a server by script.

use glam::Vec3;

use super::*;
use crate::live::testing::{Script, scripted};
use crate::problem::ProblemKind;

/// A crowd of characters c0, c1, ... with three to a request.
async fn crowd(client: &Client, pack: &Pack, count: usize) -> (Crowd, Vec<MemberId>) {
    let options = CrowdOptions {
        per_request: 3,
        ..CrowdOptions::default()
    };
    let mut crowd = Crowd::new(client, pack, options);
    let names = (0..count).map(|i| SessionOptions::new().id(format!("c{i}")));
    let members = crowd.add(&names.collect::<Vec<_>>()).await.unwrap();
    (crowd, members)
}

fn indices(step: &CrowdStep<'_>) -> Vec<usize> {
    let mut indices = step.characters().map(|(m, _)| m.index()).collect::<Vec<_>>();
    indices.sort_unstable();
    indices
}

#[tokio::test]
async fn a_crowd_is_split_and_put_together_again() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 8).await;
    crowd.step(1).await.unwrap();
    let step = crowd.step(2).await.unwrap();
    assert_eq!(indices(&step), (0..8).collect::<Vec<_>>());
    assert_eq!(step.waited(), Duration::from_micros(700));
    for &member in &members {
        let frames = step.get(member).unwrap();
        assert_eq!((frames.first_frame(), frames.len()), (1, 2));
        // The root's x is the index in the request of three.
        assert_eq!(frames.last().unwrap().root.x, (member.index() % 3) as f32);
    }
    let script = script.lock().unwrap();
    let mut sizes = script.steps[3..]
        .iter()
        .map(|s| s.session_ids.len())
        .collect::<Vec<_>>();
    sizes.sort_unstable();
    assert_eq!(sizes, [2, 3, 3]);
}

#[tokio::test]
async fn only_changed_intents_are_sent() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 3).await;
    crowd.step(1).await.unwrap();
    *crowd.intent_mut(members[1]).unwrap() = Locomotion::walk(Vec3::Z);
    crowd.step(1).await.unwrap();
    *crowd.intent_mut(members[1]).unwrap() = Locomotion::walk(Vec3::Z);
    crowd.step(1).await.unwrap();
    crowd.intent_mut(members[1]).unwrap().facing = Some(1.0);
    *crowd.intent_mut(members[2]).unwrap() = Locomotion::walk(Vec3::X);
    crowd.step(1).await.unwrap();
    let script = script.lock().unwrap();
    let sent = script.steps.iter().map(|step| {
        let commands = step.commands.iter();
        commands
            .map(|c| (c.session_id.as_str(), c.sequence))
            .collect::<Vec<_>>()
    });
    assert_eq!(
        sent.collect::<Vec<_>>(),
        [vec![], vec![("c1", 1)], vec![], vec![("c1", 2), ("c2", 1)]]
    );
}

#[tokio::test]
async fn acts_go_once_and_what_happens_comes_with_the_step() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 5).await;
    crowd.act(members[3], &Act::interact("cup").variant("slow"));
    let step = crowd.step(1).await.unwrap();
    let happened: Vec<_> = step.events().collect();
    assert_eq!((happened.len(), happened[0].0), (1, members[3]));
    let Some(v1::session_event::Kind::Started(started)) = &happened[0].1.kind else {
        panic!("{happened:?}");
    };
    assert_eq!(
        (started.instance.as_str(), started.variant.as_str()),
        ("cup", "slow")
    );
    let held: Vec<_> = step
        .held()
        .map(|(member, held)| (member, held.instance.as_str()))
        .collect();
    assert_eq!(held, [(members[3], "cup")]);
    let step = crowd.step(1).await.unwrap();
    assert_eq!((step.events().count(), step.held().count()), (0, 0));
    let sent = |script: &Script| script.steps.iter().map(|s| s.commands.len()).sum::<usize>();
    assert_eq!(sent(&script.lock().unwrap()), 1);

    // A single session gets events too.
    let mut guard = client
        .session(&pack, &SessionOptions::new().id("guard").scene("yard"))
        .await
        .unwrap();
    guard.act(&Act::interact("chair")).step(1).await.unwrap();
    assert_eq!(
        (guard.events().len(), guard.held().unwrap().instance.as_str()),
        (1, "chair")
    );
    guard.step(1).await.unwrap();
    assert!(guard.events().is_empty() && guard.held().is_none());
}

#[tokio::test]
async fn a_session_that_left_frees_its_room_but_not_its_index() {
    let (client, pack, _) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 3).await;
    assert!(crowd.remove(members[0]).is_some() && crowd.remove(members[0]).is_none());
    for round in 0..20 {
        let new = crowd.add(&[SessionOptions::new()]).await.unwrap();
        assert_eq!(new[0].index(), 3 + round);
        crowd.remove(new[0]).unwrap();
    }
    assert_eq!((crowd.len(), crowd.members.len()), (2, 2));
}

#[tokio::test]
async fn priorities_go_with_the_next_step() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 2).await;
    crowd.set_priority(members[1], 0.9);
    crowd.step(1).await.unwrap();
    crowd.set_priority(members[1], 0.9);
    crowd.step(1).await.unwrap();
    let script = script.lock().unwrap();
    let commands = &script.steps[0].commands;
    assert_eq!((commands.len(), commands[0].priority), (1, Some(0.9)));
    assert_eq!(commands[0].intent, None);
    assert!(script.steps[1].commands.is_empty());
}

#[tokio::test]
async fn an_ended_session_leaves_and_the_others_go_on() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 4).await;
    script.lock().unwrap().broken = [
        ("c0".to_owned(), "SESSION_EXPIRED"),
        ("c2".to_owned(), "SESSION_BUSY"),
        // It is alone in its request, which therefore fails as a whole.
        ("c3".to_owned(), "UNKNOWN_SESSION"),
    ]
    .into();
    let step = crowd.step(1).await.unwrap();
    assert_eq!(indices(&step), [1]);
    let faults = step
        .faults()
        .iter()
        .map(|f| (f.session.as_str(), f.left, f.problem.kind.clone()));
    let mut faults = faults.collect::<Vec<_>>();
    faults.sort_by_key(|f| f.0.to_owned());
    assert_eq!(
        faults,
        [
            ("c0", true, ProblemKind::SessionExpired),
            ("c2", false, ProblemKind::SessionBusy),
            ("c3", true, ProblemKind::UnknownSession),
        ]
    );
    assert!(step.get(members[0]).is_none() && step.get(members[2]).is_none());
    assert_eq!((crowd.len(), crowd.session(members[3]).is_none()), (2, true));
    assert!(crowd.intent_mut(members[0]).is_none());

    // The busy character is tried again, and a new one does not take another's name.
    script.lock().unwrap().broken.clear();
    let new = crowd.add(&[SessionOptions::new().id("c9")]).await.unwrap();
    assert_eq!(new[0].index(), 4);
    let step = crowd.step(1).await.unwrap();
    assert_eq!(indices(&step), [1, 2, 4]);
    assert!(step.faults().is_empty());
}

#[tokio::test]
async fn a_request_without_a_served_session_reports_each_problem() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, _) = crowd(&client, &pack, 3).await;
    script.lock().unwrap().broken = [
        ("c0".to_owned(), "SESSION_BUSY"),
        ("c1".to_owned(), "SESSION_EXPIRED"),
        ("c2".to_owned(), "SESSION_BUSY"),
    ]
    .into();
    let step = crowd.step(1).await.unwrap();
    let left = step.faults().iter().map(|f| f.left).collect::<Vec<_>>();
    assert_eq!(left, [false, true, false]);
    assert_eq!(crowd.len(), 2);
}

#[tokio::test]
async fn refused_commands_are_faults_of_those_who_move_on() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 3).await;
    script.lock().unwrap().unknown_style = Some("wlak");
    *crowd.intent_mut(members[1]).unwrap() = Locomotion::walk(Vec3::Z).style("wlak");
    let step = crowd.step(1).await.unwrap();
    assert_eq!(indices(&step), [0, 1, 2]);
    let [fault] = step.faults() else {
        panic!("{:?}", step.faults())
    };
    assert_eq!((fault.member, fault.left), (members[1], false));
    assert_eq!(fault.problem.kind, ProblemKind::UnknownStyle);
}

#[tokio::test]
async fn commands_of_a_failed_step_are_sent_again() {
    let (client, pack, script) = scripted().await;
    let (mut crowd, members) = crowd(&client, &pack, 1).await;
    *crowd.intent_mut(members[0]).unwrap() = Locomotion::walk(Vec3::Z);
    script.lock().unwrap().unavailable = true;
    let error = crowd.step(1).await.map(|_| ()).unwrap_err();
    assert!(matches!(error, ClientError::Refused(_)), "{error}");
    crowd.step(1).await.unwrap();
    let script = script.lock().unwrap();
    let sequences = script
        .steps
        .iter()
        .map(|s| s.commands[0].sequence)
        .collect::<Vec<_>>();
    assert_eq!(sequences, [1, 2]);
}

#[tokio::test]
async fn figures_are_those_of_the_crowds_own_sessions() {
    let (client, pack, _) = scripted().await;
    let (crowd, _) = crowd(&client, &pack, 2).await;
    let stats = crowd.stats().await.unwrap();
    assert_eq!((stats.underruns, stats.plans_for_command), (5, 2));
}

#[tokio::test]
async fn a_session_tells_when_it_expired_and_what_was_refused() {
    let (client, pack, script) = scripted().await;
    let mut session = client
        .session(&pack, &SessionOptions::new().id("a"))
        .await
        .unwrap();
    script.lock().unwrap().unknown_style = Some("wlak");
    session.walk(Vec3::Z).style("wlak");
    let error = session.step(2).await.map(|_| ()).unwrap_err();
    assert_eq!(error.session_problem().unwrap().kind, ProblemKind::UnknownStyle);
    assert_eq!(session.frames().len(), 2, "it moved on all the same");
    session.style("walk");
    assert_eq!(session.step(1).await.unwrap().first_frame(), 2);

    session.stand();
    session.send().await.unwrap();
    session.step(1).await.unwrap();
    assert!(script.lock().unwrap().steps.last().unwrap().commands.is_empty());

    script.lock().unwrap().broken = [("a".to_owned(), "SESSION_EXPIRED")].into();
    let error = session.step(1).await.map(|_| ()).unwrap_err();
    assert!(error.is_session_expired(), "{error}");
}

#[tokio::test]
async fn a_session_looks_ahead_beside_its_frames() {
    let (client, pack, _) = scripted().await;
    let mut session = client
        .session(&pack, &SessionOptions::new().id("a"))
        .await
        .unwrap();
    session.step(2).await.unwrap();
    let future = session.future().await.unwrap();
    assert_eq!((future.first_frame(), future.len()), (11, 3));
    assert_eq!(session.frames().len(), 2, "the frames of the step are kept");
}
