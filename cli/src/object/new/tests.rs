//! From arguments and a clip to the text of a definition.

use std::sync::Arc;

use clap::Parser;
use troupe_motion::clip::Clip;
use troupe_motion::rotation::{angle_between, from_wxyz, yaw};
use troupe_motion::{Joint, Quat, Skeleton, Vec3};
use troupe_proto::docs::{KeyframeDoc, Motion, ObjectDoc, Origin, SetDoc, SkillDoc};

use super::args::New;
use super::draft::{Draft, draft};
use super::wish::Limits;
use super::write::{self, Source};

#[derive(Debug, Parser)]
struct Line {
    #[command(flatten)]
    new: New,
}

fn parse(line: &str) -> Result<New, String> {
    let words = format!("x --from a.bvh --name thing {line}");
    let line = Line::try_parse_from(words.split_whitespace());
    line.map(|line| line.new).map_err(|e| e.to_string())
}

const LIMITS: Limits = Limits { least: 8, most: 60 };
const FRAMES: usize = 100;
const HEADING: f32 = 0.5;

/// Hips and an arm. It faces 0.5 rad, walks ahead 1 cm a frame up to frame 40 and stands then; its
/// hand, at first below the shoulder, goes up before it; its hips go down to 0.5 m from frame 60
/// on.
fn clip() -> Clip {
    let joint = |name: &str, parent, offset_m| Joint {
        name: name.to_owned(),
        parent,
        offset_m,
    };
    let joints = vec![
        joint("Hips", None, Vec3::ZERO),
        joint("Arm", Some(0), Vec3::new(-0.2, 0.4, 0.0)),
        joint("Hand", Some(1), Vec3::new(0.0, -0.5, 0.0)),
    ];
    let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
    let root = |frame: usize| {
        let ahead = yaw(HEADING) * Vec3::Z * (0.01 * frame.min(40) as f32);
        let height = 0.95 - 0.45 * (frame.saturating_sub(60) as f32 / 10.0).min(1.0);
        Vec3::new(2.0, height, -1.0) + ahead
    };
    let pose = |frame: usize| {
        let raised = Quat::from_rotation_x(-1.5 * frame as f32 / FRAMES as f32);
        [yaw(HEADING), raised, Quat::IDENTITY]
    };
    let roots = (0..FRAMES).map(root).collect();
    Clip::new(skeleton, 30.0, roots, (0..FRAMES).flat_map(pose).collect()).unwrap()
}

fn made(line: &str) -> Draft {
    draft(&parse(line).unwrap(), &clip(), LIMITS, None).unwrap()
}

fn wrong(line: &str) -> String {
    match parse(line) {
        Ok(new) => draft(&new, &clip(), LIMITS, None).unwrap_err().to_string(),
        Err(text) => text,
    }
}

fn source<'a>(frames: &'a [usize], skeleton: &'a Skeleton) -> Source<'a> {
    Source {
        clip: "a.bvh".to_owned(),
        frames,
        pack: "human",
        rebuilt: false,
        skeleton,
    }
}

/// The text, which is read back to be the same.
fn written(draft: &Draft, frames: &[usize]) -> String {
    let clip = clip();
    let text = write::whole(&draft.doc, &source(frames, &clip.skeleton));
    assert_eq!(toml::from_str::<ObjectDoc>(&text).unwrap(), draft.doc, "{text}");
    text
}

fn key(set: &SetDoc) -> &KeyframeDoc {
    &set.keyframes[0]
}

fn near(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-4)
}

