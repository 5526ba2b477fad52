//! A connection to one Redis, or to a cluster.

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

use redis::cluster::{ClusterClient, ClusterConnection, cluster_pipe};
use redis::{Arg, Client, Cmd, Connection, ConnectionInfo, IntoConnectionInfo as _, RedisError, Value, pipe};

use super::super::RecordsError;
use super::script::{Answer, read};

/// Longest time to connect. Within a data centre it takes milliseconds.
const CONNECT: Duration = Duration::from_secs(1);
/// Longest time for an answer: a round of 16 MiB takes a tenth of it at 1 Gbit/s.
const ANSWER: Duration = Duration::from_secs(2);
/// Time after a failure in which calls fail at once, so that those that wait for each other do not
/// add up their timeouts.
const PAUSE: Duration = Duration::from_millis(500);
/// Most commands, and about the most bytes, that are sent before their answers are read.
const COMMANDS: usize = 256;
const BYTES: usize = 4 << 20;

/// The address of a store that servers share: `redis://` or, with TLS, `rediss://`.
#[derive(Clone, PartialEq, Eq)]
pub struct Place {
    /// With user and password.
    urls: Vec<String>,
    /// Without them.
    shown: String,
}

impl Place {
    /// Whether the text looks like the address of a shared store, and not like a folder.
    pub fn is_one(text: &str) -> bool {
        text.starts_with("redis://") || text.starts_with("rediss://")
    }

    fn nodes(&self) -> Result<Vec<ConnectionInfo>, RedisError> {
        self.urls
            .iter()
            .map(|url| url.as_str().into_connection_info())
            .collect()
    }

    fn has_tls(&self) -> bool {
        self.shown.starts_with("rediss:")
    }
}

/// The form of an address, for errors.
const FORM: &str = "redis://[USER][:PASSWORD@]HOST[:PORT][/NUMBER], rediss:// for TLS, and HOST:PORT,HOST:PORT for a cluster, \
     which has no number";

impl FromStr for Place {
    type Err = RecordsError;

    /// Reads `redis://user:password@host:port/number`, or several hosts of a cluster with commas
    /// between them.
    fn from_str(text: &str) -> Result<Self, RecordsError> {
        let (scheme, rest) = text.split_once("://").unwrap_or(("", text));
        let (user, rest) = rest
            .rsplit_once('@')
            .map_or(("", rest), |(user, rest)| (user, rest));
        let (hosts, number) = rest.split_once('/').unwrap_or((rest, ""));
        let shown = format!("{scheme}://{hosts}");
        let wrong = || RecordsError::Address {
            found: shown.clone(),
            allowed: FORM,
        };
        let is_cluster = hosts.contains(',');
        let is_number = number.chars().all(|digit| digit.is_ascii_digit()) && number.len() <= 5;
        if !Self::is_one(text) || !is_number || (is_cluster && !number.is_empty()) {
            return Err(wrong());
        }
        let at = if user.is_empty() { "" } else { "@" };
        let urls: Vec<String> = (hosts.split(','))
            .map(|host| format!("{scheme}://{user}{at}{host}/{number}"))
            .collect();
        let place = Self {
            urls,
            shown: shown.clone(),
        };
        let is_host = hosts
            .split(',')
            .all(|host| !host.is_empty() && !host.starts_with(':'));
        match place.nodes() {
            Ok(_) if is_host => Ok(place),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

enum Open {
    One(Box<Connection>),
    Cluster(Box<ClusterConnection>),
}

/// A connection that opens itself, and is closed after an error: what still comes on it would be
/// the answer to another question.
pub(super) struct Link {
    place: Place,
    open: Option<Open>,
    failed: Option<(Instant, RedisError)>,
}

impl fmt::Debug for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Link").field("place", &self.place).finish()
    }
}

impl Link {
    pub(super) fn new(place: Place) -> Self {
        Self {
            place,
            open: None,
            failed: None,
        }
    }

    /// Runs scripts about leases, and gives their answers in the same order. After an error any of
    /// them may have run. This blocks.
    pub(super) fn run(&mut self, scripts: Vec<Cmd>) -> Result<Vec<Answer>, RecordsError> {
        let values = self.ask(scripts)?;
        let answers = values.into_iter().map(|value| self.read(value, read));
        answers.collect()
    }

