//! Clients that are slow, send broken requests or disconnect, and a server that stops.

use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use troupe_client::{Client, ClientError, InBetween};

use crate::motion::{character, difference, request, walk};
use crate::server::{Server, shared};

/// The HTTP head of a request with this body.
fn head_of(body: &str) -> String {
    format!(
        "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n",
        body.len()
    )
}

#[tokio::test]
async fn broken_clients_disturb_no_other() {
    let server = shared();
    let (client, pack) = server.client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66).unwrap();
    let before = client.in_between(&pack, &gap).await.unwrap().clip;
    let body = serde_json::to_string(&request([character(&pack)])).unwrap();
    let head = head_of(&body);

    // Some send nothing, some stop in the head, some in the body, some begin HTTP/2. All stay
    // connected.
    let half = format!("{head}{}", &body[..body.len() / 2]);
    let openings = ["", "POST /v1/inb", &half, "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0"];
    let mut open = Vec::new();
    for i in 0..40 {
        let mut stream = TcpStream::connect(server.address()).await.unwrap();
        stream
            .write_all(openings[i % openings.len()].as_bytes())
            .await
            .unwrap();
        open.push(stream);
    }
    // Some send a whole request or half of one, and disconnect before the answer.
    for i in 0..20 {
        let mut stream = TcpStream::connect(server.address()).await.unwrap();
        let text = if i % 2 == 0 {
            format!("{head}{body}")
        } else {
            half.clone()
        };
        stream.write_all(text.as_bytes()).await.unwrap();
        drop(stream);
    }
    // One asks for a large answer and never reads a byte of it.
    let mut much = character(&pack);
    much.return_positions = true;
    let much = serde_json::to_string(&request(vec![much; 100])).unwrap();
    let mut deaf = TcpStream::connect(server.address()).await.unwrap();
    deaf.write_all(format!("{}{much}", head_of(&much)).as_bytes())
        .await
        .unwrap();
    open.push(deaf);
    // Some stop waiting for the answer.
    for _ in 0..20 {
        let leaving = client.in_between(&pack, &gap);
        let _ = tokio::time::timeout(Duration::from_micros(500), leaving).await;
    }

    // The large request may fill the queue for a moment. The error then asks for another try.
    let answered = async {
        loop {
            match client.in_between(&pack, &gap).await {
                Err(ClientError::Refused(refusal)) if refusal.reason.as_deref() == Some("QUEUE_FULL") => {
                    tokio::time::sleep(Duration::from_millis(20)).await;
                }
                answer => return answer,
            }
        }
    };
    let after = tokio::time::timeout(Duration::from_secs(30), answered).await;
    let after = after.expect("an answer in time").unwrap().clip;
    assert!(difference(&before, &after) < 1e-4);
    drop(open);
}

#[tokio::test]
async fn a_body_that_ends_early_is_refused_on_a_connection_that_stays() {
    let server = shared();
    let pack = server.pack().await;
    let body = serde_json::to_string(&request([character(&pack)])).unwrap();
    let cut = &body[..body.len() / 3];
    let head = "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ntransfer-encoding: chunked\r\n\r\n";
    let mut stream = TcpStream::connect(server.address()).await.unwrap();
    let chunks = format!("{head}{:x}\r\n{cut}\r\n0\r\n\r\n", cut.len());
    stream.write_all(chunks.as_bytes()).await.unwrap();
    let mut answer = vec![0; 4096];
    let length = stream.read(&mut answer).await.unwrap();
    let answer = String::from_utf8_lossy(&answer[..length]).into_owned();
    assert!(
        answer.starts_with("HTTP/1.1 400") && answer.contains("is truncated"),
        "{answer}"
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stopping_server_finishes_calls_that_it_has_begun() {
    let server = Server::start_with(|config| config.drain_timeout_ms = 20_000).await;
    let url = server.url().to_owned();
    let (client, pack) = server.client().await;
    // Many characters, so that the answers take a while.
    let gaps = vec![InBetween::from_clip(&walk(&pack), 40, 100).unwrap(); 100];
    let calls = (0..4).map(|_| {
        let (client, pack, gaps) = (client.clone(), pack.clone(), gaps.clone());
        tokio::spawn(async move { client.in_between_many(&pack, &gaps).await })
    });
    let calls = calls.collect::<Vec<_>>();
    let busy = async {
        while !server_is_busy(&server).await {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(20), busy)
        .await
        .expect("the calls arrive");

    let clean = server.stop().await;
    let mut answered = 0;
    for call in calls {
        match call.await.unwrap() {
            Ok(answers) => {
                assert_eq!(answers.characters.len(), 100);
                answered += 1;
            }
            // The server may refuse a call that it had not begun, but with an error.
            Err(ClientError::Refused(_) | ClientError::Unreachable { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert!(clean, "the connections ended in time");
    assert!(answered > 0, "calls in progress were finished");
    let after = Client::connect(&url).await.expect_err("the port is closed");
    assert!(matches!(after, ClientError::Unreachable { .. }), "{after}");
}

/// Whether a request is in the queue or has been answered.
async fn server_is_busy(server: &Server) -> bool {
    let text = reqwest::get(server.path("/metrics"))
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    let value = |line: &str| {
        line.rsplit_once(' ')
            .and_then(|(_, v)| v.parse::<f64>().ok())
            .unwrap_or_default()
    };
    text.lines()
        .any(|line| line.starts_with("troupe_batch_size_count") && value(line) > 0.0)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn silent_connections_do_not_hold_up_a_stop() {
    let server = Server::start_with(|config| config.drain_timeout_ms = 1_000).await;
    let mut silent = Vec::new();
    for opening in [
        "",
        "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 10\r\n\r\n{",
    ] {
        let mut stream = TcpStream::connect(server.address()).await.unwrap();
        stream.write_all(opening.as_bytes()).await.unwrap();
        silent.push(stream);
    }
    // The server accepts connections in order, so it has accepted both after this call.
    server.pack().await;
    let begin = Instant::now();
    server.stop().await;
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}