#[test]
fn poses_are_seen_from_the_object() {
    let draft = made("--frames 0,20,45 --distance 1.1");
    let sets = &draft.doc.sets;
    // 1.1 m before it and faced at first, 20 cm nearer then.
    let first = key(&sets[0]);
    assert!(near(&first.place_m.unwrap(), &[0.0, 1.1]), "{first:?}");
    assert_eq!((first.heading_deg, first.height_m), (Some(180.0), Some(0.95)));
    assert!(first.pivot && first.from_ground);
    assert!(near(&key(&sets[1]).place_m.unwrap(), &[0.0, 0.9]));
    assert!(near(&key(&sets[2]).place_m.unwrap(), &[0.0, 0.7]));
    // The pose has no heading of its own, and the arm is that of the clip.
    let rotations = key(&sets[1]).rotations.as_ref().unwrap();
    assert!(near(&rotations[..4], &[1.0, 0.0, 0.0, 0.0]), "{rotations:?}");
    let arm = from_wxyz([rotations[4], rotations[5], rotations[6], rotations[7]]);
    assert!(angle_between(arm, Quat::from_rotation_x(-0.3)) < 1e-3);
    // One after the other, as long as in the clip.
    let frames: Vec<_> = sets.iter().map(|set| set.frames).collect();
    assert_eq!(frames, [None, Some(20), Some(25)]);
    let next: Vec<_> = sets.iter().map(|set| set.next.as_deref()).collect();
    assert_eq!(next, [Some("thing-2"), Some("thing-3"), None]);
    assert_eq!(draft.doc.variants[0].entry, "thing-1");
    assert!(draft.doc.approaches.is_empty() && draft.notes.is_empty());
    assert_eq!(draft.doc.trigger.reach_m, 1.5);
}

#[test]
fn an_object_may_be_behind_and_have_a_front() {
    let draft = made("--frames 45 --distance -0.4 --pivot false");
    let set = key(&draft.doc.sets[0]);
    assert!(near(&set.place_m.unwrap(), &[0.0, 0.4]), "{set:?}");
    assert_eq!((set.heading_deg, set.pivot), (Some(0.0), false));
    let approach = &draft.doc.approaches[0];
    assert_eq!(
        (approach.directions_deg, approach.distance_m),
        ([-60.0, 60.0], Some(0.8))
    );
    // Before the character it needs no room to turn round.
    let draft = made("--frames 45 --pivot false");
    assert_eq!(draft.doc.approaches[0].distance_m, Some(0.6));
}

#[test]
fn what_is_held_is_left_by_the_frames_behind_it() {
    let draft =
        made("--frames 0,20,45,20 --hold 45 --hold 20=12 --soft 20=9 --sets in,up,top,down --from-stand");
    let doc = &draft.doc;
    assert_eq!(doc.variants[0].exit.as_deref(), Some("down"));
    let [first, up, top, down] = &doc.sets[..] else {
        panic!("{doc:?}")
    };
    assert_eq!((top.hold_until_ended, top.next.as_deref()), (true, None));
    assert_eq!(
        (up.hold_frames, up.drop_frames, up.next.as_deref()),
        (12, 9, Some("top"))
    );
    assert_eq!(
        (down.frames, down.hold_frames),
        (Some(25), 0),
        "the first of a frame that comes twice"
    );
    assert!(first.from_stand && !up.from_stand);
    let text = written(&draft, &[0, 20, 45, 20]);
    assert!(
        text.contains("# Frame 45 of the clip.\n[[sets]]\nname = \"top\""),
        "{text}"
    );
}

#[test]
fn low_hips_do_without_the_networks() {
    let motions = |line: &str| {
        let draft = made(line);
        draft.doc.sets.iter().map(|set| set.motion).collect::<Vec<_>>()
    };
    let stance = Some(Motion::Stance);
    assert_eq!(
        motions("--frames 45,80,45"),
        [None, stance, stance],
        "down, and up again"
    );
    assert_eq!(
        motions("--frames 45,80 --points Hand"),
        [None, None],
        "hips are left free"
    );
}

#[test]
fn timing_that_no_segment_has_is_left_to_the_pack() {
    let draft = made("--frames 0,5,80");
    assert_eq!(draft.doc.sets[1].frames, None);
    assert_eq!(draft.doc.sets[2].frames, None);
    assert_eq!(draft.notes.len(), 2);
    assert!(
        draft.notes[0].contains("thing-2: the clip takes 5 frames there, a segment 8 to 60"),
        "{:?}",
        draft.notes
    );
}

