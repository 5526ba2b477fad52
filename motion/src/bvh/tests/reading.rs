//! What the reader accepts, and what it refuses, with the line.

use glam::DVec3;
use proptest::prelude::*;

use super::SMALL;
use crate::bvh::error::FoundFrames;
use crate::bvh::{
    BvhError, BvhErrorKind, BvhFile, Channel, MAX_DEPTH, MAX_FRAMES, MAX_JOINTS, MAX_NAME_BYTES, parse,
    parse_bytes, parse_tolerant,
};

fn error(text: &str) -> (usize, BvhErrorKind) {
    let BvhError { line, kind } = parse(text).expect_err(text);
    (line, kind)
}

/// `SMALL` with one piece, which it must contain, replaced.
fn with(from: &str, to: &str) -> String {
    assert!(SMALL.contains(from), "{from}");
    SMALL.replacen(from, to, 1)
}

#[test]
fn a_small_file_by_hand() {
    let file = parse(SMALL).unwrap();
    let [hips, chest] = file.joints() else {
        panic!("two joints")
    };
    assert_eq!(
        (hips.name.as_str(), hips.parent, hips.channels.len()),
        ("Hips", None, 6)
    );
    assert_eq!((chest.name.as_str(), chest.parent), ("Chest", Some(0)));
    assert_eq!(chest.offset, DVec3::new(0.0, 10.0, 0.0));
    assert_eq!(
        chest.channels,
        [Channel::Zrotation, Channel::Xrotation, Channel::Yrotation]
    );
    assert_eq!(chest.end_sites, [DVec3::new(0.0, 5.0, 0.0)]);
    assert_eq!((file.frames(), file.row(0).len(), file.fps()), (2, 9, 30.0));
    assert_eq!(file.row(1), [4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 0.0, 90.0, 0.0]);
}

#[test]
fn loose_forms_read_the_same() {
    let want = parse(SMALL).unwrap();
    let same = |text: &str| assert_eq!(parse(text).unwrap(), want, "{text}");
    same(&SMALL.replace('\n', "\r\n"));
    same(&SMALL.replace('\n', "\r"));
    same(&SMALL.replace('\n', "\n\n \t\n"));
    same(&SMALL.replace("  ", "\t"));
    same(&format!("\u{feff}{SMALL}"));
    same(SMALL.trim_end());
    same(&with("ROOT Hips\n{", "root   Hips{"));
    same(&with("Frames: 2", "frames:2"));
    same(&with("Frame Time: 0.0333333", "Frame   Time :\t3.33333E-2"));
    same(&with("End Site", "End Site  Head Top"));
    same(&with("Zrotation", "ZROTATION"));
    same(&with("1 2 3 90 0 0", "+1. 20e-1\t.3e1 9E+1 -0 0.0 "));
    // The whole hierarchy on one line.
    let (head, tail) = SMALL.split_once("MOTION").unwrap();
    same(&format!("{} MOTION{tail}", head.replace('\n', " ")));
}

#[test]
fn names_keep_their_spaces_and_signs() {
    let file = parse(&with("JOINT Chest", "JOINT  mixamorig:Spine 1 }  ")).unwrap();
    assert_eq!(file.joints()[1].name, "mixamorig:Spine 1 }");
}

#[test]
fn several_roots_and_joints_without_channels() {
    let text = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Yrotation } ROOT b\n{ OFFSET 1 1 1 }\nMOTION\n\
        Frames: 1\nFrame Time: 1\n7\n";
    let file = parse(text).unwrap();
    assert_eq!(
        file.joints().iter().map(|j| j.parent).collect::<Vec<_>>(),
        [None, None]
    );
    assert!(file.joints()[1].channels.is_empty());
    assert_eq!(file.row(0), [7.0]);
}

#[test]
fn no_frames_are_fine() {
    let (head, _) = SMALL.split_once("1 2 3").unwrap();
    assert_eq!(
        parse(&head.replace("Frames: 2", "Frames: 0")).unwrap().frames(),
        0
    );
}

