//! Sessions with a real pack and its styles.

use tokio::net::TcpListener;
use troupe_proto::v1;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_server::config::Config;
use troupe_server::server::{ServerHandle, serve};

use crate::calls::{Client, frames_of, ids, locomote, open, step, stepped, walk};
use crate::pack_folder;

async fn start() -> (ServerHandle, Client) {
    let config = Config::local(&pack_folder()).unwrap();
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut server = serve(config, listener).await.unwrap();
    server.ready().await.unwrap();
    let client = SessionsClient::connect(format!("http://{}", server.address()));
    let client = client.await.unwrap().max_decoding_message_size(usize::MAX);
    (server, client)
}

/// Two seconds of a walk that turns and stops, among `others`; the others do something else.
async fn walked(client: &mut Client, others: usize) -> (Vec<f32>, Vec<f32>) {
    let names: Vec<String> = std::iter::once("hero".to_owned())
        .chain(ids("extra", others))
        .collect();
    open(client, &names).await;
    let (mut roots, mut rotations) = (Vec::new(), Vec::new());
    let script = [(0.0, 1.2), (1.0, 0.3), (0.0, 0.0), (0.0, -1.0)];
    for (part, velocity) in script.into_iter().enumerate() {
        let turn = |index: usize| (0.2 * index as f32 - 1.0, 0.5 - 0.1 * part as f32);
        let commands = names.iter().enumerate().map(|(index, name)| {
            let velocity = if index == 0 { velocity } else { turn(index) };
            walk(name, part as u64 + 1, velocity)
        });
        let block = stepped(client, step(&names, 15, commands.collect())).await;
        let (more_roots, more_rotations) = frames_of(&block, 0);
        roots.extend(more_roots);
        rotations.extend(more_rotations);
    }
    let close = v1::CloseSessionsRequest { ids: names };
    client.close_sessions(close).await.unwrap();
    (roots, rotations)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_seed_and_commands_give_the_same_frames_alone_and_in_a_batch() {
    let (server, mut client) = start().await;
    let alone = walked(&mut client, 0).await;
    assert_eq!(alone.0.len(), 60 * 3);
    let (first, furthest) = (
        alone.0[2],
        alone.0.chunks(3).map(|root| root[2]).fold(0.0, f32::max),
    );
    assert!(first.abs() < 0.2 && furthest > 0.4, "{first} to {furthest}");
    let among = walked(&mut client, 20).await;
    for (a, b) in [(&alone.0, &among.0), (&alone.1, &among.1)] {
        let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Sums may be in another order in a larger batch on another CPU.
        assert!(apart < 1e-3, "{apart}");
    }
    server.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_style_of_the_pack_moves() {
    let (server, mut client) = start().await;
    let list = client
        .list_styles(v1::ListStylesRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert!(!list.styles.is_empty() && !list.default_style.is_empty());
    let names: Vec<String> = list.styles.iter().map(|style| style.name.clone()).collect();
    open(&mut client, &names).await;
    let commands = list.styles.iter().map(|style| {
        let mut command = walk(&style.name, 1, (0.0, style.default_speed));
        locomote(&mut command).style = style.name.clone();
        command
    });
    let block = stepped(&mut client, step(&names, 60, commands.collect())).await;
    for (index, style) in list.styles.iter().enumerate() {
        let (roots, rotations) = frames_of(&block, index);
        assert!(rotations.iter().all(|number| number.is_finite()));
        let way = roots[179] - roots[2];
        let wanted = if style.is_static { 0.0 } else { style.default_speed };
        assert!(way > 0.5 * wanted - 0.1, "{} went {way} m in 2 s", style.name);
    }
    server.shut_down().await;
}
