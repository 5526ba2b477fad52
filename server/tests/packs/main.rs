//! The server and its parts with a real pack: `models/human`, or the folder that the environment
//! variable TROUPE_TEST_PACK names. They need the ONNX Runtime library (`make runtime` fetches it).

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

#[path = "../common/calls.rs"]
#[allow(dead_code, reason = "the tests over the wire use the rest")]
mod calls;
mod virtual_time;

mod carried;
mod engines;
mod live;
mod objects;
mod onnx;
mod performances;
mod planner;
mod program;
mod sessions;
mod walks;
mod words;

use std::path::{Path, PathBuf};

use tokio::net::TcpListener;
use tonic::transport::Channel;
use troupe_engine::pack::MANIFEST_FILE;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_server::config::Config;
use troupe_server::server::{ServerHandle, serve};

type Client = MotionClient<Channel>;

/// A ready server with the packs of `folder`, and a client that reads answers of any size.
async fn served(folder: &Path) -> (ServerHandle, Client) {
    let mut config = Config::local(folder).unwrap();
    // However slow the machine is, no call is refused.
    config.max_queue_ms = 0;
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut server = serve(config, listener).await.unwrap();
    server.ready().await.unwrap();
    let client = Client::connect(format!("http://{}", server.address()))
        .await
        .unwrap();
    (server, client.max_decoding_message_size(usize::MAX))
}

/// The folder of the pack to test with.
fn pack_folder() -> PathBuf {
    let named = std::env::var_os("TROUPE_TEST_PACK").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human"));
    assert!(
        folder.join(MANIFEST_FILE).is_file(),
        "there is no pack in {}",
        folder.display()
    );
    folder
}
