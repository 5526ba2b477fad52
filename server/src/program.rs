//! The program `troupe-server`: command line, signals and exit codes. It is in the library: a
//! binary would compile the generic code of the server once more.

use std::io::{self, IsTerminal as _, Write as _};
use std::net::SocketAddr;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser as _};
use tokio::net::{TcpListener, TcpSocket};
use tracing_subscriber::EnvFilter;
use troupe_edge::clients::Role;
use troupe_edge::keys;

use crate::config::{Cli, Command, Config, DoctorArgs, HealthArgs, KeyCommand, LogFormat};
use crate::doctor::Report;
use crate::health;
use crate::server::{ServerHandle, StartError, Stopped, serve};
use troupe_live::records::RecordsError;

/// Exit code after a mistake on the command line.
const MISTAKEN: u8 = 2;
/// Exit code if the server did not start, or cut requests.
const FAILED: u8 = 1;
/// Exit code after a second signal, which ends the server before its requests have finished.
const FORCED: u8 = 3;
/// Exit code after a stop that could not save the last changes of all sessions.
const UNKEPT: u8 = 4;
/// Exit code if the file of the store is damaged.
const DAMAGED: u8 = 5;

/// Runs the program with the arguments of the process.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => match Cli::removed_flag(&error) {
            Some(removed) => {
                let _ = writeln!(io::stderr(), "troupe-server: {removed}");
                return ExitCode::from(MISTAKEN);
            }
            None => error.exit(),
        },
    };
    let result = match &cli.command {
        Some(Command::Doctor(args)) => doctor(args),
        Some(Command::Health(args)) => check_health(args),
        Some(Command::Key(KeyCommand::New { name, role, tenant })) => new_key(name, *role, tenant.as_deref()),
        Some(Command::Man { out }) => write_manual(out),
        None if cli.print_config => say(&Config::template()).map(|()| ExitCode::SUCCESS),
        None => run(cli),
    };
    result.unwrap_or_else(|error| {
        complain(&error);
        ExitCode::FAILURE
    })
}

fn complain(error: &anyhow::Error) {
    // Unlike `eprintln`, this does not panic if standard error is closed.
    let _ = writeln!(io::stderr(), "troupe-server: {error:#}");
}

/// Ends the process without the destructors of its libraries, because threads may still use them.
fn leave(code: u8) -> ! {
    let _ = io::stdout().flush();
    #[cfg(unix)]
    #[allow(unsafe_code, reason = "the standard library always runs destructors")]
    // SAFETY: the call only ends the process.
    unsafe {
        libc::_exit(i32::from(code))
    }
    #[cfg(not(unix))]
    std::process::exit(i32::from(code))
}

/// Writes to standard output. A closed output is no error.
fn say(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to standard output"),
    }
}