    /// Reads an answer. After one that cannot be read, the next call connects again.
    pub(super) fn read<T>(
        &mut self,
        value: Value,
        read: impl FnOnce(Value) -> Result<T, RedisError>,
    ) -> Result<T, RecordsError> {
        read(value).map_err(|error| {
            self.open = None;
            self.unreachable(error)
        })
    }

    /// Runs commands, and gives their answers in the same order. After an error any of them may
    /// have run. This blocks.
    pub(super) fn ask(&mut self, commands: Vec<Cmd>) -> Result<Vec<Value>, RecordsError> {
        if commands.is_empty() {
            return Ok(Vec::new());
        }
        if let Some((at, error)) = &self.failed
            && at.elapsed() < PAUSE
        {
            return Err(self.unreachable(error.clone()));
        }
        let was_open = self.open.is_some();
        let mut result = self.try_ask(&commands);
        // Redis, or a proxy before it, may have closed an idle connection.
        if was_open && result.as_ref().is_err_and(|error| !error.is_timeout()) {
            self.open = None;
            result = self.try_ask(&commands);
        }
        match result {
            Ok(answers) => {
                self.failed = None;
                Ok(answers)
            }
            Err(error) => {
                self.open = None;
                self.failed = Some((Instant::now(), error.clone()));
                Err(self.unreachable(error))
            }
        }
    }

    fn unreachable(&self, error: RedisError) -> RecordsError {
        RecordsError::Shared {
            place: self.place.to_string(),
            error: Box::new(error),
        }
    }

    fn try_ask(&mut self, commands: &[Cmd]) -> Result<Vec<Value>, RedisError> {
        let open = match self.open.take() {
            Some(open) => open,
            None => connect(&self.place)?,
        };
        let open = self.open.insert(open);
        let mut answers = Vec::with_capacity(commands.len());
        let mut rest = commands;
        while !rest.is_empty() {
            let (part, later) = rest.split_at(fitting(rest));
            answers.extend(send(open, part)?);
            rest = later;
        }
        Ok(answers)
    }
}

/// How many of the first scripts are sent together, at least one.
fn fitting(scripts: &[Cmd]) -> usize {
    let mut bytes = 0;
    let fits = scripts.iter().take(COMMANDS).take_while(|script| {
        let has_room = bytes < BYTES;
        bytes += size(script);
        has_room
    });
    fits.count()
}

fn size(script: &Cmd) -> usize {
    let sizes = script.args_iter().map(|arg| match arg {
        Arg::Simple(bytes) => bytes.len(),
        _ => 0,
    });
    sizes.sum()
}

/// Sends scripts together, and reads their answers.
fn send(open: &mut Open, scripts: &[Cmd]) -> Result<Vec<Value>, RedisError> {
    match open {
        Open::One(one) => {
            let mut pipe = pipe();
            for script in scripts {
                pipe.add_command(script.clone());
            }
            pipe.query(&mut **one)
        }
        Open::Cluster(cluster) => {
            let mut pipe = cluster_pipe();
            for script in scripts {
                pipe.add_command(script.clone());
            }
            pipe.query(cluster)
        }
    }
}

fn connect(place: &Place) -> Result<Open, RedisError> {
    if place.has_tls() {
        // The only error is that the process has a provider already.
        let _ = rustls::crypto::ring::default_provider().install_default();
    }
    let mut nodes = place.nodes()?;
    if nodes.len() > 1 {
        let client = ClusterClient::builder(nodes)
            .connection_timeout(CONNECT)
            .response_timeout(ANSWER)
            .retries(1)
            .build()?;
        let cluster = client.get_connection()?;
        cluster.set_write_timeout(Some(ANSWER))?;
        return Ok(Open::Cluster(Box::new(cluster)));
    }
    let Some(node) = nodes.pop() else {
        return Err(RedisError::from((
            redis::ErrorKind::InvalidClientConfig,
            "no host",
        )));
    };
    let one = Client::open(node)?.get_connection_with_timeout(CONNECT)?;
    one.set_read_timeout(Some(ANSWER))?;
    one.set_write_timeout(Some(ANSWER))?;
    Ok(Open::One(Box::new(one)))
}
