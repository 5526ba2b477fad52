//! Words to motion and back, through the command line and the client. The pack of the server has
//! random weights.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;
use troupe_client::{ClientError, Describe, DescriptionPart, InBetween, Key, Pack, Prompt, TokenSampling};
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::clip::Clip;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;

use crate::cli::{Folder, failed, printed, text, troupe_at};
use crate::server::Server;

async fn start() -> Server {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
    Server::start_with(move |config| {
        config.packs = folder;
        config.max_queue_ms = 0;
    })
    .await
}

/// A body that stands still while it slides along +Z.
fn slide(pack: &Pack, frames: usize, x: f32) -> Clip {
    let root = |frame: usize| Vec3::new(x, 0.9, 0.03 * frame as f32);
    let joints = pack.skeleton().joint_count();
    Clip::new(
        Arc::clone(pack.skeleton()),
        pack.fps(),
        (0..frames).map(root).collect(),
        vec![Quat::IDENTITY; frames * joints],
    )
    .unwrap()
}

fn refused_field(error: &ClientError) -> &str {
    match error {
        ClientError::Refused(refusal) => &refusal.violations[0].field,
        other => panic!("{other}"),
    }
}

#[tokio::test]
async fn words_become_motion_in_a_file() {
    let (server, folder) = (start().await, Folder::new("say"));
    let (_, pack) = server.client().await;
    let (out, picture) = (folder.file("walk.bvh"), folder.file("walk.png"));
    let say = |more: &[&str]| {
        let files = ["--out", out.to_str().unwrap()].map(str::to_owned);
        let more: Vec<String> = more.iter().map(|&more| more.to_owned()).collect();
        let begin = ["say", "an old robot walks"].map(str::to_owned);
        troupe_at(server.url(), [begin.to_vec(), files.to_vec(), more].concat())
    };
    let output = say(&[
        "--seconds",
        "2",
        "--seed",
        "3",
        "--picture",
        picture.to_str().unwrap(),
    ])
    .await;
    assert_eq!(printed(&output), "");
    let notes = text(&output.stderr);
    assert!(
        notes.contains("note: captions of the pack's training have not used: robot"),
        "{notes}"
    );
    assert!(
        notes.contains("60 frames by tiny-vermo 0.0.0 written to"),
        "{notes}"
    );
    let file = bvh::parse(&std::fs::read_to_string(&out).unwrap()).unwrap();
    let clip = file.to_clip_on(pack.skeleton(), &BvhOptions::default()).unwrap();
    assert_eq!(clip.frames(), 60);
    assert!(std::fs::read(&picture).unwrap().starts_with(b"\x89PNG"));

    // The motion ends at its place, which may be to the side and behind.
    for (place, ends) in [("0.6,1,90", [0.6, 1.0]), ("-0.4,-0.3,-170", [-0.4, -0.3])] {
        let output = say(&["--seconds", "3", "--to", place]).await;
        assert_eq!(printed(&output), "");
        let file = bvh::parse(&std::fs::read_to_string(&out).unwrap()).unwrap();
        let clip = file.to_clip_on(pack.skeleton(), &BvhOptions::default()).unwrap();
        let last = clip.root_positions[89];
        let missed_m = (last.x - ends[0]).hypot(last.z - ends[1]);
        assert!(missed_m < 0.05, "{place}: {last}");
    }
    let output = say(&["--seconds", "1", "--to", "0,40,0"]).await;
    failed(&output, 4, &["prompt.targets[0].root.position", "frame_count"]);
    let output = say(&["--to", "0,40"]).await;
    failed(&output, 2, &["--to", "a heading in degrees"]);

    // A continuation of the clip, with a summary as JSON.
    let output = say(&["--past", out.to_str().unwrap(), "--json", "--temperature", "0"]).await;
    let summary: Value = serde_json::from_str(&printed(&output)).unwrap();
    assert_eq!(
        (&summary["pack"], &summary["text"]),
        (&"tiny-vermo".into(), &"an old robot walks".into())
    );
    assert!(summary["frames"].as_u64().unwrap() >= 8);

    let output = say(&["--top-p", "1.5"]).await;
    failed(&output, 4, &["sampling.top_p", "more than 0, and at most 1"]);
    let output = say(&["--seconds", "60"]).await;
    failed(&output, 4, &["prompt.seconds", "at most 34.1"]);
    assert!(server.stop().await);
}

