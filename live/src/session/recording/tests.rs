use std::sync::Arc;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;

use super::digest::Digest;
use super::format::{
    ClockWord, Ending, Event, FORMAT, Head, Load, Origin, Reader, RecordingError, Shown, Why,
};
use super::shelf::{MAX_RECORDINGS, Shelf};
use super::tape::{MAX_RECORDING_BYTES, Tape};

fn head() -> Head {
    Head {
        troupe_recording: FORMAT,
        made_with: Origin {
            server: "1.2.3".to_owned(),
            pack: "toy".to_owned(),
            pack_version: "7".to_owned(),
            content_hash: "sha256:00".to_owned(),
            body: String::new(),
            engine: "cpu".to_owned(),
            cpu: "a CPU".to_owned(),
            style: Digest(0xab),
            skeleton: None,
        },
        session: v1::SessionOptions {
            seed: u64::MAX,
            ..v1::SessionOptions::default()
        },
    }
}

fn walk(sequence: u64, x: f32) -> Event {
    Event::Command(Box::new(v1::Command {
        session_id: "a".to_owned(),
        sequence,
        intent: Some(Intent::Locomote(v1::Locomote {
            velocity: Some(v1::Vec3 { x, y: 0.0, z: 1.0 }),
            ..v1::Locomote::default()
        })),
        ..v1::Command::default()
    }))
}

fn frame(number: u64) -> Event {
    Event::Frame(Shown {
        number,
        root: Digest(1),
        rotations: Digest(2),
        contacts: 3,
        underrun: number == 2,
        hinges: None,
    })
}

fn events() -> Vec<Event> {
    vec![
        Event::Clock(ClockWord::Runs),
        walk(1, 0.1),
        Event::Style("sneak".to_owned(), Digest(u32::MAX)),
        Event::Load(Load {
            expected_frames: 3,
            lead_frames: 1,
            stretch: 0.3,
        }),
        Event::Go(300),
        Event::Plan(4),
        frame(1),
        Event::Failed(5),
        frame(2),
    ]
}

fn recorded() -> String {
    let tape = Tape::new(&head());
    for event in events() {
        assert!(tape.write(&event));
    }
    tape.end(Why::Sentence);
    let (text, ended) = tape.read();
    assert!(ended);
    text
}

/// All events of a text after its head.
fn read(text: &str) -> Result<(Head, Vec<Event>), RecordingError> {
    let (mut reader, head) = Reader::new(text.to_owned())?;
    let mut events = Vec::new();
    while let Some(event) = reader.next()? {
        events.push(event);
    }
    Ok((head, events))
}

