//! The pack of the Unitree G1 that ships, served beside the one for people.

use std::path::Path;

use troupe_client::{Client, Encoding, FrameOptions, SessionOptions};
use troupe_engine::EngineChoice;
use troupe_motion::Vec3;

use crate::server::Server;

/// Angles are 32-bit floats, and limits are kept in them.
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
