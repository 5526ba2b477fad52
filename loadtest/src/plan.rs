//! The plan of a load test. It is in the report, and every process gets it.

use std::path::PathBuf;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::access::Access;
use crate::arrivals::{Process, Stages};

/// The plan of a load test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plan {
    /// Address of the server, such as `http://127.0.0.1:8080`. For the plain HTTP workload, the
    /// full URL.
    pub server: String,
    /// Kind of load.
    pub workload: Workload,
    /// Time before measuring begins, seconds.
    pub warmup_s: f64,
    /// Measured time, seconds.
    pub measured_s: f64,
    /// Seed of all random choices.
    pub seed: u64,
    /// Connections to the server per process.
    pub connections: u32,
    /// Maximum wait for one answer, seconds.
    pub timeout_s: f64,
    /// Number of processes that share the load.
    pub processes: u32,
    /// Whether latencies are recorded by tenths of a second too, to measure recovery.
    #[serde(default)]
    pub fine: bool,
    /// Key and certificates. Reports do not contain them.
    #[serde(skip)]
    pub access: Access,
}

/// A kind of load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Workload {
    /// Single requests.
    Calls {
        /// Protocol and encoding of the requests.
        protocol: Protocol,
        /// Contents of the requests.
        requests: Requests,
        /// When requests are sent.
        load: Load,
    },
    /// Live characters on the server's clock.
    Drive(Live),
    /// Live characters on this client's clock.
    Step(Stepping),
    /// Open sessions without any calls.
    Idle {
        /// Number of sessions.
        characters: u32,
        /// Name of the pack. Empty: the server's default pack.
        pack: String,
    },
}

/// Protocol of single requests.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Protocol {
    /// `InBetween` over gRPC.
    Grpc,
    /// `POST /v1/inbetween` as JSON.
    Json,
    /// POST requests with prepared bytes to any server, over HTTP/1.1.
    Http {
        /// Additional headers.
        headers: Vec<(String, String)>,
    },
}

/// Contents of single requests.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Requests {
    /// A folder with prepared requests. If given, the fields below except `verify_every` have no
    /// effect.
    pub folder: Option<PathBuf>,
    /// A clip from which keyframes are taken. None: a built-in walk.
    pub clip: Option<PathBuf>,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// Number of characters in a request.
    pub characters: u32,
    /// Frames of a character's segment, context and target included.
    pub frames: u32,
    /// Sampling temperature, 0 to 2.
    pub temperature: f32,
    /// Number of different requests, which are sent in turn.
    pub variants: u32,
    /// One in this many answers is fully decoded and checked; 0 for none.
    pub verify_every: u32,
}

/// When single requests are sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Load {
    /// An open loop: requests are sent at fixed times.
    Open {
        /// Distribution over time.
        process: Process,
        /// Requests a second.
        stages: Stages,
        /// Maximum number of requests in flight per process. Further requests are dropped and
        /// counted.
        max_in_flight: u32,
    },
    /// A closed loop: clients wait for their answers.
    Closed {
        /// Number of clients.
        stages: Stages,
        /// Time from an answer to the next request, seconds.
        think_s: f64,
    },
}

/// Live characters that wander about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Live {
    /// Number of characters of all processes together.
    pub characters: u32,
    /// Number of streams that the characters share, or of groups that are stepped together.
    pub streams: u32,
    /// Frames a second: 30, 50 or 60.
    pub rate_hz: u32,
    /// Whether frames are compact instead of 32-bit floats.
    pub compact: bool,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// File of a character of the user's own, whose skeleton the characters wear. None: the pack's.
    #[serde(default)]
    pub skeleton: Option<PathBuf>,
    /// Names of styles. Empty: all styles of the pack that move from place to place.
    pub styles: Vec<String>,
    /// Mean time between two commands of a character, seconds; 0 for one command at the start.
    pub command_every_s: f64,
    /// Frames from the cursor to the start of a new plan. None: the server's default.
    pub look_ahead: Option<u32>,
    /// Whether priorities are spread evenly from 0 to 1. Otherwise all characters have the server's
    /// default.
    #[serde(default)]
    pub spread_priorities: bool,
    /// Share of the characters that act out sentences, 0 to 1.
    #[serde(default)]
    pub performers: f64,
    /// One in this many ticks is fully decoded and checked; 0 for none.
    pub verify_every: u32,
}

