//! More live characters than the engine can serve as often as usual: everybody keeps moving, and
//! the important are planned for more often.

use std::time::Duration;

use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use crate::common::TestServer;
use crate::common::calls::{drive, ids, options};

/// 200 plans a second; usual intervals of 9 frames would take 300.
const ROW: Duration = Duration::from_millis(10);
const WORKERS: usize = 2;
const CROWD: usize = 90;

#[tokio::test(flavor = "multi_thread")]
async fn a_crowd_that_is_too_large_keeps_moving_and_the_important_are_planned_for_more_often() {
    let server = TestServer::start_with(|config| {
        config.workers = WORKERS;
        config.max_batch = 8;
    })
    .await;
    server.gate.set_row_time(ROW);
    let mut client = server.sessions().await;
    let names = ids("c", CROWD);
    let sessions = names.iter().enumerate().map(|(nth, id)| v1::SessionOptions {
        seed: nth as u64,
        priority: Some(nth as f32 / (CROWD - 1) as f32),
        ..options(id)
    });
    let sessions = sessions.collect();
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();

    let (_ask, mut answers) = drive(&mut client, &names).await;
    let (mut before, mut ways) = (Vec::new(), Vec::new());
    let mut ticks = 0;
    while ticks < 300 {
        let answer = answers.message().await.unwrap().unwrap();
        let Some(Say::Frames(frames)) = answer.message else {
            continue;
        };
        ticks = frames.tick;
        let roots = &frames.blocks[0].root_positions;
        let now: Vec<f32> = roots.chunks_exact(3).map(|root| root[2]).collect();
        if ticks > 240 && before.is_empty() {
            before = now;
        } else if !before.is_empty() {
            ways = now
                .iter()
                .zip(&before)
                .map(|(now, before)| now - before)
                .collect();
        }
    }
    // In two seconds at 1.2 m/s.
    assert_eq!(ways.len(), CROWD);
    assert!(ways.iter().all(|way| *way > 1.5), "{ways:?}");

    let list = v1::ListSessionsRequest::default();
    let open = client.list_sessions(list).await.unwrap().into_inner().sessions;
    let underruns: u64 = open.iter().map(|of| of.stats.unwrap().underruns).sum();
    // A machine that is busy with something else may cost a few.
    assert!(underruns <= CROWD as u64 / 10, "{underruns}");

    let text = server.handle.service().telemetry().render();
    let value = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(name));
        let value = line.and_then(|line| line.rsplit(' ').next()?.parse().ok());
        value.unwrap_or_else(|| panic!("no {name} in\n{text}"))
    };
    let pressure = value("troupe_crowd_pressure{model=\"toy\"");
    assert!(pressure > 0.03, "{pressure}");
    let interval = |band: &str| {
        let of = |part: &str| {
            let labels = format!("{{model=\"toy\",version=\"1.2.3\",priority=\"{band}\"}}");
            value(&format!("troupe_plan_interval_frames_{part}{labels}"))
        };
        of("sum") / of("count")
    };
    let (low, high) = (interval("low"), interval("high"));
    assert!(low > high + 1.0, "every {low} frames, and every {high}");
}
