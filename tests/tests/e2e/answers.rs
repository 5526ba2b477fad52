//! Answers to valid requests.

use std::f32::consts::PI;

use troupe_client::{InBetween, Key, SegmentLength};
use troupe_engine::EngineChoice;
use troupe_motion::fk::WorldMotion;
use troupe_motion::{Clip, Vec3};

use crate::motion::{character, difference, frames_difference, message, request, turn_and_move, walk};
use crate::server::{Server, shared};

#[tokio::test]
async fn grpc_and_http_give_equal_frames() {
    let server = shared();
    let pack = server.pack().await;
    let mut character = character(&pack);
    character.return_positions = true;
    character.return_intermediates = true;
    let request = request([character]);

    let by_grpc = server
        .rpc()
        .await
        .in_between(request.clone())
        .await
        .unwrap()
        .into_inner();
    let by_http = server.post(&request).await.unwrap();
    assert_eq!(
        (&by_grpc.pack, &by_grpc.pack_version),
        (&by_http.pack, &by_http.pack_version)
    );
    let frames = [&by_grpc, &by_http].map(|answer| answer.characters[0].frames.as_ref().unwrap());
    assert!(frames_difference(frames[0], frames[1]) < 1e-4);
    let tokens = [&by_grpc, &by_http].map(|a| &a.characters[0].intermediates.as_ref().unwrap().tokens);
    assert_eq!(tokens[0], tokens[1]);
}

#[tokio::test]
async fn the_same_seed_gives_the_same_frames() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66)
        .unwrap()
        .temperature(1.0)
        .seed(11);
    let first = client.in_between(&pack, &gap).await.unwrap().clip;
    for _ in 0..3 {
        let again = client.in_between(&pack, &gap).await.unwrap().clip;
        assert!(difference(&first, &again) < 1e-4);
    }
}

#[tokio::test]
async fn other_seeds_give_other_frames_when_sampling() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66)
        .unwrap()
        .temperature(1.0);
    let first = client.in_between(&pack, &gap.clone().seed(0)).await.unwrap().clip;
    let mut changes = Vec::new();
    for seed in 1..5 {
        let other = client
            .in_between(&pack, &gap.clone().seed(seed))
            .await
            .unwrap()
            .clip;
        changes.push(difference(&first, &other));
    }
    assert!(
        changes.iter().filter(|change| **change > 1e-3).count() >= 3,
        "{changes:?}"
    );
}

#[tokio::test]
async fn without_temperature_the_seed_changes_nothing() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66).unwrap();
    let [first, other] = [1, 2].map(|seed| gap.clone().seed(seed));
    let first = client.in_between(&pack, &first).await.unwrap().clip;
    let other = client.in_between(&pack, &other).await.unwrap().clip;
    assert!(difference(&first, &other) < 1e-4);
}

#[tokio::test]
async fn the_given_length_is_kept_and_the_target_root_met() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    for frames in [12, 13, 14, 15, 30, 49, 63, 64] {
        let (from, to) = (50, 50 + frames - 4);
        let gap = InBetween::from_clip(&clip, from, to).unwrap();
        let answer = client.in_between(&pack, &gap).await.unwrap();
        assert_eq!(answer.clip.frames(), frames);
        assert_eq!(
            answer.contacts.len(),
            frames * pack.description().contact_joints.len()
        );
        assert!(answer.contacts.iter().all(|p| (0.0..=1.0).contains(p)));
        let miss = answer.clip.root_positions[frames - 1].distance(clip.root_positions[to]);
        assert!(miss < 2e-3, "{frames} frames: {miss} m from the target");
    }
}