#[test]
fn malformed_hierarchies_name_the_line() {
    use BvhErrorKind::*;
    let expected = |expected, found: &str| Expected {
        expected,
        found: found.to_owned(),
    };
    assert_eq!(error(""), (1, UnexpectedEnd("HIERARCHY")));
    assert_eq!(error("\n\nhello"), (3, expected("HIERARCHY", "hello")));
    assert_eq!(error(&with("ROOT", "JOINT")), (2, expected("ROOT", "JOINT")));
    assert_eq!(error(&with("ROOT Hips", "ROOT")), (3, Name));
    assert_eq!(error(&with("Hips\n{", "Hips\n")), (4, expected("{", "OFFSET")));
    assert_eq!(
        error(&with("OFFSET 0 10 0", "OFFSET 0 x 0")),
        (8, expected("a number", "x"))
    );
    // The third number is missing, so the next word takes its place.
    assert_eq!(
        error(&with("OFFSET 0 10 0", "OFFSET 0 10")),
        (9, expected("a number", "CHANNELS"))
    );
    assert_eq!(
        error(&with("OFFSET 0 10 0", "OFFSET 0 nan 0")),
        (8, NotFinite("nan".to_owned()))
    );
    assert_eq!(
        error(&with("OFFSET 0 10 0\n", "\n")),
        (14, NoOffset("Chest".to_owned()))
    );
    assert_eq!(
        error(&with("OFFSET 0 5 0", "")),
        (13, NoOffset("End Site".to_owned()))
    );
    assert_eq!(
        error(&with("OFFSET 0 10 0", "OFFSET 0 1 0 OFFSET 0 1 0")),
        (8, Repeated("OFFSET"))
    );
    assert_eq!(
        error(&with("CHANNELS 3", "CHANNELS 7")),
        (9, ChannelCount("7".to_owned()))
    );
    assert_eq!(
        error(&with("CHANNELS 3", "CHANNELS -1")),
        (9, ChannelCount("-1".to_owned()))
    );
    assert_eq!(
        error(&with("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation")),
        (
            9,
            expected("a channel such as Xposition or Zrotation", "Wrotation")
        )
    );
    assert_eq!(
        error(&with("3 Zrotation", "3 Xrotation")),
        (9, DuplicateChannel("Xrotation"))
    );
    assert_eq!(error(&with("End Site", "Fin Site")).0, 10);
    assert_eq!(
        error(&with("}\nMOTION", "}\n}\nMOTION")),
        (16, expected("MOTION", "}"))
    );
    assert_eq!(error(&with("  }\n}\nMOTION", "  }\nMOTION")).0, 15);
    assert_eq!(
        error(SMALL.split_once("MOTION").unwrap().0),
        (16, UnexpectedEnd("MOTION"))
    );
    let late = "HIERARCHY ROOT a {\n OFFSET 0 0 0 JOINT b { OFFSET 0 0 0 }\n CHANNELS 1 Xrotation }";
    assert_eq!(error(late), (3, Repeated("CHANNELS")));
    let still = "HIERARCHY ROOT a { OFFSET 0 0 0 }\nMOTION\nFrames: 3\nFrame Time: 1\n";
    assert_eq!(error(still), (2, NoChannels));
}

#[test]
fn malformed_motion_names_the_line() {
    use BvhErrorKind::*;
    assert_eq!(error(&with("Frames: 2", "Frames: two")).0, 17);
    assert_eq!(error(&with("Frames: 2", "Frames: -2")).0, 17);
    assert_eq!(error(&with("Frames: 2", "Frames: 1.5")).0, 17);
    assert_eq!(error(&with("0.0333333", "0")), (18, FrameTime(0.0)));
    assert_eq!(error(&with("0.0333333", "-1")), (18, FrameTime(-1.0)));
    assert_eq!(
        error(&with("0.0333333", "inf")),
        (18, NotFinite("inf".to_owned()))
    );
    assert_eq!(
        error(&with("4 5 6 0", "4 5 6")),
        (
            20,
            RowLength {
                frame: 1,
                found: 8,
                expected: 9
            }
        ),
        "a number is missing in the second row"
    );
    assert_eq!(
        error(&with("1 2 3", "0 1 2 3")),
        (
            19,
            RowLength {
                frame: 0,
                found: 10,
                expected: 9
            }
        )
    );
    assert_eq!(
        error(&with("Frames: 2", "Frames: 3")),
        (
            21,
            FrameCount {
                declared: 3,
                found: FoundFrames::Only(2)
            }
        )
    );
    assert_eq!(
        error(&with("Frames: 2", "Frames: 1")),
        (
            20,
            FrameCount {
                declared: 1,
                found: FoundFrames::More
            }
        )
    );
    for word in ["NaN", "-inf", "1e999", "-1.#IND", "1.#QNAN", "-nan(ind)"] {
        assert_eq!(
            error(&with("4 5 6", &format!("4 {word} 6"))),
            (20, NotFinite(word.to_owned()))
        );
    }
    assert_eq!(error(&with("4 5 6", "4 5,5 6")).0, 20);
    let text = parse(&with("4 5 6", "4 oops 6")).unwrap_err().to_string();
    assert_eq!(text, "line 20: expected a number, found \"oops\"");
}

#[test]
fn lines_count_in_every_line_end() {
    for end in ["\n", "\r\n"] {
        let text = with("4 5 6", "4 x 6").replace('\n', end);
        assert_eq!(error(&text).0, 20);
    }
    let bytes = [b"HIERARCHY\nROOT a\xff".as_slice(), b"\n"].concat();
    assert_eq!(
        parse_bytes(&bytes),
        Err(BvhError {
            line: 2,
            kind: BvhErrorKind::NotUtf8
        })
    );
    assert!(parse_bytes(SMALL.as_bytes()).is_ok());
}