#[test]
fn a_hand_takes_the_object_where_it_is() {
    let draft = made("--frames 45,55,59 --object-frame 55 --hand Hand --grip 0.1 --release 59");
    let doc = &draft.doc;
    let socket = &doc.sockets[0];
    assert_eq!((socket.name.as_str(), socket.joint.as_str()), ("hand", "Hand"));
    // Its middle, 6 cm over its origin, is 10 cm beyond the hand.
    let rotation = from_wxyz(socket.rotation.unwrap());
    let held = rotation * (Vec3::Y * 0.06) + Vec3::from(socket.position_m);
    assert!(near(&held.to_array(), &[0.0, -0.1, 0.0]), "{held}");
    // It is upright and faces the character that takes it.
    let turned = Quat::from_rotation_x(-1.5 * 0.55) * rotation;
    assert!(
        angle_between(turned, yaw(std::f32::consts::PI)) < 1e-3,
        "{turned}"
    );
    let taken = &doc.sets[1];
    assert_eq!(taken.events[0].attach.as_deref(), Some("hand"));
    assert_eq!(
        (taken.origin, doc.sets[2].origin),
        (Origin::Object, Origin::Character)
    );
    let put_down = &doc.sets[2];
    assert!(put_down.events[0].release && !key(put_down).pivot);
    assert!(near(&key(put_down).place_m.unwrap(), &[0.0, 0.0]) && key(put_down).heading_deg == Some(0.0));
    // The hand is to the right of the root and ahead of it, and the object with it.
    let [x, z] = key(taken).place_m.unwrap();
    assert!((x + 0.2).abs() < 1e-3 && z > 0.4, "{x} {z}");
    let text = written(&draft, &[45, 55, 59]);
    assert!(
        text.contains("events = [{ attach = \"hand\" }]") && text.contains("events = [{ release = true }]"),
        "{text}"
    );
}

#[test]
fn points_leave_the_rest_of_the_body_free() {
    let draft = made("--frames 45,55,59 --hand Hand --points Hand");
    let [reach, lift, _] = &draft.doc.sets[..] else {
        panic!()
    };
    let key_of = key(reach);
    assert!(key_of.rotations.is_none() && key_of.height_m.is_none() && key_of.place_m.is_some());
    assert!(!key_of.from_ground, "its height counts from the object");
    // The object's middle is 9 cm from the hand.
    let hand = Vec3::from(key_of.points[0].position_m) - Vec3::Y * 0.06;
    assert!((hand.length() - 0.09).abs() < 1e-3, "{hand}");
    let lifted = key(lift);
    assert_eq!(
        (lifted.place_m, lifted.heading_deg, lifted.from_ground),
        (None, None, true)
    );
    assert_eq!(lift.origin, Origin::Character);
    assert!(
        lifted.points[0].position_m[1] > 0.9 && lifted.points[0].position_m[2] > 0.3,
        "{lifted:?}"
    );
    // Points of what stands on the ground count from it, and walking is not left out.
    let draft = made("--frames 0,30 --points Hand,Arm");
    let walked = key(&draft.doc.sets[1]);
    assert!(walked.from_ground && walked.place_m.is_some() && walked.points.len() == 2);
    written(&draft, &[0, 30]);
    let draft = made("--frames 0 --points Hand --height 0.7");
    let high = key(&draft.doc.sets[0]);
    assert!(
        !high.from_ground && (high.points[0].position_m[1] - 0.15).abs() < 1e-3,
        "{high:?}"
    );
}

