//! `troupe-eval viewers`: what viewers of a crowd cost its server. There is one stream of
//! characters, and more and more viewers watch it over WebSocket.

mod crowd;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use clap::Args;
use futures_util::{SinkExt as _, StreamExt as _};
use prost::Message as _;
use tokio::task::JoinSet;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::{Bytes, Message};
use troupe_client::Client;
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;

use super::ServerBinary;
use super::program::Server;
use crate::figures::table;

/// Time before a measurement, for plans and connections to be made.
const WARM_UP: Duration = Duration::from_secs(4);
/// Ticks a second.
const RATE_HZ: f64 = 30.0;
/// How often a tick is encoded to measure the time of that.
const WRITES: u32 = 2000;

/// Measure what viewers of a crowd cost its server.
#[derive(Debug, Args)]
pub(crate) struct Viewers {
    /// Live characters on the stream.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=256))]
    characters: u32,
    /// Numbers of viewers to measure, after a measurement without any.
    #[arg(long, default_value = "1,10,100", value_delimiter = ',')]
    viewers: Vec<usize>,
    /// Time of each measurement.
    #[arg(long, default_value_t = 15, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(2..=600))]
    seconds: u64,
    #[command(flatten)]
    server: ServerBinary,
}

/// What all viewers saw together while `counts` is set.
#[derive(Debug, Default)]
struct Seen {
    counts: AtomicBool,
    ticks: AtomicU64,
    bytes: AtomicU64,
    /// Ticks that the server left out, summed over viewers.
    missed: AtomicU64,
}

/// A row of the table.
struct Row {
    viewers: usize,
    /// Processor time of the server for a second, ms.
    cpu_ms: f64,
    /// Of one viewer.
    ticks_per_s: f64,
    /// Of one viewer.
    bytes_per_s: f64,
    missed: u64,
}

pub(crate) async fn run(arguments: Viewers) -> anyhow::Result<()> {
    let home = arguments.server.home()?;
    let mut server = home.start(&[])?;
    server.ready()?;
    let client = Client::connect(&home.url()).await.context("the server")?;
    let (crowd, name) = crowd::open(&client, arguments.characters).await?;
    let driving = tokio::spawn(crowd::drive(crowd));
    tokio::time::sleep(WARM_UP).await;

    let mut rows = vec![measure(&arguments, &server, home.address(), &name, 0).await?];
    for &viewers in &arguments.viewers {
        rows.push(measure(&arguments, &server, home.address(), &name, viewers).await?);
    }
    let tick = one_tick(home.address(), &name).await?;
    driving.abort();
    let (bytes, write_us) = (tick.len(), write_us(tick)?);
    println!(
        "Processor time of the server, for {} characters at {RATE_HZ} Hz:\n",
        arguments.characters
    );
    println!("{}", shown(&rows));
    println!("A tick has {bytes} bytes. To encode it as protobuf takes {write_us:.1} µs.");
    server.stop()?;
    Ok(())
}

fn shown(rows: &[Row]) -> String {
    let alone = rows.first().map_or(0.0, |row| row.cpu_ms);
    let cells = |row: &Row| {
        let each = (row.cpu_ms - alone) / row.viewers as f64;
        let of_viewer = |text: String| if row.viewers == 0 { "–".to_owned() } else { text };
        vec![
            row.viewers.to_string(),
            format!("{:.1}", row.cpu_ms / 10.0),
            of_viewer(format!("{:.0}", 1e3 * each / RATE_HZ)),
            of_viewer(format!("{:.1}", row.ticks_per_s)),
            of_viewer(format!("{:.0}", row.bytes_per_s / 1e3)),
            of_viewer(row.missed.to_string()),
        ]
    };
    let heads = [
        "viewers",
        "server (% of a core)",
        "a viewer and tick (µs)",
        "ticks/s of each",
        "kB/s of each",
        "ticks missed, all",
    ];
    table(&heads, 0, &rows.iter().map(cells).collect::<Vec<_>>())
}

