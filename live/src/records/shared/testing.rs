//! A real redis-server or valkey-server for tests.

use std::io::{ErrorKind, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use super::{SharedRecords, Terms};
use troupe_base::telemetry::Telemetry;

pub(crate) const LEASE: Duration = Duration::from_secs(1);
pub(crate) const TERMS: Terms = Terms {
    lease: LEASE,
    renew: Duration::ZERO,
    remember: Duration::from_secs(60),
    settle: Duration::ZERO,
    fill: Duration::ZERO,
};
/// Programs that serve, the first that there is.
const SERVERS: [&str; 2] = ["redis-server", "valkey-server"];

/// A redis-server with nothing in it.
pub(crate) struct Redis {
    process: Child,
    pub(super) port: u16,
    folder: tempfile::TempDir,
}

impl Redis {
    /// `None` if there is no server: then the test is left out, aloud.
    pub(crate) fn start() -> Option<Self> {
        Self::start_with(&[])
    }

    /// [`Redis::start`] with options of redis-server.
    pub(super) fn start_with(options: &[&str]) -> Option<Self> {
        let port = free_port();
        let folder = tempfile::tempdir().unwrap();
        let Some(process) = process(port, &folder, options) else {
            let text = "*** A SHARED STORE WAS NOT TESTED: there is no redis-server or valkey-server\n";
            // Unlike `eprintln`, this is shown for tests that pass, too.
            let _ = std::io::stderr().write_all(text.as_bytes());
            return None;
        };
        let redis = Self {
            process,
            port,
            folder,
        };
        redis.wait();
        Some(redis)
    }

    fn wait(&self) {
        let tries = (0..500).any(|_| {
            let is_up = TcpStream::connect(("127.0.0.1", self.port)).is_ok();
            sleep(Duration::from_millis(if is_up { 0 } else { 20 }));
            is_up
        });
        assert!(tries, "redis-server does not start");
    }

    pub(crate) fn stop(&mut self) {
        self.signal("CONT");
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }

    pub(crate) fn start_again(&mut self) {
        self.process = process(self.port, &self.folder, &[]).unwrap();
        self.wait();
    }

    pub(super) fn signal(&self, name: &str) {
        let id = self.process.id().to_string();
        let sent = Command::new("kill").args([&format!("-{name}"), &id]).status();
        assert!(sent.unwrap().success());
    }

    pub(crate) fn server(&self, address: &str) -> SharedRecords {
        self.server_with(address, TERMS)
    }

    pub(crate) fn server_with(&self, address: &str, terms: Terms) -> SharedRecords {
        let place = format!("redis://127.0.0.1:{}", self.port).parse().unwrap();
        SharedRecords::new(&place, address.to_owned(), terms, &Telemetry::new().unwrap())
    }

    pub(crate) fn ask<T: redis::FromRedisValue>(&self, command: &[&str]) -> T {
        let client = redis::Client::open(format!("redis://127.0.0.1:{}", self.port)).unwrap();
        let mut asked = redis::cmd(command[0]);
        for part in &command[1..] {
            asked.arg(*part);
        }
        asked.query(&mut client.get_connection().unwrap()).unwrap()
    }

    pub(super) fn field(&self, name: &str) -> Option<String> {
        self.ask(&["HGET", "troupe:session:studio/hero", name])
    }

    pub(super) fn token(&self) -> u64 {
        self.field("token").map_or(0, |token| token.parse().unwrap())
    }
}

impl Drop for Redis {
    fn drop(&mut self) {
        let _ = Command::new("kill")
            .args(["-CONT", &self.process.id().to_string()])
            .status();
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn process(port: u16, folder: &tempfile::TempDir, options: &[&str]) -> Option<Child> {
    SERVERS.iter().find_map(|program| {
        let started = Command::new(program)
            .args(["--bind", "127.0.0.1", "--port", &port.to_string()])
            .args(["--save", "", "--appendonly", "no", "--dir"])
            .arg(folder.path())
            .args(options)
            .stdout(Stdio::null())
            .spawn();
        match started {
            Ok(process) => Some(process),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => panic!("{program} does not start: {error}"),
        }
    })
}

/// A port that no program uses at the moment.
pub(super) fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}