#[tokio::test]
async fn the_model_keeps_to_the_allowed_lengths() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66)
        .unwrap()
        .return_intermediates(true);
    let free = client
        .in_between(&pack, &gap.clone().length(SegmentLength::Predicted))
        .await
        .unwrap();
    let per_token = pack.description().frames_per_token as usize;
    assert!(
        free.clip.frames().is_multiple_of(per_token) && pack.segment_frames().contains(&free.clip.frames())
    );

    for allowed in [vec![3], vec![16], vec![5, 9]] {
        let length = SegmentLength::PredictedFrom(allowed.clone());
        let answer = client
            .in_between(&pack, &gap.clone().length(length))
            .await
            .unwrap();
        let tokens = u32::try_from(answer.clip.frames() / per_token).unwrap();
        assert!(allowed.contains(&tokens), "{tokens} of {allowed:?}");
        let probabilities = answer.intermediates.unwrap().token_count_probabilities;
        let sum: f32 = probabilities.iter().sum();
        assert!((sum - 1.0).abs() < 1e-3, "{probabilities:?}");
        for (count, probability) in (3_u32..).zip(&probabilities) {
            assert!(
                allowed.contains(&count) || *probability < 1e-6,
                "{count}: {probability}"
            );
        }
    }
}

#[tokio::test]
async fn intermediates_and_positions_fit_the_frames() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66).unwrap();
    let plain = client.in_between(&pack, &gap).await.unwrap();
    assert!(plain.intermediates.is_none() && plain.positions.is_empty());

    let gap = gap.return_intermediates(true).return_positions(true);
    let answer = client.in_between(&pack, &gap).await.unwrap();
    let motion = WorldMotion::from_clip(&answer.clip);
    let farthest = motion
        .positions
        .iter()
        .zip(&answer.positions)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max);
    assert!(
        answer.positions.len() == motion.positions.len() && farthest < 1e-3,
        "{farthest}"
    );

    // 30 frames are eight tokens of four frames.
    let parts = answer.intermediates.unwrap();
    let heads = pack.description().heads as usize;
    assert_eq!(parts.predicted_frame_count, 32);
    assert_eq!(
        (parts.tokens.len(), parts.root_r_g3.len(), parts.root_r_g4.len()),
        (8 * heads, 32 * 5, 32 * 5)
    );
    assert!(parts.tokens.iter().all(|&code| code < pack.description().codes));
}

#[tokio::test]
async fn a_turned_and_moved_request_gives_the_turned_and_moved_answer() {
    // On the CPU, in f32: moving the clip rounds its numbers, and in bf16 that may change the
    // choice between two codes that are almost equally likely.
    let server = Server::start_with(|config| config.engine = EngineChoice::Cpu).await;
    let (client, pack) = server.client().await;
    let clip = walk(&pack);
    let fill = async |clip: Clip| {
        let gap = InBetween::from_clip(&clip, 40, 66)
            .unwrap()
            .temperature(0.7)
            .seed(5);
        client.in_between(&pack, &gap).await.unwrap().clip
    };
    let plain = fill(clip.clone()).await;
    for (heading, x, z) in [
        (0.0, 80.0, -35.0),
        (PI / 2.0, 0.0, 0.0),
        (PI, 3.0, 1.0),
        (-2.3, -120.0, 64.0),
        (0.01, 0.0, 9.0),
    ] {
        let by = Vec3::new(x, 0.0, z);
        let moved = fill(turn_and_move(&clip, heading, by)).await;
        let error = difference(&moved, &turn_and_move(&plain, heading, by));
        assert!(error < 1e-3, "heading {heading}, moved {by}: {error}");
    }
    server.stop().await;
}

#[tokio::test]
async fn characters_of_one_request_come_back_in_order() {
    let server = shared();
    let (client, pack) = server.client().await;
    let clip = walk(&pack);
    let gaps = (0..10)
        .map(|i| {
            InBetween::from_clip(&clip, 10 + 7 * i, 30 + 10 * i)
                .unwrap()
                .id(format!("walker {i}"))
        })
        .collect::<Vec<_>>();
    let answers = client.in_between_many(&pack, &gaps).await.unwrap();
    assert_eq!(
        (answers.pack.as_str(), answers.pack_version.as_str()),
        (pack.name(), &*pack.description().version)
    );
    // Two workers may run parts of a request at once, so their time may exceed the total.
    assert!(answers.timing.total_us > 0 && answers.timing.inference_us > 0);
    for (i, (answer, gap)) in answers.characters.iter().zip(&gaps).enumerate() {
        assert_eq!(answer.id, format!("walker {i}"));
        let alone = client.in_between(&pack, gap).await.unwrap();
        assert!(difference(&answer.clip, &alone.clip) < 1e-4, "{i}");
    }
}

