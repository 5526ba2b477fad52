use std::path::Path as FilePath;

use troupe_engine::families::vermo::VerMoDoc;
use troupe_engine::pack::testing::language_table;
use troupe_motion::model::Task;
use v1::generate_request::Goal;

use super::*;
use crate::inbetween::{prepare_describe, prepare_prompt};

type Change = fn(&mut v1::GenerateRequest, &mut v1::Prompt);

fn pack() -> Pack {
    let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
    Pack::load(&folder).unwrap()
}

/// The pack, with other tasks and sizes.
fn pack_with(change: impl FnOnce(&mut VerMoDoc)) -> Pack {
    let mut pack = pack();
    change(language_table(&mut pack).as_mut().unwrap());
    pack
}

/// A pack without a language model.
fn plain_pack() -> Pack {
    let mut pack = pack();
    *language_table(&mut pack) = None;
    pack
}

fn keyframes(count: usize) -> Vec<v1::Keyframe> {
    let joints = pack().rig.dims.joints;
    let key = |frame: usize| v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x: 0.0,
                y: 0.9,
                z: 0.03 * frame as f32,
            }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(joints),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    };
    (0..count).map(key).collect()
}

fn agent(text: &str, past: usize) -> v1::Agent {
    v1::Agent {
        text: text.to_owned(),
        past: keyframes(past),
    }
}

fn audio(sound: v1::Sound, codes: &[u32]) -> Option<v1::Audio> {
    Some(v1::Audio {
        sound: sound.into(),
        codes: codes.to_vec(),
    })
}

/// What becomes of a prompt to walk, after a change.
fn prepared(pack: &Pack, change: Change) -> Result<crate::inbetween::Prepared, String> {
    let mut request = v1::GenerateRequest::default();
    let mut prompt = v1::Prompt {
        text: "walk".to_owned(),
        ..v1::Prompt::default()
    };
    change(&mut request, &mut prompt);
    request.goal = Some(Goal::Prompt(prompt.clone()));
    prepare_prompt(&Path::root(), &request, &prompt, pack).map_err(|error| error.to_string())
}

fn refusal(pack: &Pack, change: Change) -> String {
    prepared(pack, change).expect_err("it is taken")
}

#[test]
fn words_that_training_did_not_use_are_noted() {
    let notes = |change: Change| prepared(&pack(), change).unwrap().notes;
    assert_eq!(notes(|_, p| p.text = "An old person walks.".into()), [""; 0]);
    assert_eq!(
        notes(|_, p| p.text = "A robot walks like a robot, whirring".into()),
        ["captions of the pack's training have not used: robot, whirring"]
    );
    assert_eq!(
        notes(|_, p| p.text = "b c d e f g h i j k".into()),
        ["captions of the pack's training have not used: b, c, d, e, f, g, h, i, and others"]
    );
    // Of all characters, each word once.
    assert_eq!(
        notes(|_, p| {
            p.text = "A robot walks".into();
            p.others = vec![agent("a robot waves", 0), agent("a dragon waves", 0)];
        }),
        ["captions of the pack's training have not used: robot, dragon"]
    );
}

