use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use troupe_character::testing::{PERSON_HIPS_M, figure_of, joints_of, person};

use super::super::doc::JointsDoc;
use super::*;

fn figure(size: f32) -> Figure {
    figure_of(joints_of(&person(), size), None, size * PERSON_HIPS_M)
}

fn own(size: f32) -> Arc<Own> {
    let doc = SkeletonDoc {
        name: "hero".to_owned(),
        forced: false,
        notes: Vec::new(),
        body: BodyDoc::Joints(JointsDoc::of(&figure(size))),
    };
    Arc::new(Own::new(doc).unwrap())
}

fn text(own: &Own) -> String {
    serde_json::to_string(&own.doc).unwrap()
}

#[test]
fn a_skeleton_is_not_found_before_its_file_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("no folder");
    std::fs::write(&file, "").unwrap();
    let skeletons = Skeletons {
        folder: Some(file),
        ..Skeletons::load(None).unwrap()
    };
    let own = own(1.0);
    thread::scope(|scope| {
        // While this lock is held, nothing can be added.
        let all = skeletons.all();
        let (done, answer) = mpsc::channel();
        let (skeletons, own) = (&skeletons, &own);
        scope.spawn(move || done.send(skeletons.take_in(own, None, &text(own))));
        let taken = answer.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(matches!(taken, Err(SkeletonError::NotKept { .. })), "{taken:?}");
        assert!(all.is_empty());
    });
    assert_eq!(skeletons.count(), 0);
}

#[test]
fn a_skeleton_that_a_session_wears_keeps_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let skeletons = Skeletons::load(Some(folder.path().to_owned())).unwrap();
    let (first, second) = (own(1.0), own(1.2));
    skeletons.take_in(&first, None, &text(&first)).unwrap();
    let worn = Arc::new(Worn::between("hero", &first.figure, figure(0.8)).unwrap());
    first.fits().push(Fit {
        pack: "human".to_owned(),
        place: 0,
        worn: worn.clone(),
        live: Weak::new(),
    });
    let kept = || Skeletons::load(Some(folder.path().to_owned())).unwrap();
    let dress = worn.dress_for_session();
    let refused = skeletons.take_in(&second, Some(&first), &text(&second));
    assert!(
        matches!(refused, Err(SkeletonError::InUse { sessions: 1, .. })),
        "{refused:?}"
    );
    assert_eq!(kept().get("name", "hero").unwrap().doc, first.doc);
    drop(dress);
    skeletons.take_in(&second, Some(&first), &text(&second)).unwrap();
    assert_eq!(kept().get("name", "hero").unwrap().doc, second.doc);
    assert_eq!(skeletons.get("name", "hero").unwrap().doc, second.doc);
}

#[test]
fn what_does_not_fit_says_how_much_and_what_is_allowed() {
    let text = |(found, allowed): (String, String)| format!("{found}; allowed: {allowed}");
    assert_eq!(out_of_scale(0.05), None);
    assert_eq!(out_of_scale(20.0), None);
    assert_eq!(
        out_of_scale(0.041_955_996).map(text).unwrap(),
        "its legs are 0.042 times as long as the pack's; allowed: 0.05 to 20 times, in metres"
    );
    let (found, _) = out_of_scale(1234.56).unwrap();
    assert_eq!(found, "its legs are 1230 times as long as the pack's");
    let legs = RetargetError::Legs {
        source_on_fours: false,
    };
    assert_eq!(
        text(apart(&legs, true)),
        "it stands on four legs, and the pack's body on two; allowed: a body on two legs"
    );
    let (_, allowed) = apart(&legs, false);
    assert_eq!(allowed, "a body on four legs");
}
