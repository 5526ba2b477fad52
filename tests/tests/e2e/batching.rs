//! Concurrent callers share inference calls, and each gets the same answer as alone.

use std::sync::Arc;

use tokio::sync::Barrier;
use troupe_client::{Client, InBetween};
use troupe_proto::v1;

use crate::motion::{frames_difference, message, request, walk};
use crate::server::Server;

const CALLERS: usize = 64;

/// Sum and count of a histogram of `/metrics`, over all its labels.
async fn histogram(server: &Server, name: &str) -> [f64; 2] {
    let text = reqwest::get(server.path("/metrics"))
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    ["_sum", "_count"].map(|part| {
        let lines = text
            .lines()
            .filter(|line| line.starts_with(&format!("{name}{part}")));
        lines
            .filter_map(|line| line.rsplit_once(' ')?.1.parse::<f64>().ok())
            .sum()
    })
}

async fn fill(rpc: &mut crate::server::Rpc, character: v1::Character) -> v1::Frames {
    let answer = rpc.in_between(request([character])).await.unwrap().into_inner();
    answer.characters.into_iter().next().unwrap().frames.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn callers_at_the_same_time_get_the_same_as_alone() {
    // A server of its own: the shared one also counts the requests of other tests. On a slow
    // machine the last of the callers wait for longer than the usual limit.
    let server = Server::start_with(|config| config.max_queue_ms = 0).await;
    let pack = Client::connect(server.url())
        .await
        .unwrap()
        .pack("")
        .await
        .unwrap();
    let clip = walk(&pack);
    let tasks = (0..CALLERS)
        .map(|i| {
            message(
                &pack,
                &InBetween::from_clip(&clip, 5 + 3 * i, 20 + 3 * i + i % 40).unwrap(),
            )
        })
        .collect::<Vec<_>>();

    let mut rpc = server.rpc().await;
    let mut alone = Vec::new();
    for task in &tasks {
        alone.push(fill(&mut rpc, task.clone()).await);
    }

    let [sum, count] = histogram(&server, "troupe_batch_size").await;
    assert!(
        (sum - count).abs() < 0.5,
        "one caller at a time makes batches of one: {sum} in {count}"
    );
    let start = Arc::new(Barrier::new(CALLERS));
    let mut callers = Vec::new();
    for task in tasks {
        let (mut rpc, start) = (server.rpc().await, start.clone());
        callers.push(tokio::spawn(async move {
            start.wait().await;
            fill(&mut rpc, task).await
        }));
    }
    for (i, (caller, alone)) in callers.into_iter().zip(&alone).enumerate() {
        let error = frames_difference(&caller.await.unwrap(), alone);
        assert!(error < 1e-4, "caller {i}: {error}");
    }

    let [all, batches] = histogram(&server, "troupe_batch_size").await;
    let mean = (all - sum) / (batches - count);
    println!("mean batch size over the burst: {mean:.1}");
    assert_eq!((all - sum).round() as usize, CALLERS);
    // The default batch limit of every engine is at least 8.
    assert!(mean > 4.0, "mean batch size {mean}");
    server.stop().await;
}
