//! Drives Unitree G1 robots that run SONIC's deployed controller
//! (`NVlabs/GR00T-WholeBodyControl`), from live sessions on a Troupe server, over ZeroMQ.
//!
//! A [`Bridge`] opens a session and a port for each robot. Three parts work at the same time:
//!
//! - a clock in a thread of its own, which sends each robot a window of the coming second, fifty
//!   times a second, and lets it stand if the server is late;
//! - a task a robot, which steps its session a little ahead of the clock, and looks at its future;
//! - a task a robot, which reads what the robot says of itself.
//!
//! ```no_run
//! use troupe_client::Client;
//! use troupe_sonic::{Bridge, Line, Robot};
//!
//! # async fn example() -> Result<(), Box<dyn std::error::Error>> {
//! let client = Client::connect("http://127.0.0.1:8080").await?;
//! let pack = client.pack("g1").await?;
//! let bridge = Bridge::open(&client, &pack, &[Robot::one()]).await?;
//! for line in ["start", "walk 0.8 0"] {
//!     if let Some(Line::Robots(names, order)) = Line::parse(line)? {
//!         bridge.give(&names, &order)?;
//!     }
//! }
//! # Ok(())
//! # }
//! ```

mod ahead;
mod bridge;
mod error;
mod feedback;
mod follower;
mod jitter;
mod note;
mod order;
mod playback;
mod publisher;
mod robots;
mod row;
mod sender;
mod waiting;
mod wire;
mod zmtp;

pub use self::bridge::{Bridge, Report};
pub use self::error::SonicError;
pub use self::feedback::Feedback;
pub use self::jitter::Jitter;
pub use self::note::Note;
pub use self::order::{FORMS, Line, Move, Order};
pub use self::robots::{PORT, Robot};
pub use self::sender::{Fastest, Why};
