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
    /// Address of the server, such as `http://127.0.0.1:8080`. Of the plain HTTP workload the whole
    /// address.
    pub server: String,
    /// Kind of load.
    pub workload: Workload,
    /// Time before measuring begins, seconds.
    pub warmup_s: f64,
    /// Measured time, seconds.
    pub measured_s: f64,
    /// Seed of all random choices.
    pub seed: u64,
    /// Connections to the server, of each process.
    pub connections: u32,
    /// Longest wait for one answer, seconds.
    pub timeout_s: f64,
    /// Processes that make the load together.
    pub processes: u32,
    /// Whether latencies are kept by tenths of a second too, which show how soon a server recovers.
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
        /// Protocol and form.
        protocol: Protocol,
        /// Contents.
        requests: Requests,
        /// Times of sending.
        load: Load,
    },
    /// Live characters on the server's clock.
    Drive(Live),
    /// Live characters on this client's clock.
    Step(Stepping),
    /// Open sessions without any call.
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
    /// gRPC InBetween.
    Grpc,
    /// POST /v1/inbetween, as JSON.
    Json,
    /// POST of bytes to any server, over HTTP/1.1.
    Http {
        /// Further headers.
        headers: Vec<(String, String)>,
    },
}

/// Contents of single requests.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Requests {
    /// A folder with prepared requests. The other fields do not count then.
    pub folder: Option<PathBuf>,
    /// A clip whose frames are the keyframes. None: a walk in this program.
    pub clip: Option<PathBuf>,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// Characters of a request.
    pub characters: u32,
    /// Frames of a character's segment.
    pub frames: u32,
    /// Sampling temperature, 0 to 2.
    pub temperature: f32,
    /// Different requests.
    pub variants: u32,
    /// One in this many answers is decoded and checked whole; 0 for none.
    pub verify_every: u32,
}

/// Times of single requests.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Load {
    /// An open loop.
    Open {
        /// Distribution over time.
        process: Process,
        /// Requests a second.
        stages: Stages,
        /// Most requests in flight of each process. Further requests are dropped and counted.
        max_in_flight: u32,
    },
    /// Clients that wait for their answers.
    Closed {
        /// Clients.
        stages: Stages,
        /// Time from an answer to the next request, seconds.
        think_s: f64,
    },
}

/// Live characters that wander about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Live {
    /// Number of characters of all processes.
    pub characters: u32,
    /// Streams that they share, or groups that are stepped together.
    pub streams: u32,
    /// Frames a second: 30, 50 or 60.
    pub rate_hz: u32,
    /// 16-bit rotations instead of 32-bit floats.
    pub compact: bool,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// Names of styles. Empty: all styles of the pack that go anywhere.
    pub styles: Vec<String>,
    /// Mean time between two commands of a character, seconds; 0 for one command at the start.
    pub command_every_s: f64,
    /// Frames from the cursor to the start of a new plan. None: the server's.
    pub look_ahead: Option<u32>,
    /// Whether priorities are spread evenly from 0 to 1. Else all have the server's default.
    #[serde(default)]
    pub spread_priorities: bool,
    /// Share of the characters that act out sentences, 0 to 1.
    #[serde(default)]
    pub performers: f64,
    /// One in this many ticks is decoded and checked whole; 0 for none.
    pub verify_every: u32,
}

/// Live characters that are stepped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stepping {
    /// Characters, and how they live.
    #[serde(flatten)]
    pub live: Live,
    /// Whether a step is due with every frame, as in a game. Else the next step follows at once.
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

    /// Longest wait for one answer.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s)
    }

    /// Stages of the measured time, if it has several.
    pub fn stages(&self) -> Option<&Stages> {
        match &self.workload {
            Workload::Calls {
                load: Load::Open { stages, .. } | Load::Closed { stages, .. },
                ..
            } => Some(stages),
            _ => None,
        }
    }

    /// The address of the server for `/metrics`. None for a server that is not Troupe.
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
    /// The meaning as a sentence.
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

/// The part of a load that one of several processes makes.
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

    /// This process' part of a number. Parts differ by at most one, and add up.
    pub fn part(self, whole: u32) -> u32 {
        whole / self.of + u32::from(self.nth < whole % self.of)
    }

    /// The parts of all processes before this one, summed.
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
