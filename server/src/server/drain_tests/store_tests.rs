//! A server whose disk hangs or is full, in real time.

use std::io;

use tracing_subscriber::fmt::MakeWriter;

use super::*;
use troupe_live::session::MAX_STORE_AGE;
use troupe_proto::v1;

/// What was logged.
#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<u8>>>);

impl io::Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Lines {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

impl Lines {
    fn count(&self, text: &str) -> usize {
        String::from_utf8_lossy(&self.0.lock().unwrap())
            .matches(text)
            .count()
    }
}

/// Ends a hung write when a test ends, because the runtime waits for it.
struct Release(Shared);

impl Drop for Release {
    fn drop(&mut self) {
        self.0.set_fault(None);
    }
}

/// A server with a session `id`, which the disk has.
async fn serve_with(disk: &Shared, id: &str) -> ServerHandle {
    let mut config = Config::local(Path::new("unused")).unwrap();
    config.default_pack = Some("toy".into());
    config.drain_timeout_ms = 300;
    config.fixed.snapshot_interval = Duration::from_millis(20);
    let (records, packs) = (disk.clone(), source(&Gate::default()));
    let around = Around {
        time: TimeSource::default(),
        executor: Executor::here(),
        records: Box::new(move |_| Ok(Some(Box::new(on(&records)?)))),
    };
    let address = SocketAddr::from(([127, 0, 0, 1], 8080));
    let (_, listener) = port();
    let served = serve_on(config, listener, address, around, || Ok(vec![packs]));
    let mut handle = served.await.unwrap();
    handle.ready().await.unwrap();
    open(&handle, id).await;
    let written = || metric(&handle, "troupe_store_written_bytes_total ") > 0.0;
    until("a written session", written).await;
    handle
}

async fn open(handle: &ServerHandle, id: &str) {
    let options = v1::SessionOptions {
        id: id.to_owned(),
        ..v1::SessionOptions::default()
    };
    let sessions = vec![options];
    let request = v1::CreateSessionsRequest { sessions };
    handle.service().create_sessions(request).await.unwrap();
}

/// The age of the store as `/metrics` shows it, s.
fn age_s(handle: &ServerHandle) -> f64 {
    metric(handle, "troupe_store_age_seconds ")
}

fn metric(handle: &ServerHandle, name: &str) -> f64 {
    handle.service().look();
    let text = handle.service().telemetry().render();
    let mut lines = text.lines();
    let value = lines.find_map(|line| line.strip_prefix(name));
    value.unwrap().parse().unwrap()
}

async fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    for _ in 0..2000 {
        if is_so() {
            return;
        }
        sleep(Duration::from_millis(5)).await;
    }
    panic!("never saw {what}");
}

#[tokio::test]
async fn a_disk_that_hangs_is_seen_while_it_hangs() {
    let lines = Lines::default();
    let logging = tracing_subscriber::fmt()
        .with_writer(lines.clone())
        .with_ansi(false);
    let _logging = tracing::subscriber::set_default(logging.finish());
    let disk = Shared::default();
    let _release = Release(disk.clone());
    let handle = serve_with(&disk, "a").await;
    assert!(age_s(&handle) < 1.0);

    disk.set_fault(Some((0, Fault::Hung)));
    open(&handle, "b").await;
    until("a write that hangs", || disk.hangs()).await;
    assert!(handle.service().ready().is_ok());
    sleep(MAX_STORE_AGE + Duration::from_secs(1)).await;
    let age = age_s(&handle);
    assert!(age > MAX_STORE_AGE.as_secs_f64(), "{age}");
    let error = handle.service().ready().unwrap_err().to_string();
    assert!(
        error.contains("s behind, allowed: at most 5 s; a write to the store has not ended"),
        "{error}"
    );
    assert_eq!(lines.count("changes of sessions are not kept"), 1);

    disk.set_fault(None);
    until("a store that is up to date again", || age_s(&handle) < 1.0).await;
    assert!(handle.service().ready().is_ok());
    until("a line in the log", || {
        lines.count("changes of sessions are kept again") == 1
    })
    .await;

    disk.set_fault(Some((0, Fault::Hung)));
    open(&handle, "c").await;
    until("a write that hangs", || disk.hangs()).await;
    let begun = std::time::Instant::now();
    let stopped = handle.shut_down_unless(std::future::pending()).await;
    assert_eq!(stopped, Stopped::Unkept);
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    assert_eq!(
        lines.count("sessions are lost: the store does not have their last changes sessions=1"),
        1
    );
    disk.set_fault(None);
}

#[tokio::test]
async fn a_stop_on_a_full_disk_says_how_many_sessions_it_lost() {
    let lines = Lines::default();
    let logging = tracing_subscriber::fmt()
        .with_writer(lines.clone())
        .with_ansi(false);
    let _logging = tracing::subscriber::set_default(logging.finish());
    let disk = Shared::default();
    let handle = serve_with(&disk, "a").await;
    disk.set_fault(Some((0, Fault::Full)));
    for id in ["b", "c", "d"] {
        open(&handle, id).await;
    }
    let stopped = handle.shut_down_unless(std::future::pending()).await;
    assert_eq!(stopped, Stopped::Unkept);
    let lost = lines.count("sessions are lost: the store does not have their last changes sessions=3");
    assert_eq!(lost, 1);
}
