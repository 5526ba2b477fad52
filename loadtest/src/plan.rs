//! What a load test does: written into its report, and given to every process that takes part.

use std::path::PathBuf;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::access::Access;
use crate::arrivals::{Process, Stages};

/// A load test, whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plan {
    /// Address of the server, such as `http://127.0.0.1:8080`; of the plain HTTP workload the whole
    /// address.
    pub server: String,
    /// What is asked.
    pub workload: Workload,
    /// Time before measuring begins, seconds.
    pub warmup_s: f64,
    /// Time that is measured, seconds.
    pub measured_s: f64,
    /// All random choices follow from it.
    pub seed: u64,
    /// Connections to the server, of each process.
    pub connections: u32,
    /// Longest wait for one answer, seconds.
    pub timeout_s: f64,
    /// Processes that make the load together.
    pub processes: u32,
    /// Latencies are kept by tenths of a second too, to tell how soon a server recovers.
    #[serde(default)]
    pub fine: bool,
    /// Key and certificates; no report has them.
    #[serde(skip)]
    pub access: Access,
}

/// What is asked of the server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Workload {
    /// Single requests.
    Calls {
        /// Over what, and in which form.
        protocol: Protocol,
        /// What they hold.
        requests: Requests,
        /// When they are sent.
        load: Load,
    },
    /// Live characters on the server's clock.
    Drive(Live),
    /// Live characters on this client's clock.
    Step(Stepping),
    /// Sessions that are open and of which nothing is wanted.
    Idle {
        /// How many.
        characters: u32,
        /// Name of the pack. Empty: the server's default pack.
        pack: String,
    },
}

/// How a single request travels.
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

/// What single requests hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Requests {
    /// A folder with requests that were made before; the rest is of no meaning then.
    pub folder: Option<PathBuf>,
    /// A clip whose frames are the keyframes. None: a walk that this program brings along.
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
    /// Each answer of so many is decoded and checked whole; 0: none.
    pub verify_every: u32,
}

/// When single requests are sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Load {
    /// Arrivals that wait for nobody.
    Open {
        /// How they lie in time.
        process: Process,
        /// Requests a second.
        stages: Stages,
        /// Most requests on their way at once, of each process; what is due beyond is dropped and
        /// counted.
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
    /// How many, all processes together.
    pub characters: u32,
    /// Streams that they share, or groups that are stepped together.
    pub streams: u32,
    /// Frames a second: 30, 50 or 60.
    pub rate_hz: u32,
    /// 16-bit rotations instead of 32-bit floats.
    pub compact: bool,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// Styles; none: all of the pack in which one can walk.
    pub styles: Vec<String>,
    /// Mean time between two commands of a character, seconds; 0: one command at the begin.
    pub command_every_s: f64,
    /// Frames between the cursor and the point where a new plan takes over. None: the server's.
    pub look_ahead: Option<u32>,
    /// Priorities are spread evenly from 0 to 1; else all have the server's default.
    #[serde(default)]
    pub spread_priorities: bool,
    /// Share of the characters that act out sentences, 0 to 1.
    #[serde(default)]
    pub performers: f64,
    /// Every tick of so many is decoded and checked whole; 0: none.
    pub verify_every: u32,
}

/// Live characters that are stepped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stepping {
    /// The characters.
    #[serde(flatten)]
    pub live: Live,
    /// A step is due with every frame, as in a game. Otherwise the next is asked for as soon as one
    /// is there.
    pub paced: bool,
}

impl Plan {
    /// The warm-up.
    pub fn warmup(&self) -> Duration {
        Duration::from_secs_f64(self.warmup_s)
    }

    /// The time that is measured.
    pub fn measured(&self) -> Duration {
        Duration::from_secs_f64(self.measured_s)
    }

    /// Longest wait for one answer.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s)
    }

    /// Stages of the measured time, where there are several.
    pub fn stages(&self) -> Option<&Stages> {
        match &self.workload {
            Workload::Calls {
                load: Load::Open { stages, .. } | Load::Closed { stages, .. },
                ..
            } => Some(stages),
            _ => None,
        }
    }

    /// The address whose `/metrics` tell of the server; none of a server that is not Troupe.
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
    /// What a latency of this workload is.
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

/// From when to when a latency counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LatencyOf {
    /// From the moment when a request was due until its answer was there: free of coordinated
    /// omission.
    AnswerFromDue,
    /// From sending a request until its answer was there.
    AnswerFromSending,
    /// From the moment when a stream's tick was due until it was there.
    TickFromDue,
    /// From the moment when a step was due until its frames were there.
    StepFromDue,
    /// From asking for a step until its frames were there.
    StepFromSending,
}

impl LatencyOf {
    /// In words.
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
    /// Which process this is, from 0.
    pub nth: u32,
    /// How many there are.
    pub of: u32,
}

impl Share {
    /// All of it.
    pub const WHOLE: Self = Self { nth: 0, of: 1 };

    /// This process' part of so many: parts differ by at most one and add up.
    pub fn part(self, whole: u32) -> u32 {
        whole / self.of + u32::from(self.nth < whole % self.of)
    }

    /// How many the processes before this one have of so many.
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