#[test]
fn what_the_pack_cannot_take_names_the_requests_field() {
    let cases: [(Change, &str); 21] = [
        (
            |_, p| p.text = "zz ".repeat(50),
            "prompt.text: is 150 pieces long; allowed: at most 40 pieces",
        ),
        (
            |_, p| p.text = "?!".into(),
            "prompt.text: is \"?!\"; allowed: letters that the pack can read",
        ),
        (
            |_, p| p.others = vec![agent("wave", 0), agent("?!", 0)],
            "prompt.others[1].text: is \"?!\"; allowed: letters that the pack can read",
        ),
        (
            |_, p| p.others = vec![agent("", 0)],
            "prompt.others[0].text: is empty; allowed: 1 to 1000 characters",
        ),
        (
            |_, p| {
                p.text.clear();
                p.others = vec![agent("wave", 0)];
            },
            "prompt.text: is empty; allowed: 1 to 1000 characters",
        ),
        (
            |_, p| p.others = vec![agent("wave", 0); 3],
            "prompt.others: is 3; allowed: 0 to 2",
        ),
        (
            |r, _| r.past = keyframes(15),
            "past: has 15 keyframes; allowed: none, or 16 to 256",
        ),
        (
            |r, p| {
                r.past = keyframes(16);
                p.others = vec![agent("wave", 16), agent("wave", 17)];
            },
            "prompt.others[1].past: has 17 keyframes; allowed: as many as past: 16",
        ),
        (
            |_, p| p.frame_count = Some(0),
            "prompt.frame_count: is 0; allowed: 1 to 1024",
        ),
        (
            |_, p| p.seconds = Some(0.0),
            "prompt.seconds: is 0; allowed: more than 0, and at most 34.1",
        ),
        (
            |_, p| p.seconds = Some(f32::NAN),
            "prompt.seconds: is NaN; allowed: more than 0, and at most 34.1",
        ),
        (
            |_, p| (p.seconds, p.frame_count) = (Some(1.0), Some(30)),
            "prompt.seconds: is given beside frame_count; allowed: one of the two",
        ),
        (
            |r, p| (r.past, p.targets) = (keyframes(16), keyframes(16)),
            "prompt.frame_count: is missing; allowed: frame_count or seconds beside targets",
        ),
        (
            |_, p| (p.frame_count, p.targets) = (Some(16), keyframes(16)),
            "prompt.targets: is 16; allowed: none without a context",
        ),
        (
            |r, p| (r.past, p.targets, p.frame_count) = (keyframes(16), keyframes(3), Some(16)),
            "prompt.targets: is 3; allowed: 4 or more",
        ),
        (
            |r, p| (r.past, p.targets, p.frame_count) = (keyframes(16), keyframes(16), Some(17)),
            "prompt.frame_count: is 17; allowed: 8 to 256 between context and targets, a multiple of 4",
        ),
        (
            |_, p| p.audio = audio(v1::Sound::Music, &[3, 64]),
            "prompt.audio.codes: has 64; allowed: codes below 64",
        ),
        (
            |_, p| p.audio = audio(v1::Sound::Music, &[]),
            "prompt.audio.codes: is empty; allowed: one code or more",
        ),
        (
            |_, p| (p.audio, p.seconds) = (audio(v1::Sound::Music, &[3]), Some(20.0)),
            "prompt.seconds: is 600 frames; allowed: 1 to 256 frames",
        ),
        (
            |r, p| (r.past, p.audio) = (keyframes(16), audio(v1::Sound::Speech, &[3])),
            "prompt.audio: is given; allowed: none beside a context, targets or other characters",
        ),
        (
            |_, p| p.flow_steps = Some(257),
            "prompt.flow_steps: is 257; allowed: 0 to 256",
        ),
    ];
    for (change, said) in cases {
        assert_eq!(refusal(&pack(), change), said);
    }
}

#[test]
fn a_task_without_training_names_the_field_that_asks_for_it() {
    use troupe_engine::pack::MessageTask;

    let words_only = pack_with(|table| table.tasks = vec![MessageTask::TextToMotion]);
    let mute = pack_with(|table| table.audio_codes = 0);
    let cases: [(&Pack, Change, &str); 5] = [
        (
            &words_only,
            |_, p| p.audio = audio(v1::Sound::Music, &[3]),
            "prompt.audio: needs one of the tasks music_to_dance; allowed: those of the pack: text_to_motion",
        ),
        (
            &words_only,
            |r, p| (r.past, p.targets, p.seconds) = (keyframes(16), keyframes(8), Some(1.0)),
            "prompt.targets: needs one of the tasks inbetween; allowed: those of the pack: text_to_motion",
        ),
        (
            &words_only,
            |r, p| (r.past, p.text) = (keyframes(16), String::new()),
            "past: needs one of the tasks continuation, prediction; allowed: those of the pack: text_to_motion",
        ),
        (
            &mute,
            |_, p| p.audio = audio(v1::Sound::Music, &[3]),
            "prompt.audio: is given; allowed: none: the pack tiny-vermo has no audio",
        ),
        (
            &plain_pack(),
            |_, p| p.flow_steps = Some(1),
            "prompt.flow_steps: is given; allowed: none: the pack tiny-vermo has no language model",
        ),
    ];
    for (pack, change, said) in cases {
        assert_eq!(refusal(pack, change), said);
    }
}