/// Prints the report. Fails if the server would not start.
fn doctor(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let config = Config::load_for_doctor(args)?;
    let report = Report::examine(&config);
    let text = if args.json {
        serde_json::to_string_pretty(&report).context("cannot write JSON")? + "\n"
    } else {
        report.to_string()
    };
    say(&text)?;
    Ok(match report.serves() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// Makes a key, and prints it with its entry for the file of keys.
fn new_key(name: &str, role: Role, tenant: Option<&str>) -> anyhow::Result<ExitCode> {
    let key = keys::new_key();
    let mut entry = keys::entry(name, role, &key);
    if let Some(tenant) = tenant {
        entry += &keys::tenant_line(tenant).map_err(anyhow::Error::msg)?;
    }
    say(&format!("# The key, which is shown this once: {key}\n{entry}"))?;
    Ok(ExitCode::SUCCESS)
}

fn write_manual(folder: &Path) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
        .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Fails if the server does not answer or is not ready.
fn check_health(args: &HealthArgs) -> anyhow::Result<ExitCode> {
    let (url, tls) = match &args.url {
        Some(url) => (url.clone(), args.tls(None)),
        None => {
            let config = Config::load_for_health(args)?;
            let url = match config.health_listen {
                Some(address) => health::ready_url(address, false)?,
                None => health::ready_url(config.listen, config.tls_certificate.is_some())?,
            };
            (url, args.tls(config.options.tls_certificate))
        }
    };
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the asynchronous runtime")?
        .block_on(health::check(&url, &tls, args.timeout()))
        .with_context(|| url.to_string())?;
    say(&format!("{url}: ok\n"))?;
    Ok(ExitCode::SUCCESS)
}

fn run(cli: Cli) -> anyhow::Result<ExitCode> {
    let config = Config::load(cli)?;
    start_logging(&config)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .on_thread_start(yield_to_workers)
        .build()
        .context("cannot start the asynchronous runtime")?;
    let ended = runtime.block_on(serve_until_stopped(config));
    // A thread that waits for a disk must not delay the exit.
    runtime.shutdown_timeout(Duration::from_millis(100));
    match ended {
        Ok(Ended { code, is_idle: true }) => Ok(ExitCode::from(code)),
        Ok(Ended { code, is_idle: false }) => leave(code),
        Err(error) => {
            complain(&error);
            // Packs may still be loading.
            leave(match error.downcast_ref() {
                Some(StartError::Records(RecordsError::Damaged { .. })) => DAMAGED,
                _ => FAILED,
            })
        }
    }
}

/// How the server ended.
struct Ended {
    code: u8,
    /// Whether no thread uses a library or the store any more.
    is_idle: bool,
}

/// Makes this thread wait for a free core or the end of a time slice when it wakes. It does not
/// push a worker off its core.
///
/// A finished batch wakes one caller for each of its characters. If workers keep all cores busy,
/// each caller would drive a network out of the core's caches for 0.1 ms of work.
#[cfg(target_os = "linux")]
#[allow(
    unsafe_code,
    reason = "no crate sets the policy and leaves the niceness as it is"
)]
fn yield_to_workers() {
    // Zero is the only priority of this policy. musl's struct has more fields, for another policy.
    // SAFETY: all fields are integers, for which zero is valid.
    let priority: libc::sched_param = unsafe { std::mem::zeroed() };
    // SAFETY: the pointer is valid for the call, and 0 names the calling thread. The call needs no
    // privilege. If a sandbox refuses it, a busy server is slower, and nothing else changes.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_BATCH, &raw const priority) };
}

#[cfg(not(target_os = "linux"))]
fn yield_to_workers() {}

fn start_logging(config: &Config) -> anyhow::Result<()> {
    let filter = EnvFilter::try_new(&config.log).with_context(|| format!("log is {:?}", config.log))?;
    let logging = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(io::stderr().is_terminal())
        // Reports about failed log writes go to standard error too, and panic if it is closed.
        .log_internal_errors(false)
        .with_writer(io::stderr);
    match config.log_format {
        LogFormat::Text => logging.init(),
        LogFormat::Json => logging.json().init(),
    }
    Ok(())
}

/// Connections that the system queues before the server accepts them. A client without room in this
/// queue tries again after a second. With the usual 1,024, a health check had to wait while another
/// client opened 1,000 connections. The system may allow fewer (`net.core.somaxconn`).
const LISTEN_BACKLOG: u32 = 4096;

fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4(),
        SocketAddr::V6(_) => TcpSocket::new_v6(),
    }?;
    // As in `TcpListener::bind`: the server may restart while connections of its predecessor are
    // still closing.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(LISTEN_BACKLOG)
}

async fn serve_until_stopped(config: Config) -> anyhow::Result<Ended> {
    let mut signals = StopSignals::listen().context("cannot listen for signals to stop")?;
    let listener = listen(config.listen).with_context(|| format!("cannot listen on {}", config.listen))?;
    let mut server = serve(config, listener).await?;
    tokio::select! {
        ready = server.ready() => ready?,
        // Packs may still be loading.
        () = signals.next() => return Ok(Ended { code: 0, is_idle: false }),
    }
    if let Err(error) = say(&greeting(&server)) {
        tracing::warn!("{error:#}");
    }
    tokio::select! {
        () = signals.next() => {}
        () = reload_at_hangup(&server) => {}
    }
    tracing::info!("stopping: requests in flight may finish; a second signal ends the server without them");
    let service = server.service().clone();
    let stopped = server.shut_down_unless(signals.next()).await;
    if stopped == Stopped::Forced {
        tracing::warn!("stopped again: not waiting for requests in flight and the store");
    }
    // The shutdown has waited for the workers.
    let workers_ended = service.end_workers(Instant::now());
    Ok(Ended {
        code: match stopped {
            Stopped::Clean => 0,
            Stopped::Lost => FAILED,
            Stopped::Forced => FORCED,
            Stopped::Unkept => UNKEPT,
        },
        is_idle: workers_ended && matches!(stopped, Stopped::Clean | Stopped::Lost),
    })
}