#[test]
fn what_is_wrong_is_named_with_what_would_do() {
    for (line, wanted) in [
        (
            "--frames 0,100",
            "--frames: 100 is not in the clip; allowed: 0 to 99",
        ),
        (
            "--frames 0,20 --hold 30",
            "--hold: frame 30 is none of --frames; allowed: 0, 20",
        ),
        (
            "--frames 0,20 --hold 0 --hold 20",
            "--hold: two frames are held until",
        ),
        ("--frames 0,20 --hold 20=9001", "allowed: 0 to 9000 frames"),
        (
            "--frames 0,20 --soft 20=21",
            "--soft: 20=21; allowed: a TAU of 0 to 20 frames there",
        ),
        ("--frames 0,20 --soft 0=65", "a TAU of 0 to 64"),
        ("--frames 0,20 --soft 20", "FRAME=VALUE"),
        ("--frames 0,20 --sets a", "--sets: 1 names for 2 frames"),
        ("--frames 0,20 --sets a,a", "\"a\" is given twice"),
        (
            "--frames 0,20 --points Foot",
            "--points: the pack has no joint \"Foot\"; allowed: Hips, Arm, Hand",
        ),
        (
            "--frames 0,20 --hand Foot",
            "--hand: the pack has no joint \"Foot\"",
        ),
        (
            "--frames 0,20 --hand Hand --release 0",
            "--release: the object is put down before it is taken",
        ),
        (
            "--frames 0,20 --object-frame 3",
            "--object-frame: frame 3 is none of --frames",
        ),
        ("--frames 0,20 --weight -1", "--weight: -1; allowed: 0 to 1000"),
        ("--frames 0 --shape box:1,2", "box:W,H,D"),
        ("--frames 0 --shape box:1,2,0", "0.002 to 2000"),
        ("--frames 0 --variant a/b", "1 to 64 letters"),
        ("--frames 0 --distance 21", "-20 to 20 metres"),
        ("--frames 0 --hand Hand --distance 1", "cannot be used with"),
        ("--frames 0 --release 0", "--hand"),
        (
            "--frames 0 --seat 0=0.2",
            "--seat: a seat of 0.2 m; allowed: 0.3 to 0.7 m",
        ),
        ("--frames 0 --seat 5=0.4", "--seat: frame 5 is none of --frames"),
        ("--frames 0 --seat 0=0.4", "no legs that can be bent"),
        ("--frames 0 --seat 0=0.4 --distance 1", "cannot be used with"),
        ("", "--frames"),
    ] {
        let said = wrong(line);
        assert!(said.contains(wanted), "{line}: {said}");
    }
}

#[test]
fn a_variant_is_added_to_a_definition() {
    let first = made("--frames 45,55 --hand Hand --variant slow --shape box:0.1,0.2,0.1");
    let text = written(&first, &[45, 55]);
    let add = |line: &str| {
        let words = format!("x --from a.bvh --into b.toml {line}");
        let new = Line::try_parse_from(words.split_whitespace()).unwrap().new;
        draft(&new, &clip(), LIMITS, Some(&first.doc)).map_err(|wrong| wrong.to_string())
    };
    let more = add("--frames 50,59 --hand Hand --variant quick --weight 3").unwrap();
    let skeleton = clip().skeleton;
    let text = format!(
        "{text}{}",
        write::addition(&more.doc, &source(&[50, 59], &skeleton))
    );
    let both: ObjectDoc = toml::from_str(&text).unwrap();
    let names: Vec<_> = both
        .variants
        .iter()
        .map(|variant| variant.name.as_str())
        .collect();
    assert_eq!(names, ["slow", "quick"]);
    assert_eq!((both.sets.len(), both.variants[1].weight), (4, 3.0));
    let sockets: Vec<_> = both.sockets.iter().map(|socket| socket.name.as_str()).collect();
    assert_eq!(
        sockets,
        ["hand", "hand-quick"],
        "the hand is at another angle there"
    );
    assert_eq!(both.sets[2].events[0].attach.as_deref(), Some("hand-quick"));
    // The same socket once more needs no second one.
    let again = add("--frames 45,55 --hand Hand --variant again").unwrap();
    assert!(again.doc.sockets.is_empty());
    assert_eq!(again.doc.sets[0].events[0].attach.as_deref(), Some("hand"));

    let error = add("--frames 50 --variant slow").unwrap_err();
    assert!(
        error.contains("--variant: \"slow\" is a variant that the definition has"),
        "{error}"
    );
    let error = add("--frames 50 --variant x --sets slow-1").unwrap_err();
    assert!(error.contains("--sets: \"slow-1\" is a set"), "{error}");
}

