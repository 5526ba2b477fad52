//! Measurements: answers and their latencies, the server's metrics, and the resources of this
//! process.

mod latencies;
mod live;
mod process;
mod prometheus;
mod recorder;
mod scraper;
mod split;
mod tally;

pub use latencies::{Latencies, LatenciesError};
pub use live::{LiveHarvest, Performances, PlanStats};
pub use process::{OwnLook, OwnUse, ProcessWatch};
pub use prometheus::Metrics;
pub use recorder::{Clock, Pulse, Recorder};
pub use scraper::{Scrape, Scraper, Scrapes, sampling_times};
pub use split::{ServerTiming, TimingSums};
pub use tally::{Answer, Call, Done, FineBin, Harvest, Outcome, Second, Tally};