#[tokio::test]
async fn any_part_of_a_keyframe_is_enough() {
    let server = shared();
    let pack = server.pack().await;
    let clip = walk(&pack);
    let context = [40, 41, 42, 43].map(|f| Key::from_clip(&clip, f).unwrap());
    let root = clip.root_at(70);
    for (what, target) in [
        ("root", Key::default().root(root.position, Some(root.heading))),
        (
            "pose",
            Key::default()
                .pose(clip.rotations_at(70))
                .root_height(root.position.y),
        ),
        (
            "velocity",
            Key::default()
                .velocity(0.0, 1.2, 0.0)
                .root_height(root.position.y),
        ),
        (
            "root and velocity",
            Key::default()
                .root(root.position, Some(1.0))
                .velocity(0.3, 1.0, 0.0),
        ),
        ("all", Key::from_clip(&clip, 70).unwrap().velocity(0.3, 1.0, 0.0)),
    ] {
        let gap = InBetween::new(context.clone(), [target]).length(SegmentLength::Frames(31));
        let answer = server
            .rpc()
            .await
            .in_between(request([message(&pack, &gap)]))
            .await;
        let answer = answer
            .unwrap_or_else(|status| panic!("{what}: {status}"))
            .into_inner();
        assert_eq!(
            answer.characters[0].frames.as_ref().unwrap().frame_count,
            31,
            "{what}"
        );
    }
}

#[tokio::test]
async fn four_target_keyframes_are_met() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let gap = InBetween::from_clip_range(&clip, 40, 66..=69).unwrap();
    let answer = client.in_between(&pack, &gap).await.unwrap().clip;
    assert_eq!(answer.frames(), 33);
    for (frame, target) in [(29, 66), (32, 69)] {
        let miss = answer.root_positions[frame].distance(clip.root_positions[target]);
        assert!(miss < 2e-3, "target {target}: {miss} m off");
    }
}

#[tokio::test]
async fn feet_that_stand_are_held_still_unless_they_are_left_free() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 86).unwrap();
    let mut slides = Vec::new();
    let mut roots = Vec::new();
    for hold in [true, false] {
        let answer = client
            .in_between(&pack, &gap.clone().hold_feet(hold))
            .await
            .unwrap();
        let motion = WorldMotion::from_clip(&answer.clip);
        let joints = pack.skeleton().joint_count();
        let feet = &pack.skeleton().contacts.as_ref().unwrap().joints;
        let stands = |frame: usize, nth: usize| answer.contacts[frame * feet.len() + nth] >= 0.5;
        // Toes only, every second joint: a heel may turn over a toe that is held still.
        let toes: Vec<usize> = (0..feet.len()).filter(|nth| nth % 2 == 1).collect();
        let steps = (5..50).flat_map(|frame| toes.iter().map(move |&nth| (frame, nth)));
        let slid: f32 = steps
            .filter(|&(frame, nth)| stands(frame, nth) && stands(frame - 1, nth))
            .map(|(frame, nth)| {
                let at = |frame: usize| motion.positions[frame * joints + feet[nth]];
                let step = at(frame) - at(frame - 1);
                step.x.hypot(step.z)
            })
            .sum();
        slides.push(slid);
        roots.push(answer.clip.root_positions);
    }
    assert!(slides[1] > 0.01 && slides[0] < 0.3 * slides[1], "{slides:?} m");
    assert_eq!(roots[0], roots[1], "the roots are the same");
}
