//! A `troupe-server` in a process of its own: started with default limits, watched, stopped and
//! killed.

use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for a server that starts or stops.
const PATIENCE: Duration = Duration::from_secs(180);
/// Time between two looks at something that is waited for.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Clock ticks a second in `/proc/PID/stat`: 100 on every Linux.
const CLOCK_TICKS: f64 = 100.0;

/// The repository.
pub fn repository() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A program of the release build.
pub fn release(name: &str) -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR");
    let target = target.map_or_else(|| repository().join("target"), PathBuf::from);
    target.join("release").join(name)
}

/// What a server keeps when its process ends: an address, and a temporary folder for its store and
/// its cache.
#[derive(Debug)]
pub struct Home {
    binary: PathBuf,
    folder: PathBuf,
    address: SocketAddr,
}

impl Home {
    /// A home with a free port of the loopback interface, for the server of the release build or
    /// another `binary`.
    ///
    /// # Errors
    /// Where the binary is not there, or the folder cannot be made.
    pub fn new(binary: Option<&Path>) -> io::Result<Self> {
        let binary = binary.map_or_else(|| release("troupe-server"), Path::to_owned);
        let binary = binary.canonicalize().map_err(|error| {
            let build = "cargo build --release -p troupe-server -p troupe-loadtest";
            io::Error::other(format!("{}: {error}; build it: {build}", binary.display()))
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

    /// Where its servers listen.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of its servers without TLS.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// The folder, for files that servers read.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Forgets sessions and all that was uploaded.
    ///
    /// # Errors
    /// Where the folder cannot be removed.
    pub fn forget(&self) -> io::Result<()> {
        match std::fs::remove_dir_all(self.store()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    /// The folder of the store.
    pub fn store(&self) -> PathBuf {
        self.folder.join("store")
    }

    /// A command of the server's binary. It finds no configuration but its flags.
    pub fn command(&self, arguments: &[&str]) -> Command {
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

    /// What the server prints with these arguments.
    ///
    /// # Errors
    /// Where it fails.
    pub fn output(&self, arguments: &[&str]) -> io::Result<String> {
        let output = self.command(arguments).output()?;
        if !output.status.success() {
            let told = String::from_utf8_lossy(&output.stderr).into_owned();
            return Err(io::Error::other(format!("{arguments:?}: {told}")));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Starts a server that serves the human pack, with these flags besides. It is not ready yet.
    ///
    /// # Errors
    /// Where it cannot be started.
    pub fn start(&self, flags: &[&str]) -> io::Result<Server> {
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
pub struct Server {
    child: Child,
    address: SocketAddr,
    log: PathBuf,
}

impl Server {
    /// Waits until it is ready to serve, and says when it was.
    ///
    /// # Errors
    /// Where it ends, or is not ready in three minutes.
    pub fn ready(&mut self) -> io::Result<Instant> {
        let address = self.address;
        self.ready_by(|| get(address, "/readyz").is_ok())
    }

    /// The same for a server that is asked in another way.
    ///
    /// # Errors
    /// Where it ends, or is not ready in three minutes.
    pub fn ready_by(&mut self, is_ready: impl Fn() -> bool) -> io::Result<Instant> {
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
    pub fn kill(&mut self) -> io::Result<()> {
        self.child.kill()?;
        self.child.wait().map(drop)
    }

    /// Asks it to stop (SIGTERM), and waits until it has.
    ///
    /// # Errors
    /// Those of the system.
    pub fn stop(&mut self) -> io::Result<ExitStatus> {
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
    /// Where the process is gone.
    pub fn memory_bytes(&self) -> io::Result<u64> {
        self.status("VmRSS:")
    }

    /// The most resident memory since [`Self::forget_peak`], bytes.
    ///
    /// # Errors
    /// Where the process is gone.
    pub fn peak_bytes(&self) -> io::Result<u64> {
        self.status("VmHWM:")
    }

    /// Has the kernel count the peak of resident memory from now on.
    ///
    /// # Errors
    /// Where the system does not let it.
    pub fn forget_peak(&self) -> io::Result<()> {
        std::fs::write(format!("/proc/{}/clear_refs", self.child.id()), "5")
    }

    fn status(&self, name: &str) -> io::Result<u64> {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let line = text.lines().find_map(|line| line.strip_prefix(name));
        let kib: Option<u64> = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
        kib.map(|kib| kib * 1024)
            .ok_or_else(|| io::Error::other(format!("no {name} in the process' status")))
    }

    /// Processor time that it has taken, seconds.
    ///
    /// # Errors
    /// Where the process is gone.
    pub fn cpu_seconds(&self) -> io::Result<f64> {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id()))?;
        // Behind the name, which may hold spaces: user and system time are the 12th and the 13th.
        let rest = text.rsplit_once(')').map_or("", |(_, rest)| rest);
        let numbers = rest.split_whitespace().skip(11).take(2);
        Ok(numbers.filter_map(|n| n.parse::<f64>().ok()).sum::<f64>() / CLOCK_TICKS)
    }

    /// Processor time of its threads so far that run no network, in seconds: of those whose names
    /// do not begin with `worker-`.
    ///
    /// # Errors
    /// Where the process is gone, or the kernel keeps no such times (`CONFIG_SCHED_INFO`).
    pub fn cpu_seconds_beside_networks(&self) -> io::Result<f64> {
        let mut nanoseconds = 0.0;
        for thread in std::fs::read_dir(format!("/proc/{}/task", self.child.id()))? {
            let thread = thread?.path();
            // One that has ended meanwhile counts no more.
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
/// Where nobody answers in two seconds, or the answer is not 200.
pub fn get(address: SocketAddr, path: &str) -> io::Result<String> {
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

/// The sum of a metric over its labels; 0 where it is not there.
pub fn metric(page: &str, name: &str) -> f64 {
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