/// Has viewers watch, and measures the server.
async fn measure(
    arguments: &Viewers,
    server: &Server,
    address: SocketAddr,
    name: &str,
    viewers: usize,
) -> anyhow::Result<Row> {
    let seen = Arc::new(Seen::default());
    let mut watching = JoinSet::new();
    for _ in 0..viewers {
        watching.spawn(watch(address, name.to_owned(), seen.clone()));
    }
    tokio::time::sleep(WARM_UP).await;
    seen.counts.store(true, Ordering::Relaxed);
    let (from, before) = (Instant::now(), server.cpu_seconds()?);
    tokio::time::sleep(Duration::from_secs(arguments.seconds)).await;
    let (seconds, after) = (from.elapsed().as_secs_f64(), server.cpu_seconds()?);
    seen.counts.store(false, Ordering::Relaxed);
    if let Some(ended) = watching.try_join_next() {
        ended??;
        bail!("a viewer's stream ended");
    }
    let each = |all: &AtomicU64| all.load(Ordering::Relaxed) as f64 / seconds / viewers.max(1) as f64;
    Ok(Row {
        viewers,
        cpu_ms: 1e3 * (after - before) / seconds,
        ticks_per_s: each(&seen.ticks),
        bytes_per_s: each(&seen.bytes),
        missed: seen.missed.load(Ordering::Relaxed),
    })
}

type Socket = tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<tokio::net::TcpStream>>;

async fn open(address: SocketAddr, name: &str) -> anyhow::Result<Socket> {
    let (mut socket, _) = connect_async(format!("ws://{address}/v1/drive")).await?;
    let open = v1::DriveOpen {
        watch: name.to_owned(),
        ..v1::DriveOpen::default()
    };
    let message = Some(Ask::Open(open));
    let bytes = v1::DriveRequest { message }.encode_to_vec();
    socket.send(Message::Binary(bytes.into())).await?;
    Ok(socket)
}

/// Watches, and decodes only the first fields of each message, because decoding is the viewer's
/// cost.
async fn watch(address: SocketAddr, name: String, seen: Arc<Seen>) -> anyhow::Result<()> {
    let mut socket = open(address, &name).await?;
    let mut last = None;
    while let Some(message) = socket.next().await {
        let Message::Binary(bytes) = message? else {
            continue;
        };
        let Some(tick) = tick_number(&bytes) else { continue };
        let skipped = last.map_or(0, |last| tick - last - 1);
        last = Some(tick);
        if seen.counts.load(Ordering::Relaxed) {
            seen.ticks.fetch_add(1, Ordering::Relaxed);
            seen.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
            seen.missed.fetch_add(skipped, Ordering::Relaxed);
        }
    }
    bail!("the server ended the stream")
}

/// The number of a tick, if the message is one: field 1 of field 1 of `DriveResponse`.
fn tick_number(bytes: &Bytes) -> Option<u64> {
    let mut rest = bytes.as_ref();
    let (frames, tick) = (0x0a, 0x08);
    if prost::encoding::decode_varint(&mut rest).ok()? != frames {
        return None;
    }
    prost::encoding::decode_varint(&mut rest).ok()?;
    // The encoding leaves a number of 0 out.
    if prost::encoding::decode_varint(&mut rest).ok()? != tick {
        return Some(0);
    }
    prost::encoding::decode_varint(&mut rest).ok()
}

async fn one_tick(address: SocketAddr, name: &str) -> anyhow::Result<Bytes> {
    let mut socket = open(address, name).await?;
    while let Some(message) = socket.next().await {
        if let Message::Binary(bytes) = message?
            && tick_number(&bytes).is_some()
        {
            return Ok(bytes);
        }
    }
    bail!("no tick came")
}

/// The time to encode a tick, µs.
fn write_us(tick: Bytes) -> anyhow::Result<f64> {
    let response = v1::DriveResponse::decode(tick)?;
    let Some(Say::Frames(_)) = &response.message else {
        bail!("the message is no tick");
    };
    let from = Instant::now();
    for _ in 0..WRITES {
        std::hint::black_box(std::hint::black_box(&response).encode_to_vec());
    }
    Ok(1e6 * from.elapsed().as_secs_f64() / f64::from(WRITES))
}
