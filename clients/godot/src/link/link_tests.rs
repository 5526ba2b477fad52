use std::net::TcpListener;
use std::time::{Duration, Instant};

use glam::Affine3A;
use troupe_client::{Act, SessionOptions};

use super::*;
use crate::rig::{Bone, Front, Rig};

fn wanted() -> Wanted {
    let hips = Bone {
        name: "Hips".to_owned(),
        parent: None,
        rest: Affine3A::IDENTITY,
    };
    Wanted {
        rig: Rig::new(&[hips], "Hips", Affine3A::IDENTITY, Front::Model).unwrap(),
        pack: String::new(),
        body: String::new(),
        session: SessionOptions::new(),
    }
}

fn options(url: String) -> LinkOptions {
    LinkOptions {
        url,
        ..LinkOptions::default()
    }
}

/// Waits for something that comes in a moment.
fn soon<T>(mut found: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + Duration::from_secs(10);
    while Instant::now() < until {
        if let Some(found) = found() {
            return found;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("it does not come");
}

fn failure(link: &Link) -> String {
    soon(|| match link.status() {
        Status::Failed(message) => Some(message),
        Status::Opening | Status::Open => None,
    })
}

#[test]
fn characters_of_a_connection_that_fails_hear_of_it_before_and_after() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let link = Link::open(&options(format!("http://127.0.0.1:{port}"))).unwrap();
    let early = link.join(wanted());
    let message = failure(&link);
    assert!(message.contains("refused"), "{message}");
    assert_eq!(soon(|| early.take_note()), Note::Failed(message.clone()));
    let late = link.join(wanted());
    assert_eq!(late.take_note(), Some(Note::Failed(message)));
    assert_eq!(late.order(Order::Act(Act::Drop)), Err(OrderError::Gone));
}

#[test]
fn a_link_that_is_dropped_ends_though_the_server_says_nothing() {
    // It takes connections, and does not answer.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let link = Link::open(&options(format!("http://{}", silent.local_addr().unwrap()))).unwrap();
    let actor = link.join(wanted());
    let (_stream, _) = silent.accept().unwrap();
    let begun = Instant::now();
    link.close().unwrap().join().unwrap();
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    let note = actor.take_note();
    assert_eq!(note, Some(Note::Failed("the connection was closed".to_owned())));
}

#[test]
fn a_file_of_two_that_is_alone_is_an_error() {
    let half = LinkOptions {
        key_file: "key.pem".to_owned(),
        ..options("https://127.0.0.1:1".to_owned())
    };
    let error = Link::open(&half).err().unwrap().to_string();
    assert_eq!(error, "key_file is set, so certificate_file must be set too");
    let missing = LinkOptions {
        certificate_file: "/no/such/file.pem".to_owned(),
        ..half
    };
    let message = failure(&Link::open(&missing).unwrap());
    assert!(message.contains("/no/such/file.pem"), "{message}");
}

#[test]
fn an_unknown_event_has_no_note() {
    let event = |kind| troupe_proto::v1::SessionEvent { frame: 7, kind };
    assert_eq!(Note::of(&event(None)), None);
    let arrived = troupe_proto::v1::PathArrived {
        late: 0.5,
        off: 0.125,
    };
    let kind = troupe_proto::v1::session_event::Kind::Arrived(arrived);
    assert_eq!(Note::of(&event(Some(kind))), Some(Note::Arrived { off_m: 0.125 }));
}
