//! A `troupe-server` in a process of its own: started with default limits, watched, stopped and
//! killed.

use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::figures::cpu_seconds;

/// Longest wait until a server has started or stopped.
const PATIENCE: Duration = Duration::from_secs(180);
/// Pause between two checks while it waits.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// The folder of the checkout, whose builds and models are measured.
pub(super) fn repository() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A program of the release build.
pub(super) fn release(name: &str) -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR");
    let target = target.map_or_else(|| repository().join("target"), PathBuf::from);
    target.join("release").join(name)
}

/// A server's address, and a temporary folder for its store and its cache. Both outlive its
/// process.
#[derive(Debug)]
pub(super) struct Home {
    binary: PathBuf,
    folder: PathBuf,
    address: SocketAddr,
}

impl Home {
    /// A home with a free port of the loopback interface, for the server of the release build or
    /// another `binary`.
    ///
    /// # Errors
    /// Those of the system, if there is no such binary or the folder cannot be made.
    pub(super) fn new(binary: Option<&Path>) -> io::Result<Self> {
        let binary = binary.map_or_else(|| release("troupe-server"), Path::to_owned);
        let binary = binary.canonicalize().map_err(|error| {
            let build = "cargo build --release -p troupe-server -p troupe-loadtest";
            io::Error::other(format!("{}: {error}; to build it: {build}", binary.display()))
        })?;
        let address = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?;
        let name = format!("troupe-{}-{}", std::process::id(), address.port());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder)?;
        Ok(Self {
            binary,
            folder,
            address,
        })
    }

    /// The address on which its servers listen.
    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of its servers without TLS.
    pub(super) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// The folder, for files that servers read.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Forgets sessions and all uploads.
    ///
    /// # Errors
    /// Those of the system, if the folder cannot be removed.
    pub(super) fn forget(&self) -> io::Result<()> {
        match std::fs::remove_dir_all(self.store()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    fn store(&self) -> PathBuf {
        self.folder.join("store")
    }

    /// A command of the server's binary, without any of the `TROUPE_` variables.
    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.binary);
        command.args(arguments).current_dir(&self.folder);
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("TROUPE_") {
                command.env_remove(name);
            }
        }
        command.env("TROUPE_CACHE", self.folder.join("cache"));
        let library = repository().join(".runtime/libonnxruntime.so");
        if std::env::var_os("ORT_DYLIB_PATH").is_none() && library.exists() {
            command.env("ORT_DYLIB_PATH", library);
        }
        command
    }

    /// Runs the server's binary with these arguments, and gives its standard output.
    ///
    /// # Errors
    /// Its standard error, if it fails.
    pub(super) fn output(&self, arguments: &[&str]) -> io::Result<String> {
        let output = self.command(arguments).output()?;
        if !output.status.success() {
            let why = String::from_utf8_lossy(&output.stderr);
            return Err(io::Error::other(format!("{arguments:?}: {why}")));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Starts a server of the human pack with further flags. It may not be ready yet.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn start(&self, flags: &[&str]) -> io::Result<Server> {
        let log = self.folder.join("server.log");
        let mut command = self.command(&["--listen", &self.address.to_string()]);
        command.arg("--packs").arg(repository().join("models/human"));
        // A configuration may name a store of its own, or none.
        if !flags.contains(&"--config") {
            command.arg("--store").arg(self.store());
        }
        let child = command
            .args(flags)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&log)?)
            .spawn()?;
        Ok(Server {
            child,
            address: self.address,
            log,
        })
    }
}

impl Drop for Home {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// A server that runs. It is killed when it is dropped.
#[derive(Debug)]
pub(super) struct Server {
    child: Child,
    address: SocketAddr,
    log: PathBuf,
}

impl Server {
    /// Waits until it is ready to serve, and gives that moment.
    ///
    /// # Errors
    /// Its log, if it ends or is not ready in three minutes.
    pub(super) fn ready(&mut self) -> io::Result<Instant> {
        let address = self.address;
        self.ready_by(|| get(address, "/readyz").is_ok())
    }