/// Live characters that are stepped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stepping {
    /// The characters.
    #[serde(flatten)]
    pub live: Live,
    /// Whether a step is due at the time of every frame, as in a game. Otherwise the next step
    /// follows at once.
    pub paced: bool,
}

impl Plan {
    /// Length of the warm-up.
    pub fn warmup(&self) -> Duration {
        Duration::from_secs_f64(self.warmup_s)
    }

    /// Length of the measured time.
    pub fn measured(&self) -> Duration {
        Duration::from_secs_f64(self.measured_s)
    }

    /// Maximum wait for one answer.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s)
    }

    /// Stages of the measured time. `None` for live characters.
    pub fn stages(&self) -> Option<&Stages> {
        match &self.workload {
            Workload::Calls {
                load: Load::Open { stages, .. } | Load::Closed { stages, .. },
                ..
            } => Some(stages),
            _ => None,
        }
    }

    /// The address of the server for `/metrics`. `None` for plain HTTP, which may go to any server.
    pub fn metrics_address(&self) -> Option<&str> {
        match &self.workload {
            Workload::Calls {
                protocol: Protocol::Http { .. },
                ..
            } => None,
            _ => Some(&self.server),
        }
    }
}

impl Workload {
    /// The meaning of a latency of this workload.
    pub fn latency_of(&self) -> LatencyOf {
        match self {
            Self::Calls { load, .. } => match load {
                Load::Open { .. } => LatencyOf::AnswerFromDue,
                Load::Closed { .. } => LatencyOf::AnswerFromSending,
            },
            Self::Drive(_) | Self::Idle { .. } => LatencyOf::TickFromDue,
            Self::Step(stepping) if stepping.paced => LatencyOf::StepFromDue,
            Self::Step(_) => LatencyOf::StepFromSending,
        }
    }
}

/// Start and end of a latency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LatencyOf {
    /// From the time at which a request was due to its answer: free of coordinated omission.
    AnswerFromDue,
    /// From the sending of a request to its answer.
    AnswerFromSending,
    /// From the time at which a tick of a stream was due to its arrival.
    TickFromDue,
    /// From the time at which a step was due to its frames.
    StepFromDue,
    /// From the sending of a step to its frames.
    StepFromSending,
}

impl LatencyOf {
    /// Start and end of the latency in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::AnswerFromDue => "from when a request was due to its answer",
            Self::AnswerFromSending => "from sending a request to its answer",
            Self::TickFromDue => "from when a tick was due to its arrival",
            Self::StepFromDue => "from when a step was due to its frames",
            Self::StepFromSending => "from asking for a step to its frames",
        }
    }
}

/// The part of a load that one of several processes runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Share {
    /// Index of the process, from 0.
    pub nth: u32,
    /// Number of processes.
    pub of: u32,
}

impl Share {
    /// The whole load.
    pub const WHOLE: Self = Self { nth: 0, of: 1 };

    /// This process' part of `whole`. The parts of all processes differ by at most 1, and their sum
    /// is `whole`.
    pub fn part(self, whole: u32) -> u32 {
        whole / self.of + u32::from(self.nth < whole % self.of)
    }

    /// The sum of the parts of all processes before this one.
    pub fn before(self, whole: u32) -> u32 {
        (0..self.nth).map(|nth| Self { nth, ..self }.part(whole)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up() {
        for whole in [0, 1, 7, 100] {
            let shares = (0..3).map(|nth| Share { nth, of: 3 });
            let parts = shares.clone().map(|s| s.part(whole)).collect::<Vec<_>>();
            assert_eq!(parts.iter().sum::<u32>(), whole);
            assert!(parts.iter().max().unwrap() - parts.iter().min().unwrap() <= 1);
            let before = shares.map(|s| s.before(whole)).collect::<Vec<_>>();
            assert_eq!(before, [0, parts[0], parts[0] + parts[1]]);
        }
    }
}
