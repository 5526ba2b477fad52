//! Live characters of a pack of NVIDIA's planner: a small graph with the same inputs and outputs.

use std::path::Path;

use tonic::{Code, Status};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_server::server::ServerHandle;

use super::served;
use crate::calls::{self, frames_of, locomote, open, step, stepped, walk};

async fn start() -> (ServerHandle, super::Client, calls::Client) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/sonic_planner");
    let (server, client) = served(&folder).await;
    let sessions = SessionsClient::connect(format!("http://{}", server.address()));
    let sessions = sessions.await.unwrap().max_decoding_message_size(usize::MAX);
    (server, client, sessions)
}

/// Two seconds of a character that walks ahead in a style.
async fn walked(client: &mut calls::Client, style: &str) -> (Vec<f32>, Vec<f32>) {
    let names = ["hero"];
    open(client, &names).await;
    let mut command = walk("hero", 1, (0.0, 1.0));
    locomote(&mut command).style = style.to_owned();
    let block = stepped(client, step(&names, 60, vec![command])).await;
    let close = v1::CloseSessionsRequest {
        ids: names.map(str::to_owned).to_vec(),
    };
    client.close_sessions(close).await.unwrap();
    frames_of(&block, 0)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_the_planner_walks_by_velocity_in_its_modes() {
    let (server, _, mut client) = start().await;
    let styles = client
        .list_styles(v1::ListStylesRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(styles.default_style, "walk");
    assert!(styles.styles.iter().any(|style| style.name == "zombie"));

    let (roots, rotations) = walked(&mut client, "walk").await;
    let way = |roots: &[f32]| roots[roots.len() - 1] - roots[2];
    assert!((1.0..2.2).contains(&way(&roots)), "{} m in 2 s", way(&roots));
    assert!(rotations.iter().all(|number| number.is_finite()));
    let again = walked(&mut client, "walk").await;
    assert_eq!(
        (&roots, &rotations),
        (&again.0, &again.1),
        "the same seed and commands"
    );

    let (zombie, other) = walked(&mut client, "zombie").await;
    assert!((1.0..2.2).contains(&way(&zombie)));
    let apart = rotations.iter().zip(&other).map(|(a, b)| (a - b).abs());
    assert!(
        apart.fold(0.0, f32::max) > 0.01,
        "each mode has a pose of its own"
    );
    server.shut_down().await;
}

fn refused(error: &Status, said: &str) {
    assert_eq!(error.code(), Code::InvalidArgument, "{error}");
    assert!(error.message().contains(said), "{error}");
    let reason = error.get_details_error_info().unwrap().reason;
    assert_eq!(reason, "PACK_CANNOT");
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_but_live_characters_is_refused_by_name() {
    let (server, mut client, mut sessions) = start().await;
    let error = client
        .in_between(v1::InBetweenRequest::default())
        .await
        .unwrap_err();
    refused(
        &error,
        "the pack g1-planner cannot do this: it has no capability inbetween; it has: live",
    );
    let point = |z: f32| v1::PathPoint {
        position: Some(v1::Vec3 { x: 0.0, y: 0.0, z }),
        heading: None,
        time: Some(z),
    };
    let path = Goal::Path(v1::PathGoal {
        points: vec![point(0.0), point(4.0)],
        ..v1::PathGoal::default()
    });
    let words = Goal::Prompt(v1::Prompt {
        text: "a robot walks".to_owned(),
        ..v1::Prompt::default()
    });
    for (goal, said) in [(path, "no capability path"), (words, "no capability text")] {
        let request = v1::GenerateRequest {
            goal: Some(goal),
            ..v1::GenerateRequest::default()
        };
        let error = match client.generate(request).await {
            Err(error) => error,
            Ok(answer) => answer.into_inner().message().await.unwrap_err(),
        };
        refused(&error, said);
    }
    open(&mut sessions, &["hero"]).await;
    let mut command = walk("hero", 1, (0.0, 1.0));
    command.intent = Some(Intent::Skill(v1::UseSkill {
        name: "jump".to_owned(),
        ..v1::UseSkill::default()
    }));
    let request = v1::CommandRequest {
        commands: vec![command],
    };
    let results = sessions.command(request).await.unwrap().into_inner().results;
    assert_eq!(results[0].problem.as_ref().unwrap().reason, "PACK_CANNOT");
    server.shut_down().await;
}