/// Reads files again at each SIGHUP. If there are no such files, the signal ends the process, as
/// when a terminal is closed.
#[cfg_attr(not(unix), allow(unused_variables, reason = "there is no such signal"))]
async fn reload_at_hangup(server: &ServerHandle) {
    #[cfg(unix)]
    if server.reloads() {
        use tokio::signal::unix::{SignalKind, signal};
        match signal(SignalKind::hangup()) {
            Ok(mut hangups) => {
                while hangups.recv().await.is_some() {
                    server.reload();
                }
            }
            Err(error) => tracing::warn!(%error, "cannot listen for SIGHUP"),
        }
    }
    std::future::pending().await
}

fn greeting(server: &ServerHandle) -> String {
    let address = server.address();
    let scheme = if server.speaks_tls() { "https" } else { "http" };
    let packs = server
        .service()
        .list_packs()
        .map(|list| list.packs)
        .unwrap_or_default();
    let packs = packs.iter().map(|pack| {
        let default = if pack.is_default { " (default)" } else { "" };
        let (name, version, joints) = (&pack.name, &pack.version, pack.joints.len());
        format!(
            "  pack {name} {version}{default}: {joints} joints, {}\n",
            pack.licence
        )
    });
    let packs: String = packs.collect();
    // A source checkout has a clip to try, and its client must be built first.
    let (troupe, clip) = if Path::new("examples/walk.bvh").exists() {
        (
            "cargo run --release -p troupe-cli --",
            "--clip examples/walk.bvh --from 30 --to 65 --out filled.glb",
        )
    } else {
        ("troupe", "--clip FILE.bvh --from FRAME --to FRAME --out OUT.glb")
    };
    let (key, bearer) = match (server.one_time_key(), server.asks_for_keys()) {
        (Some(key), _) => (
            format!("  export TROUPE_KEY={key}\n"),
            " -H \"authorization: Bearer $TROUPE_KEY\"",
        ),
        (None, true) => (String::new(), " -H \"authorization: Bearer $TROUPE_KEY\""),
        (None, false) => (String::new(), ""),
    };
    // The client uses this address by default.
    let server = match (address.ip().is_loopback(), address.port()) {
        (true, 8080) if scheme == "http" => String::new(),
        _ => format!(" --server {scheme}://{address}"),
    };
    format!(
        "Troupe serves gRPC and HTTP on {scheme}://{address}\n\
         Open {scheme}://{address}/ in a browser to see a crowd walk\n\
         {packs}\
         Try next:\n\
         {key}  \
           curl {scheme}://{address}/v1/packs{bearer}\n  \
           {troupe}{server} drive\n  \
           {troupe}{server} inbetween {clip}\n  \
           {scheme}://{address}/docs/ in a browser, for the documentation\n  \
           {scheme}://{address}/metrics, for Prometheus\n"
    )
}

/// Ctrl-C, and SIGTERM on Unix. The listeners exist from the start, so no signal between two waits
/// is lost.
struct StopSignals {
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    #[cfg(windows)]
    interrupt: tokio::signal::windows::CtrlC,
}

impl StopSignals {
    #[cfg(unix)]
    fn listen() -> io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
        })
    }

    #[cfg(windows)]
    fn listen() -> io::Result<Self> {
        let interrupt = tokio::signal::windows::ctrl_c()?;
        Ok(Self { interrupt })
    }

    /// Waits for the next signal.
    async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
        #[cfg(windows)]
        let _ = self.interrupt.recv().await;
    }
}