#[tokio::test]
async fn a_clip_becomes_words() {
    let (server, folder) = (start().await, Folder::new("describe"));
    let (client, pack) = server.client().await;
    let file = folder.write_clip("slide.bvh", &slide(&pack, 300, 0.0));
    let describe = |more: &[&str]| {
        let begin = ["describe".to_owned(), file.to_str().unwrap().to_owned()];
        let more = more.iter().map(|&more| more.to_owned());
        troupe_at(server.url(), begin.into_iter().chain(more).collect::<Vec<_>>())
    };
    let part = ["--from", "100", "--to", "139", "--seed", "5"];
    let words = printed(&describe(&part).await);
    let clip = slide(&pack, 300, 0.0).slice(100..140).unwrap();
    let motion = Describe::new(clip).seed(5);
    let whole = client
        .describe(&pack, &motion)
        .await
        .unwrap()
        .whole()
        .await
        .unwrap();
    assert_eq!(words.trim_end_matches('\n'), whole.text);
    let json = printed(&describe(&[&part[..], &["--json"]].concat()).await);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&json["text"], &json["frames"]),
        (&Value::from(whole.text), &Value::from(40))
    );
    failed(&describe(&[]).await, 4, &["frames: is 300", "4 to 259"]);
    failed(
        &describe(&["--from", "290", "--to", "300"]).await,
        2,
        &["0 to 299"],
    );
    assert!(server.stop().await);
}

#[tokio::test]
async fn a_pack_without_words_is_an_error() {
    let folder = Folder::new("mute");
    let out = folder.file("wave.bvh");
    let said = ["say", "wave", "--out", out.to_str().unwrap()];
    let mute = crate::server::shared().url();
    failed(
        &troupe_at(mute, said).await,
        1,
        &["no pack with the capability `text`"],
    );
    let named = [&said[..], &["--pack", "human"]].concat();
    failed(&troupe_at(mute, named).await, 4, &["it has no capability text"]);
}

#[tokio::test]
async fn the_client_takes_several_characters_and_audio() {
    let server = start().await;
    let (client, pack) = server.client().await;
    let past = |x| Key::all(&slide(&pack, 16, x));
    let two = Prompt::new("someone walks")
        .seconds(2.0)
        .after(&past(0.0))
        .beside("someone waves", &past(1.0))
        .seed(1);
    let mut parts = client.say(&pack, &two).await.unwrap();
    let mut frames = [0, 0];
    while let Some(part) = parts.next().await.unwrap() {
        frames[part.character] += part.clip.frames();
    }
    assert_eq!(frames, [60, 60]);
    let made = client.say(&pack, &two).await.unwrap().whole().await.unwrap();
    assert_eq!(
        (made.clip.frames(), made.others.len(), made.others[0].frames()),
        (60, 1, 60)
    );
    assert!((made.others[0].root_positions[0].x - 1.0).abs() < 0.3);

    let motion = Describe::new(made.clip.clone()).beside(made.others[0].clone());
    let mut description = client.describe(&pack, &motion).await.unwrap();
    let mut words = String::new();
    while let Some(DescriptionPart::Words(more)) = description.next().await.unwrap() {
        words.push_str(&more);
    }
    assert!(!words.is_empty());

    let music = Describe::new(made.clip.clone()).into_audio(v1::Sound::Music);
    let music = client
        .describe(&pack, &music)
        .await
        .unwrap()
        .whole()
        .await
        .unwrap();
    assert!(music.text.is_empty() && !music.codes.is_empty());
    let codes: Vec<u32> = music.codes.into_iter().take(40).collect();
    let dance = Prompt::default().frames(32).to(v1::Sound::Music, codes);
    let dance = client.say(&pack, &dance).await.unwrap().whole().await.unwrap();
    assert_eq!(dance.clip.frames(), 32);

    let ahead = made.clip.root_positions[59] + Vec3::Z;
    let keys = Key::all(&made.clip);
    let target = keys[56..60].iter().map(|key| key.clone().root(ahead, None));
    let target: Vec<Key> = target.collect();
    let gap = Prompt::default().after(&Key::all(&made.clip)).ending_in(&target);
    let error = client.say(&pack, &gap).await.unwrap_err();
    assert_eq!(refused_field(&error), "prompt.frame_count");
    let filled = client
        .say(&pack, &gap.frames(24))
        .await
        .unwrap()
        .whole()
        .await
        .unwrap();
    assert_eq!(filled.clip.frames(), 24);
    assert!((filled.clip.root_positions[23] - ahead).length() < 0.3);

    let odd = Prompt::new("wave").sampling(TokenSampling::new().repetition(0.5));
    let error = client.say(&pack, &odd).await.unwrap_err();
    assert_eq!(refused_field(&error), "sampling.repetition");
    let short = Describe::new(made.clip.resample(60.0).unwrap());
    let error = client.describe(&pack, &short).await.unwrap_err();
    assert!(matches!(error, ClientError::Request(_)), "{error}");
    drop(client);
    assert!(server.stop().await);
}