#[test]
fn a_recording_is_read_as_it_was_written() {
    let text = recorded();
    let mut wanted = events();
    wanted.push(Event::End(Ending {
        why: Why::Sentence,
        frame: 2,
    }));
    assert_eq!(read(&text), Ok((head(), wanted)));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[5], r#"{"go":300}"#);
    assert_eq!(
        lines[7],
        r#"{"frame":{"number":1,"root":"00000001","rotations":"00000002","contacts":3}}"#
    );
    assert_eq!(lines[10], r#"{"end":{"why":"sentence","frame":2}}"#);
}

#[test]
fn a_recording_that_is_cut_off_has_the_events_before_the_cut() {
    let text = recorded();
    let (_, all) = read(&text).unwrap();
    let whole_head = text.find('\n').unwrap() + 1;
    for cut in 0..text.len() {
        match read(&text[..cut]) {
            Ok((_, events)) => {
                assert!(cut >= whole_head);
                assert_eq!(events.len(), text[whole_head..cut].matches('\n').count());
                assert_eq!(events, all[..events.len()]);
            }
            Err(error) => assert!(
                cut < whole_head
                    && error
                        .to_string()
                        .contains("line 1 of the recording: it is not whole"),
                "{cut}: {error}"
            ),
        }
    }
}

#[test]
fn a_recording_of_a_newer_format_is_refused_whatever_else_it_has() {
    let text = "{\"troupe_recording\": 2, \"new\": [1, 2]}\n{\"newer\": 1}\n";
    assert_eq!(read(text), Err(RecordingError::Newer { found: 2 }));
}

#[test]
fn a_wrong_line_is_named() {
    let text = recorded();
    let error = |from: &str, to: &str| read(&text.replace(from, to)).unwrap_err().to_string();
    for (from, to, line, says) in [
        ("{\"go\":300}", "{\"walk\":300}", 6, "walk"),
        ("{\"plan\":4}", "{\"plan\":-4}", 7, "-4"),
        (
            "\"root\":\"00000001\"",
            "\"root\":\"1\"",
            8,
            "8 hexadecimal digits",
        ),
        ("\"engine\":\"cpu\"", "\"motor\":\"cpu\"", 1, "motor"),
        ("\"clock\":\"runs\"", "\"clock\":\"flies\"", 2, "flies"),
    ] {
        let error = error(from, to);
        assert!(
            error.starts_with(&format!("line {line} of the recording: ")) && error.contains(says),
            "{error}"
        );
    }
}

#[test]
fn a_full_recording_ends_and_says_so() {
    let tape = Tape::new(&head());
    let mut written = 0;
    while tape.write(&frame(written + 1)) {
        written += 1;
    }
    assert!(!tape.write(&Event::Go(1)));
    let (text, ended) = tape.read();
    assert!(ended && text.len() <= MAX_RECORDING_BYTES);
    assert!(text.len() > MAX_RECORDING_BYTES - 512, "{}", text.len());
    let (_, events) = read(&text).unwrap();
    assert_eq!(events.len() as u64, written + 1);
    let end = Ending {
        why: Why::Full,
        frame: written,
    };
    assert_eq!(events.last(), Some(&Event::End(end)));
}

#[test]
fn a_new_recording_takes_the_place_of_the_one_that_is_needed_least() {
    let (shelf, now) = (Shelf::default(), Instant::now());
    let (mine, other) = (Some(Arc::from("mine")), None);
    let tape = || Arc::new(Tape::new(&head()));
    let ids: Vec<Arc<str>> = (0..MAX_RECORDINGS)
        .map(|index| format!("s{index}").into())
        .collect();
    let tapes: Vec<_> = ids.iter().map(|_| tape()).collect();
    for (index, (id, tape)) in ids.iter().zip(&tapes).enumerate() {
        let tenant = if index == 3 { &mine } else { &other };
        shelf.add(tenant, id, tape.clone(), now);
    }
    // The only one whose session ended goes first, then the only one of the tenant.
    tapes[7].session_ended(now);
    shelf.add(&mine, &"a".into(), tape(), now);
    assert!(shelf.find(&other, "s7", now).is_none() && shelf.find(&mine, "s3", now).is_some());
    shelf.add(&mine, &"b".into(), tape(), now);
    assert!(shelf.find(&mine, "s3", now).is_none() && shelf.find(&mine, "a", now).is_some());
    assert!(!tapes[3].write(&Event::Go(1)), "a session goes on to write");
    assert_eq!(tapes[3].read().0, "");
    assert!(shelf.find(&other, "s0", now).is_some());
    // No tenant sees the recordings of another.
    assert!(shelf.find(&mine, "s0", now).is_none());
}

#[test]
fn a_recording_is_kept_for_an_hour_after_its_session() {
    let (shelf, now) = (Shelf::default(), Instant::now());
    let (id, tape) = (Arc::from("a"), Arc::new(Tape::new(&head())));
    shelf.add(&None, &id, tape.clone(), now);
    let later = now + Duration::from_secs(86_400);
    assert!(shelf.find(&None, "a", later).is_some(), "its session is open");
    tape.session_ended(later);
    let (text, _) = shelf.find(&None, "a", later).unwrap().read();
    assert!(
        text.ends_with("{\"end\":{\"why\":\"session_ended\",\"frame\":0}}\n"),
        "{text}"
    );
    let hour = Duration::from_secs(3600);
    assert!(
        shelf
            .find(&None, "a", later + hour - Duration::from_millis(1))
            .is_some()
    );
    assert!(shelf.find(&None, "a", later + hour).is_none());
}

proptest! {
    /// Commands and loads come back with the same bits: decimals in a file lose none.
    #[test]
    fn numbers_keep_their_bits(number in any::<f32>().prop_filter("finite", |number| number.is_finite())) {
        let tape = Tape::new(&head());
        tape.write(&walk(1, number));
        tape.write(&Event::Load(Load { expected_frames: 0, lead_frames: 0, stretch: number }));
        let (_, events) = read(&tape.read().0).unwrap();
        let bits = events.iter().filter_map(|event| match event {
            Event::Command(command) => match &command.intent {
                Some(Intent::Locomote(locomote)) => locomote.velocity.map(|velocity| velocity.x.to_bits()),
                _ => None,
            },
            Event::Load(load) => Some(load.stretch.to_bits()),
            _ => None,
        });
        prop_assert_eq!(bits.collect::<Vec<_>>(), [number.to_bits(); 2]);
    }
}