/// A place ahead, as a prompt's target.
fn place(z: f32) -> Vec<v1::Keyframe> {
    vec![v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x: 0.0, y: 0.0, z }),
            heading: Some(0.5),
        }),
        ..v1::Keyframe::default()
    }]
}

#[test]
fn a_root_alone_is_the_place_to_end_at() {
    // It needs neither a past nor a length, and the model does not see it.
    let found = prepared(&pack(), |_, p| p.targets = place(3.0)).unwrap();
    let Task::Prompt(task) = &found.task else {
        panic!("{:?}", found.task)
    };
    assert!(task.targets.is_empty() && task.frames.is_none());
    assert!(found.ending.is_some_and(|ending| !ending.is_gap()));
    // Its frames are no tokens.
    let found = prepared(&pack(), |_, p| (p.targets, p.seconds) = (place(1.0), Some(1.02))).unwrap();
    assert!(matches!(&found.task, Task::Prompt(task) if task.frames == Some(31)));

    let gap = prepared(&pack(), |r, p| {
        (r.past, p.targets, p.frame_count) = (keyframes(16), keyframes(16), Some(16));
    });
    assert!(gap.unwrap().ending.is_some_and(|ending| ending.is_gap()));
    assert!(prepared(&pack(), |_, _| ()).unwrap().ending.is_none());
}

#[test]
fn a_place_that_no_body_reaches_is_refused_with_a_way_on() {
    // Legs of 0.800665 m: 4.0033 m/s. Thirty frames from the origin are 29 steps, 3.87 m.
    let far: Change = |_, p| (p.targets, p.frame_count) = (place(8.0), Some(30));
    assert_eq!(
        refusal(&pack(), far),
        "prompt.targets[0].root.position: is 8.00 m away; \
         allowed: at most 3.87 m in 30 frames; or frame_count 61 or more"
    );
    let enough: Change = |_, p| (p.targets, p.frame_count) = (place(8.0), Some(61));
    assert!(prepared(&pack(), enough).is_ok());
    // The past goes on from 0.45 m ahead.
    let after: Change = |r, p| (r.past, p.targets, p.frame_count) = (keyframes(16), place(4.4), Some(30));
    assert!(prepared(&pack(), after).is_ok());
    let beside: Change = |_, p| (p.targets, p.others) = (place(1.0), vec![agent("wave", 0)]);
    assert_eq!(
        refusal(&pack(), beside),
        "prompt.targets[0]: is given; allowed: none beside other characters"
    );
    let moving: Change = |_, p| {
        p.targets = place(1.0);
        p.targets[0].velocity = Some(v1::RootVelocity::default());
    };
    assert!(refusal(&pack(), moving).starts_with("prompt.targets[0].velocity"));
}

#[test]
fn seconds_are_rounded_to_frames_and_beside_targets_to_tokens() {
    let frames = |change: Change| match prepared(&pack(), change).unwrap().task {
        Task::Prompt(task) => task.frames,
        other => panic!("{other:?}"),
    };
    assert_eq!(frames(|_, _| {}), None);
    assert_eq!(frames(|_, p| p.seconds = Some(1.02)), Some(31));
    assert_eq!(frames(|_, p| p.seconds = Some(0.001)), Some(1));
    let between: Change = |r, p| (r.past, p.targets, p.seconds) = (keyframes(16), keyframes(8), Some(1.02));
    assert_eq!(frames(between), Some(32));
}