    /// The same, with another check for being ready.
    ///
    /// # Errors
    /// Its log, if it ends or is not ready in three minutes.
    pub(super) fn ready_by(&mut self, is_ready: impl Fn() -> bool) -> io::Result<Instant> {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            if is_ready() {
                return Ok(Instant::now());
            }
            if let Some(status) = self.child.try_wait()? {
                return Err(self.fault(&format!("it ended with {status}")));
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Err(self.fault("it is not ready"))
    }

    fn fault(&self, what: &str) -> io::Error {
        let log = std::fs::read_to_string(&self.log).unwrap_or_default();
        io::Error::other(format!("troupe-server: {what}:\n{log}"))
    }

    /// Kills it at once (SIGKILL).
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn kill(&mut self) -> io::Result<()> {
        self.child.kill()?;
        self.child.wait().map(drop)
    }

    /// Asks it to stop (SIGTERM), and waits until it has stopped.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn stop(&mut self) -> io::Result<ExitStatus> {
        Command::new("kill").arg(self.child.id().to_string()).status()?;
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Err(self.fault("it does not stop"))
    }

    /// Resident memory, bytes.
    ///
    /// # Errors
    /// Those of the system, if the process is gone.
    pub(super) fn memory_bytes(&self) -> io::Result<u64> {
        self.status("VmRSS:")
    }

    /// The most resident memory since [`Self::forget_peak`], bytes.
    ///
    /// # Errors
    /// Those of the system, if the process is gone.
    pub(super) fn peak_bytes(&self) -> io::Result<u64> {
        self.status("VmHWM:")
    }

    /// Has the kernel count the peak of resident memory from now on.
    ///
    /// # Errors
    /// Those of the system, which may not allow it.
    pub(super) fn forget_peak(&self) -> io::Result<()> {
        std::fs::write(format!("/proc/{}/clear_refs", self.child.id()), "5")
    }

    fn status(&self, name: &str) -> io::Result<u64> {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let line = text.lines().find_map(|line| line.strip_prefix(name));
        let kib: Option<u64> = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
        kib.map(|kib| kib * 1024)
            .ok_or_else(|| io::Error::other(format!("no {name} in the process' status")))
    }

    /// Processor time that it has taken so far, seconds.
    ///
    /// # Errors
    /// Those of the system, if the process is gone.
    pub(super) fn cpu_seconds(&self) -> io::Result<f64> {
        cpu_seconds(self.child.id())
    }

    /// Processor time so far of its threads that run no network, in seconds: of those whose names
    /// do not begin with `worker-`.
    ///
    /// # Errors
    /// Those of the system, if the process is gone or the kernel keeps no such times
    /// (`CONFIG_SCHED_INFO`).
    pub(super) fn cpu_seconds_beside_networks(&self) -> io::Result<f64> {
        let mut nanoseconds = 0.0;
        for thread in std::fs::read_dir(format!("/proc/{}/task", self.child.id()))? {
            let thread = thread?.path();
            // A thread may have ended meanwhile.
            let Ok(name) = std::fs::read_to_string(thread.join("comm")) else {
                continue;
            };
            if name.starts_with("worker-") {
                continue;
            }
            let times = std::fs::read_to_string(thread.join("schedstat"))?;
            let first = times
                .split_whitespace()
                .next()
                .and_then(|n| n.parse::<f64>().ok());
            nanoseconds += first.unwrap_or_default();
        }
        Ok(nanoseconds / 1e9)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.kill();
    }
}

/// The body of a page over HTTP without TLS.
///
/// # Errors
/// Those of the system, if no answer comes in two seconds or its status is not 200.
pub(super) fn get(address: SocketAddr, path: &str) -> io::Result<String> {
    let limit = Duration::from_secs(2);
    let mut stream = TcpStream::connect_timeout(&address, limit)?;
    stream.set_read_timeout(Some(limit))?;
    stream.write_all(
        format!("GET {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n").as_bytes(),
    )?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    match answer.split_once("\r\n\r\n") {
        Some((head, body)) if head.starts_with("HTTP/1.1 200") => Ok(body.to_owned()),
        _ => Err(io::Error::other(answer)),
    }
}

/// The sum of a metric over its labels; 0 of none.
pub(super) fn metric(page: &str, name: &str) -> f64 {
    let of_name = |line: &&str| {
        line.strip_prefix(name)
            .is_some_and(|rest| rest.starts_with([' ', '{']))
    };
    let values = page.lines().filter(of_name);
    values
        .filter_map(|line| line.rsplit(' ').next()?.parse::<f64>().ok())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_is_summed_over_its_labels() {
        let page = "# TYPE a gauge\na{x=\"1\"} 2\na{x=\"2\"} 3.5\nab 7\nb 1\n";
        assert_eq!(
            (metric(page, "a"), metric(page, "b"), metric(page, "c")),
            (5.5, 1.0, 0.0)
        );
    }
}