#[test]
fn hostile_sizes_are_refused() {
    let deep = |n: usize| {
        let mut text = String::from("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Xrotation ");
        (1..n).for_each(|i| text += &format!("JOINT j{i} {{ OFFSET 0 0 0 "));
        text + &"}".repeat(n) + " MOTION Frames: 0 Frame Time: 1"
    };
    assert!(parse(&deep(MAX_DEPTH)).is_ok());
    let too_many = |what, limit| BvhErrorKind::TooMany { what, limit };
    assert_eq!(
        error(&deep(MAX_DEPTH + 1)).1,
        too_many("nested joints", MAX_DEPTH)
    );
    let wide = |n: usize| {
        let joint = "JOINT j { OFFSET 0 0 0 } ".repeat(n - 1);
        format!(
            "HIERARCHY ROOT a {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {joint} }} MOTION Frames: 0 Frame Time: 1"
        )
    };
    assert!(parse(&wide(MAX_JOINTS)).is_ok());
    assert_eq!(error(&wide(MAX_JOINTS + 1)).1, too_many("joints", MAX_JOINTS));
    assert_eq!(
        error(&with("Chest", &"x".repeat(MAX_NAME_BYTES + 1))).1,
        BvhErrorKind::Name
    );
    assert_eq!(
        error(&with("Frames: 2", "Frames: 99999999999999")).1,
        too_many("frames", MAX_FRAMES)
    );
    // Memory grows with the rows, not with the declared count.
    let declared = MAX_FRAMES;
    let kind = BvhErrorKind::FrameCount {
        declared,
        found: FoundFrames::Only(2),
    };
    assert_eq!(error(&with("Frames: 2", &format!("Frames: {declared}"))).1, kind);
    let found = error(&with("4 5 6", &"9".repeat(100_000)));
    assert!(matches!(found.1, BvhErrorKind::NotFinite(text) if text.len() == 40));
}

/// Whatever is read must be consistent, and errors must point into the text.
fn check(text: &str) -> Result<(), TestCaseError> {
    match parse(text) {
        Ok(file) => {
            let values: Vec<f64> = (0..file.frames()).flat_map(|f| file.row(f).to_vec()).collect();
            prop_assert_eq!(
                BvhFile::new(file.joints().to_vec(), file.frame_time_s(), values),
                Ok(file.clone())
            );
            let _ = file.to_clip(&Default::default());
        }
        Err(e) => prop_assert!(
            e.line >= 1 && e.line <= text.matches(['\n', '\r']).count() + 1,
            "{}",
            e
        ),
    }
    Ok(())
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in any::<String>()) {
        check(&text)?;
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        if let Err(e) = parse_bytes(&bytes) {
            prop_assert!(e.line >= 1);
        }
    }

    #[test]
    fn any_words_of_the_format_are_read_or_refused(
        words in proptest::collection::vec(
            prop::sample::select(vec![
                "HIERARCHY", "ROOT", "JOINT", "End", "Site", "OFFSET", "CHANNELS", "MOTION", "Frames:", "Frame", "Time:",
                "{", "}", ":", "0", "1", "3", "6", "-2.5e3", "nan", "Xposition", "Zrotation", "name", "\n",
            ]),
            0..60,
        ),
    ) {
        check(&words.join(" "))?;
        check(&format!("HIERARCHY ROOT a {{ {}", words.join(" ")))?;
    }

    #[test]
    fn a_damaged_file_is_read_or_refused(
        at in 0..SMALL.len(), cut in 0usize..30, put in "[ -~\\n]{0,12}",
    ) {
        let end = (at + cut).min(SMALL.len());
        check(&format!("{}{put}{}", &SMALL[..at], &SMALL[end..]))?;
    }
}

#[test]
fn a_tolerant_reader_knows_the_rate_and_counts_the_frames_itself() {
    let strict = parse(SMALL).unwrap();
    assert_eq!(parse_tolerant(SMALL, None).unwrap(), (strict.clone(), None));
    for declared in [1, 3] {
        let text = with("Frames: 2", &format!("Frames: {declared}"));
        assert!(parse(&text).is_err());
        let (file, miscounted) = parse_tolerant(&text, None).unwrap();
        assert_eq!(file, strict);
        assert_eq!(miscounted.map(|m| (m.declared, m.found)), Some((declared, 2)));
    }
    for declared in [0, 4] {
        let text = with("Frames: 2", &format!("Frames: {declared}"));
        assert!(parse_tolerant(&text, None).is_err(), "{declared}");
    }
    let line = SMALL.lines().find(|line| line.starts_with("Frame Time")).unwrap();
    let still = with(line, "Frame Time: 0");
    assert_eq!(
        parse_tolerant(&still, None).unwrap_err().kind,
        BvhErrorKind::FrameTime(0.0)
    );
    assert_eq!(parse_tolerant(&still, Some(24.0)).unwrap().0.fps(), 24.0);
    assert!(parse_tolerant(&still, Some(0.0)).is_err());
    assert!(parse_tolerant(&still, Some(f32::NAN)).is_err());
}