#[test]
fn a_past_targets_or_audio_need_no_words() {
    for change in [
        (|r, _| r.past = keyframes(16)) as Change,
        |r, p| (r.past, p.targets, p.seconds) = (keyframes(16), keyframes(8), Some(1.0)),
        |_, p| p.audio = audio(v1::Sound::Speech, &[1, 2, 3]),
        |r, p| (r.past, p.others) = (keyframes(20), vec![agent(" ", 20)]),
    ] {
        let mut request = v1::GenerateRequest::default();
        let mut prompt = v1::Prompt::default();
        change(&mut request, &mut prompt);
        let prepared = prepare_prompt(&Path::root(), &request, &prompt, &pack()).unwrap();
        let Task::Prompt(task) = prepared.task else {
            panic!("no prompt")
        };
        assert!(task.text.is_empty() && task.others.iter().all(|other| other.text.is_empty()));
    }
}

#[test]
fn a_description_names_its_fields_too() {
    type Change = fn(&mut v1::DescribeRequest);
    use troupe_engine::pack::MessageTask;

    let said = |pack: &Pack, change: Change| {
        let mut request = v1::DescribeRequest {
            frames: keyframes(40),
            ..v1::DescribeRequest::default()
        };
        change(&mut request);
        prepare_describe(&request, pack)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    let other = |count| v1::OtherMotion {
        frames: keyframes(count),
    };
    assert_eq!(said(&pack(), |_| {}), Ok(()));
    assert_eq!(said(&pack(), |r| r.into = v1::Telling::Speech.into()), Ok(()));
    let no_music = pack_with(|table| table.tasks = vec![MessageTask::MotionToText]);
    let cases: [(&Pack, Change, &str); 9] = [
        (
            &pack(),
            |r| r.frames.truncate(1),
            "frames: has 1 keyframes; allowed: 2 to 1024",
        ),
        (
            &pack(),
            |r| r.frames.truncate(3),
            "frames: is 3; allowed: 4 to 259",
        ),
        (
            &pack(),
            |r| r.frames = keyframes(300),
            "frames: is 300; allowed: 4 to 259",
        ),
        (
            &pack(),
            |r| r.into = 9,
            "into: is 9; allowed: TELLING_WORDS (0), TELLING_MUSIC (1) or TELLING_SPEECH (2)",
        ),
        (
            &no_music,
            |r| r.into = v1::Telling::Music.into(),
            "into: needs the task dance_to_music; allowed: those of the pack: motion_to_text",
        ),
        (
            &plain_pack(),
            |r| r.into = v1::Telling::Music.into(),
            "into: asks for audio; allowed: words: the pack tiny-vermo has no language model",
        ),
        (
            &pack(),
            |r| {
                r.sampling = Some(v1::Sampling {
                    top_p: Some(2.0),
                    ..v1::Sampling::default()
                });
            },
            "sampling.top_p: is 2; allowed: more than 0, and at most 1",
        ),
        (
            &pack(),
            |r| r.frames[7].root.as_mut().unwrap().position.as_mut().unwrap().x = 2e4,
            "frames[7].root.position: is 20000 m from the last context frame; allowed: at most 10000 m from the last context frame",
        ),
        (
            &pack(),
            |r| r.frames[3].pose = None,
            "frames[3].pose: is missing; allowed: root and pose in every context keyframe",
        ),
    ];
    for (pack, change, wanted) in cases {
        assert_eq!(said(pack, change).unwrap_err(), wanted);
    }
    let mut request = v1::DescribeRequest {
        frames: keyframes(40),
        others: vec![other(40), other(39)],
        ..v1::DescribeRequest::default()
    };
    let error = prepare_describe(&request, &pack()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "others[1].frames: has 39 keyframes; allowed: as many as frames: 40"
    );
    request.others = vec![other(40); 3];
    let error = prepare_describe(&request, &pack()).unwrap_err();
    assert_eq!(error.to_string(), "others: is 3; allowed: 0 to 2");
}
