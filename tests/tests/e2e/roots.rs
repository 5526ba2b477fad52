//! In-betweening with given roots instead of predicted ones.

use troupe_client::{InBetween, InBetweenAnswer, Key, Pack, RootKey};
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::foot_skate_m_per_frame;
use troupe_motion::root::wrap_angle;
use troupe_motion::{Clip, GlobalRoot, Vec2};

use crate::motion::{difference, walk};
use crate::server::shared;

/// Allowed distance between a given root and the answer, metres, over the ground and in height.
const MET_M: f32 = 1e-3;
/// Frames of the segments: four of context, a gap of 45, one target.
const FRAMES: usize = 50;
/// The last context frame, as a frame of the clip.
const FROM: usize = 40;
/// The first context frame, at which the segment starts.
const START: usize = FROM - 3;

fn gap(clip: &Clip) -> InBetween {
    InBetween::from_clip(clip, FROM, START + FRAMES - 1).unwrap()
}

/// The root in a frame of an answer. Frame 0 is the first context frame.
fn root(answer: &InBetweenAnswer, frame: usize) -> GlobalRoot {
    answer.clip.root_at(frame)
}

/// A place on the ground, `metres` to the left of a root: x and z.
fn left_of(root: GlobalRoot, metres: f32) -> Vec2 {
    let (sin, cos) = root.heading.sin_cos();
    Vec2::new(root.position.x + metres * cos, root.position.z - metres * sin)
}

fn off(answer: &InBetweenAnswer, frame: usize, place: Vec2) -> f32 {
    let at = root(answer, frame).position;
    Vec2::new(at.x, at.z).distance(place)
}

fn skate(pack: &Pack, answer: &InBetweenAnswer) -> f64 {
    let motion = WorldMotion::from_clip(&answer.clip);
    foot_skate_m_per_frame(pack.skeleton(), &motion, 4..FRAMES - 1).unwrap()
}

#[tokio::test]
async fn keyed_roots_are_met_and_the_rest_of_the_request_too() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let free = client.in_between(&pack, &gap(&clip)).await.unwrap();
    let [early, late] = [16, 34].map(|frame| root(&free, frame));
    let places = [left_of(early, 0.2), left_of(late, -0.15)];
    let (height, heading) = (late.position.y - 0.05, late.heading + 0.3);
    let keys = [
        RootKey::new(16).ground(places[0]),
        RootKey::new(34).ground(places[1]).height(height).heading(heading),
    ];
    for hold_feet in [true, false] {
        let bent = gap(&clip).root(keys).hold_feet(hold_feet);
        let bent = client.in_between(&pack, &bent).await.unwrap();
        assert!(off(&bent, 16, places[0]) < MET_M && off(&bent, 34, places[1]) < MET_M);
        let keyed = root(&bent, 34);
        assert!((keyed.position.y - height).abs() < MET_M);
        assert!(wrap_angle(keyed.heading - heading).abs() < 0.01);
        for frame in [0, 3, FRAMES - 1] {
            let given = clip.root_positions[START + frame];
            assert!(
                bent.clip.root_positions[frame].distance(given) < MET_M,
                "frame {frame}"
            );
        }
    }
}

#[tokio::test]
async fn a_root_for_every_frame_is_met_in_every_frame() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let free = client.in_between(&pack, &gap(&clip)).await.unwrap();
    // A wave to both sides. It is zero at both ends, so the keyframes stay unchanged.
    let aside = |frame: usize| {
        let t = frame.saturating_sub(3) as f32 / (FRAMES - 4) as f32;
        0.12 * (std::f32::consts::TAU * t).sin() * (std::f32::consts::PI * t).sin()
    };
    let places: Vec<Vec2> = (0..FRAMES)
        .map(|frame| left_of(clip.root_at(START + frame), aside(frame)))
        .collect();
    let keys = places
        .iter()
        .zip(0..)
        .map(|(&place, frame)| RootKey::new(frame).ground(place));
    let waved = client.in_between(&pack, &gap(&clip).root(keys)).await.unwrap();
    for (frame, &place) in places.iter().enumerate() {
        assert!(off(&waved, frame, place) < MET_M, "frame {frame}");
    }
    assert!(difference(&waved.clip, &free.clip) > 0.05);
}