#[tokio::test]
async fn words_fill_a_gap_on_the_way_of_a_pack_that_fills_gaps() {
    let folder = Folder::new("way");
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models");
    for name in ["human", "vermo"] {
        let pack = models.join(name).canonicalize().unwrap();
        std::os::unix::fs::symlink(pack, folder.file(name)).unwrap();
    }
    let packs = folder.file("");
    let server = Server::start_with(move |config| config.packs = packs).await;
    let (client, human) = server.client().await;
    let vermo = client.pack("vermo").await.unwrap();
    let walk = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/walk.bvh");
    let file = bvh::parse(&std::fs::read_to_string(walk).unwrap()).unwrap();
    let clip = file.to_clip_on(human.skeleton(), &BvhOptions::default()).unwrap();

    let keys = Key::all(&clip);
    let gap = Prompt::new("a person walks")
        .after(&keys[20..36])
        .ending_in(&keys[84..100])
        .frames(48);
    let filled = client.say(&vermo, &gap).await.unwrap().whole().await.unwrap();
    assert_eq!(
        (filled.clip.frames(), filled.notes.len()),
        (48, 0),
        "{:?}",
        filled.notes
    );
    let plain = InBetween::from_clip(&clip, 35, 84).unwrap();
    let plain = client.in_between(&human, &plain).await.unwrap();
    let away_m = |frame: usize| {
        let [one, other] = [
            filled.clip.root_positions[frame],
            plain.clip.root_positions[frame + 4],
        ];
        (one - other).with_y(0.0).length()
    };
    let most_m = (0..48).map(away_m).fold(0.0, f32::max);
    assert!(most_m < 1e-3, "the root is {most_m} m off the way");
    // The poses are those of the words.
    let pose = |clip: &Clip, frame: usize| clip.rotations_at(frame).to_vec();
    let differs = pose(&filled.clip, 24)
        .iter()
        .zip(pose(&plain.clip, 28))
        .any(|(a, b)| a.angle_between(b) > 0.01);
    assert!(differs);

    // Beyond the gaps of the pack the words lead to the end themselves.
    let long = Prompt::new("a person walks")
        .after(&keys[0..16])
        .ending_in(&keys[100..116])
        .frames(84);
    let long = client.say(&vermo, &long).await.unwrap().whole().await.unwrap();
    let note = long.notes.join("; ");
    assert!(
        note.contains("the pack human fills gaps of 7 to 59 frames"),
        "{note}"
    );
    let last = (long.clip.root_positions[83] - clip.root_positions[100])
        .with_y(0.0)
        .length();
    assert!(last < 0.1, "{last} m");
    drop(client);
    assert!(server.stop().await);
}