#[test]
fn the_text_is_as_documented() {
    let draft = made(
        "--frames 0,20,80,45 --hold 80 --soft 20=6 --shared --not-solid --pivot false --description=Quoted",
    );
    insta::assert_snapshot!(written(&draft, &[0, 20, 80, 45]));
}

/// The words of a shell's line, with double quotes.
fn words(line: &str) -> Vec<String> {
    let parts = line.split('"').enumerate();
    let words = parts.flat_map(|(nth, part)| match nth % 2 {
        0 => part.split_whitespace().map(str::to_owned).collect(),
        _ => vec![part.to_owned()],
    });
    words.collect()
}

#[test]
fn documented_commands_are_understood() {
    let repository = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (file, begins, count) in [
        ("docs/objects.md", "troupe object new --", 4),
        ("examples/objects/README.md", "new --from", 13),
    ] {
        let text = std::fs::read_to_string(repository.join(file)).unwrap();
        let text = text.replace("\\\n", " ");
        let lines = text
            .lines()
            .map(str::trim)
            .filter(|line| line.starts_with(begins));
        let commands: Vec<_> = lines.filter_map(|line| line.split_once("new ")).collect();
        assert_eq!(commands.len(), count, "{file}: {commands:?}");
        for (_, arguments) in commands {
            let line = Line::try_parse_from(words(&format!("new {arguments}")));
            assert!(line.is_ok(), "{file}: {arguments}: {}", line.unwrap_err());
        }
    }
}

#[test]
fn each_keyframe_of_a_skill_is_given_from_the_one_before() {
    let new = parse("--skill --start 10 --frames 30,70,90 --hold 70 --soft 30=2").unwrap();
    let made = draft(&new, &clip(), LIMITS, None).unwrap();
    let frames = [30, 70, 90];
    let clip = clip();
    let text = write::skill(&made.doc, &source(&frames, &clip.skeleton));
    let skill: SkillDoc = toml::from_str(&text).unwrap();
    assert_eq!(skill.variants[0].exit.as_deref(), Some("thing-3"));
    let sets = &skill.sets;
    assert_eq!(
        sets.iter().map(|set| set.frames).collect::<Vec<_>>(),
        [Some(20), Some(40), Some(20)]
    );
    assert!(
        sets.iter()
            .all(|set| set.motion.is_none() && set.origin == Origin::Object),
        "the form has no need of it"
    );
    assert_eq!(sets[0].drop_frames, 2);
    // It walks a centimetre a frame to frame 40.
    for (set, ahead) in sets.iter().zip([0.2, 0.1, 0.0]) {
        let place = key(set).place_m.unwrap();
        assert!(near(&place, &[0.0, ahead]), "{place:?}");
        assert_eq!(key(set).heading_deg, Some(0.0));
    }
    assert!(near(&[key(&sets[1]).height_m.unwrap()], &[0.5]));
    let doc: ObjectDoc = skill.into();
    assert!(
        doc.sets
            .iter()
            .all(|set| set.origin == Origin::Character && set.motion == Some(Motion::Plan))
    );
    let stands = made_skill("--stand --frames 30,70");
    assert!(key(&stands.sets[0]).rotations.is_some());
    let last = key(&stands.sets[1]);
    assert_eq!((last.rotations.as_ref(), last.height_m), (None, None));
    assert!(near(&last.place_m.unwrap(), &[0.0, 0.1]));
    assert!(wrong("--skill --start 200 --frames 30").contains("--start: 200 is not in the clip"));
    assert!(wrong("--skill --frames 30 --distance 1").contains("--distance"));
    assert!(wrong("--start 3 --frames 30").contains("--skill"));
}

fn made_skill(line: &str) -> ObjectDoc {
    made(&format!("--skill {line}")).doc
}

#[test]
fn a_skill_without_a_start_begins_on_the_spot() {
    let made = made("--skill --frames 20,40");
    assert!(near(&key(&made.doc.sets[0]).place_m.unwrap(), &[0.0, 0.0]));
    assert_eq!(made.doc.sets[0].frames, None);
}