#[tokio::test]
async fn tokens_are_those_of_the_predicted_root() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let free = gap(&clip).return_intermediates(true);
    let plain = client.in_between(&pack, &free).await.unwrap();
    let place = left_of(root(&plain, 25), 0.3);
    let bent = free.root([RootKey::new(25).ground(place)]);
    let bent = client.in_between(&pack, &bent).await.unwrap();
    let [plain, bent] = [plain, bent].map(|answer| answer.intermediates.unwrap());
    assert_eq!(plain.tokens, bent.tokens);
    assert_eq!(plain.root_r_g3, bent.root_r_g3);
    // The decoder gets the given root, and its own root goes more than half of the way to it.
    let [without, with] = [&plain, &bent]
        .map(|parts| Vec2::new(parts.root_r_g4[25 * 5], parts.root_r_g4[25 * 5 + 2]).distance(place));
    assert!(
        without > 0.25 && with < 0.5 * without,
        "{without} m without, {with} m with"
    );
}

#[tokio::test]
async fn a_given_root_is_the_same_alone_and_in_a_batch() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let place = left_of(clip.root_at(START + 25), 0.2);
    let bent = gap(&clip).root([RootKey::new(25).ground(place)]);
    let alone = client.in_between(&pack, &bent).await.unwrap();
    let others = (0..9).map(|i| InBetween::from_clip(&clip, 10 + 7 * i, 30 + 10 * i).unwrap());
    let mut all: Vec<InBetween> = others.collect();
    all.insert(4, bent);
    let batch = client.in_between_many(&pack, &all).await.unwrap();
    assert_eq!(difference(&batch.characters[4].clip, &alone.clip), 0.0);
    // The given root does not change the other characters.
    all.remove(4);
    let without = client.in_between_many(&pack, &all).await.unwrap();
    for (nth, answer) in without.characters.iter().enumerate() {
        let with = &batch.characters[if nth < 4 { nth } else { nth + 1 }];
        assert_eq!(difference(&with.clip, &answer.clip), 0.0, "{nth}");
    }
}

#[tokio::test]
async fn a_modest_bend_does_not_make_feet_slide() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let mut skates = [0.0, 0.0];
    for from in [40, 60, 80, 100, 120, 140, 160, 180] {
        let free = InBetween::from_clip(&clip, from, from + FRAMES - 4).unwrap();
        let plain = client.in_between(&pack, &free).await.unwrap();
        for metres in [0.2, -0.2] {
            let place = left_of(root(&plain, 27), metres);
            let bent = free.clone().root([RootKey::new(27).ground(place)]);
            let bent = client.in_between(&pack, &bent).await.unwrap();
            assert!(off(&bent, 27, place) < MET_M);
            skates[0] += skate(&pack, &plain) / 16.0;
            skates[1] += skate(&pack, &bent) / 16.0;
        }
    }
    let [plain, bent] = skates.map(|skate| 1e3 * skate);
    println!("foot skate in mm a frame: {plain:.2} without, {bent:.2} with a bend of 20 cm");
    assert!(
        bent < 1.5 * plain + 0.5,
        "{bent} mm a frame, {plain} without a bend"
    );
}

#[tokio::test]
async fn a_target_without_a_root_is_led_to_a_given_one() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let context = [37, 38, 39, 40].map(|frame| Key::from_clip(&clip, frame).unwrap());
    let pose = Key::default()
        .pose(clip.rotations_at(80))
        .root_height(clip.root_positions[80].y);
    let place = left_of(clip.root_at(80), 0.3);
    let gap = InBetween::new(context, [pose])
        .length(troupe_client::SegmentLength::Frames(44))
        .root([RootKey::new(43).ground(place)]);
    let answer = client.in_between(&pack, &gap).await.unwrap();
    assert!(off(&answer, 43, place) < MET_M);
    assert!((root(&answer, 43).position.y - clip.root_positions[80].y).abs() < MET_M);
}

#[tokio::test]
async fn impossible_motion_is_reported_and_refused_if_strict() {
    let (client, pack) = shared().client().await;
    let clip = walk(&pack);
    let plain = client.in_between(&pack, &gap(&clip)).await.unwrap();
    let far = left_of(root(&plain, 20), 6.0);
    let fast = gap(&clip).root([RootKey::new(20).ground(far)]);
    let answer = client.in_between(&pack, &fast).await.unwrap();
    let found = answer.feasibility.unwrap();
    assert!(!found.feasible, "{found:?}");
    let error = client
        .in_between(&pack, &fast.strict(true))
        .await
        .expect_err("6 m aside in half a second");
    let [violation] = error.violations() else {
        panic!("{error:?}")
    };
    assert_eq!(violation.field, "characters[0].root[0]");
    assert!(
        violation.allowed.as_deref().unwrap().contains("m/s"),
        "{violation:?}"
    );
}
