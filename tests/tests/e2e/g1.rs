//! The shipped pack of the Unitree G1, on a server beside the pack of people.

use std::path::Path;

use troupe_client::{Act, Client, ClientError, Encoding, FrameOptions, Session, SessionOptions};
use troupe_engine::EngineChoice;
use troupe_motion::Vec3;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use crate::server::Server;

/// Rounding of angles and limits in 32-bit floats, radians.
const ROUNDING_RAD: f32 = 1e-5;

#[tokio::test(flavor = "multi_thread")]
async fn the_g1_walks_on_its_hinges_beside_people() {
    let server = Server::start_with(|config| {
        config.packs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models");
        config.engine = EngineChoice::Cpu;
    })
    .await;
    let client = Client::connect(server.url()).await.unwrap();
    assert_eq!(client.pack("").await.unwrap().name(), "human");
    let g1 = client.pack("g1").await.unwrap();
    let robot = g1.robot().unwrap().clone();
    assert_eq!((robot.hinges().len(), robot.qpos_len()), (29, 36));

    let options = SessionOptions::new().seed(3).style("normal");
    let mut session = client.session(&g1, &options).await.unwrap();
    session.set_frame_options(FrameOptions {
        encoding: Encoding::Qpos,
        ..FrameOptions::default()
    });
    session.walk(Vec3::new(0.0, 0.0, 1.2));
    let (mut way, mut lowest, mut highest) = (0.0, f32::MAX, f32::MIN);
    for _ in 0..4 {
        let frames = session.step(30).await.unwrap();
        for frame in frames.iter() {
            let (root, angles) = frame.qpos.split_at(7);
            // Forward is x in MuJoCo's axes, up is z.
            way = root[0];
            (lowest, highest) = (lowest.min(root[2]), highest.max(root[2]));
            for (hinge, &angle) in robot.hinges().iter().zip(angles) {
                let allowed = hinge.lower_rad - ROUNDING_RAD..=hinge.upper_rad + ROUNDING_RAD;
                assert!(allowed.contains(&angle), "{angle} is not in {allowed:?}");
            }
        }
    }
    assert!((3.0..5.5).contains(&way), "{way} m in four seconds at 1.2 m/s");
    assert!(
        lowest > 0.65 && highest < 0.85,
        "the pelvis is {lowest} to {highest} m high"
    );
    session.close().await.unwrap();
    server.stop().await;
}

async fn g1() -> (Server, Client) {
    let server = Server::start_with(|config| {
        config.packs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1");
        config.engine = EngineChoice::Cpu;
    })
    .await;
    let client = Client::connect(server.url()).await.unwrap();
    (server, client)
}

/// Heights of the pelvis in the next frames, metres, and whether the skill ended in them.
async fn heights(session: &mut Session, frames: u32) -> (Vec<f32>, bool) {
    let came = session.step(frames).await.unwrap();
    let heights = came.iter().map(|frame| frame.root.y).collect();
    let done = (session.events().iter()).any(|event| matches!(event.kind, Some(Kind::Done(_))));
    (heights, done)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_g1_lies_down_and_gets_up_before_it_walks() {
    let (server, client) = g1().await;
    let pack = client.pack("g1").await.unwrap();
    let lie = pack
        .description()
        .skills
        .iter()
        .find(|skill| skill.name == "lie-down")
        .unwrap();
    assert_eq!(
        (lie.variants.join(" "), lie.held),
        ("back front".to_owned(), true)
    );
    for variant in ["back", "front"] {
        let mut session = client
            .session(&pack, &SessionOptions::new().seed(1))
            .await
            .unwrap();
        session.act(&Act::skill("lie-down").variant(variant));
        heights(&mut session, 120).await;
        heights(&mut session, 120).await;
        let lies = session.info().await.unwrap();
        assert_eq!(lies.activity.unwrap().kind(), v1::ActivityKind::Held, "{variant}");
        assert!(lies.position.unwrap().y < 0.25, "{variant}: {:?}", lies.position);
        session.walk(Vec3::Z);
        let (mut up, mut done) = (Vec::new(), false);
        while !done && up.len() < 400 {
            let (more, is_done) = heights(&mut session, 20).await;
            up.extend(more);
            done = is_done;
        }
        assert!(done, "{variant}: it gets up");
        let rise = up.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
        assert!(rise < 0.06, "{variant}: it rises by up to {rise} m a frame");
        heights(&mut session, 60).await;
        let walks = session.info().await.unwrap();
        assert!(
            walks.speed > 0.6 && walks.position.unwrap().y > 0.65,
            "{variant}: {walks:?}"
        );
        session.close().await.unwrap();
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_g1_jumps_sits_and_crawls() {
    let (server, client) = g1().await;
    let pack = client.pack("g1").await.unwrap();
    let mut session = client
        .session(&pack, &SessionOptions::new().seed(2))
        .await
        .unwrap();
    session.act(&Act::skill("jump").variant("ahead"));
    let (mut jump, _) = heights(&mut session, 70).await;
    let (landing, done) = heights(&mut session, 70).await;
    jump.extend(landing);
    let low = jump.iter().copied().fold(1.0, f32::min);
    let top = jump
        .iter()
        .copied()
        .skip_while(|&height| height > low)
        .fold(0.0, f32::max);
    assert!(done && low < 0.5 && top > 0.8, "from {low} m up to {top} m");
    let ahead = session.info().await.unwrap().position.unwrap().z;
    assert!((1.0..2.2).contains(&ahead), "it comes {ahead} m ahead");
    session.act(&Act::skill("sit-on-ground"));
    let (down, _) = heights(&mut session, 90).await;
    assert!(down[89] < 0.2, "it sits at {} m", down[89]);
    session.act(&Act::EndInteraction);
    let (_, done) = heights(&mut session, 120).await;
    assert!(done, "it rises");
    session.walk(Vec3::Z * 0.4).style("crawl");
    heights(&mut session, 60).await;
    let (crawl, _) = heights(&mut session, 60).await;
    assert!(
        crawl.iter().all(|height| (0.3..0.6).contains(height)),
        "{crawl:?}"
    );
    let refused = session.act(&Act::skill("fly")).step(1).await.unwrap_err();
    assert!(matches!(&refused, ClientError::Session(_)), "{refused}");
    assert!(refused.to_string().contains("fly"), "{refused}");
    session.close().await.unwrap();
    server.stop().await;
}
