//! Measurements that run the networks of a pack in this process, without a server.

pub(crate) mod bodies;
mod clock;
mod crowd;
pub(crate) mod objects;
mod paths;
pub(crate) mod raw_loop;
pub(crate) mod seeds;
pub(crate) mod sides;
pub(crate) mod starts;
pub(crate) mod turns;
pub(crate) mod unimogen;
pub(crate) mod vermo;

use std::path::PathBuf;

use clap::Args;
use troupe_engine::EngineKind;
use troupe_engine::gpu::GpuShare;
use troupe_engine::onnx::{Growth, SessionOptions};

use self::crowd::LocalCrowd;
use crate::clips::BvhFolder;

/// Characters to play, and clips to compare them with.
#[derive(Debug, Args)]
pub(crate) struct Played {
    /// Folder of the pack.
    #[arg(long, default_value = "models/human", value_name = "FOLDER")]
    pack: PathBuf,
    /// Folder of the clips. Without it only the characters are measured.
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// File with the names of the clips to use, one a line. Default: every clip of the folder.
    #[arg(long, value_name = "FILE", requires = "data")]
    split: Option<PathBuf>,
    /// Styles. Default: every style of the pack that walks.
    #[arg(long, value_name = "STYLE,..", value_delimiter = ',')]
    styles: Vec<String>,
    /// Frames from a command to its plan's first frame, at most.
    #[arg(long, default_value_t = 4, value_name = "FRAMES")]
    look_ahead: u32,
    /// Seed of all characters.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Also print the figures of each run.
    #[arg(long)]
    each: bool,
}

impl Played {
    /// The characters, and the clips if a folder of them was given.
    fn load(&self) -> anyhow::Result<(LocalCrowd, Option<BvhFolder>)> {
        let crowd = LocalCrowd::load(self)?;
        let clips = self
            .data
            .as_deref()
            .map(|folder| BvhFolder::list(folder, self.split.as_deref(), crowd.skeleton()));
        Ok((crowd, clips.transpose()?))
    }
}

/// A session on one thread of the CPU, in f32.
fn one_thread(growth: Growth) -> SessionOptions {
    SessionOptions {
        engine: EngineKind::Cpu,
        threads: 1,
        spin: false,
        fixed_shapes: false,
        growth,
        gpu: GpuShare::default(),
    }
}
