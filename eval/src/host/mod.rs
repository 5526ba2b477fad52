//! Measurements that start, stop and kill a server of their own: the release build, with default
//! limits and the human pack.

pub(crate) mod attacks;
pub(crate) mod churn;
pub(crate) mod costs;
mod program;
pub(crate) mod restart;
pub(crate) mod viewers;

use std::path::PathBuf;

use clap::Args;
use glam::Vec3;
use troupe_cli::{Failure, Reading, read_clip_on};
use troupe_client::{InBetween, Locomotion, Pack};

use self::program::{Home, repository};

/// Which server to start.
#[derive(Debug, Args)]
pub(crate) struct ServerBinary {
    /// Binary of the server. Default: that of the release build.
    #[arg(long, value_name = "FILE")]
    server: Option<PathBuf>,
}

impl ServerBinary {
    fn home(&self) -> std::io::Result<Home> {
        Home::new(self.server.as_deref())
    }
}

/// A request for 64 frames of the walk in `examples/`.
fn gap(pack: &Pack) -> Result<InBetween, Failure> {
    let file = repository().join("examples/walk.bvh");
    let clip = read_clip_on(&file, pack.skeleton(), &Reading::default(), None)
        .map_err(|why| Failure::file(&file, why))?;
    Ok(InBetween::from_clip(&clip, 3, 63)?)
}

/// Speed of characters that turn now and then, m/s.
const SPEED_MPS: f32 = 1.2;
/// Turn between two commands, radians.
const TURN: f32 = 0.7;

/// The command of character `nth` of `count` after a time, if each gets a new heading every
/// `every_s` seconds. The moments are spread evenly over the characters.
fn turning_walk((nth, count): (usize, usize), since_s: f32, every_s: f32) -> Locomotion {
    let turns = (since_s / every_s + nth as f32 / count as f32).floor();
    let heading = TURN * turns + nth as f32;
    Locomotion::walk(Vec3::new(heading.sin(), 0.0, heading.cos()) * SPEED_MPS)
}
