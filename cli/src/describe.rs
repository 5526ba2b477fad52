//! `troupe describe`.

use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use troupe_client::{Describe as Motion, Describing, DescriptionPart};
use troupe_motion::clip::Clip;

use crate::context::Context;
use crate::failure::Failure;
use crate::files::read_clip;
use crate::output::print;
use crate::reading::Reading;

/// Put a clip into words.
///
/// For packs with the capability `describe`. The words are printed as they are found. A pack reads
/// some seconds at a time (`troupe packs` prints its longest segment). --from and --to name a part
/// of a longer clip.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe describe walk.bvh
  troupe describe walk.bvh --from 300 --to 500 --seed 3
  troupe describe horse.glb#Walk --json")]
pub(crate) struct Describe {
    /// Motion clip: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv or .npy. horse.glb#Walk
    /// names one animation of several.
    #[arg(value_name = "CLIP")]
    pub(crate) clip: PathBuf,

    /// First frame to describe.
    #[arg(long, default_value_t = 0, value_name = "FRAME")]
    pub(crate) from: usize,

    /// Last frame to describe. Default: the last of the clip.
    #[arg(long, value_name = "FRAME")]
    pub(crate) to: Option<usize>,

    /// Model pack. Default: the first that puts motion into words.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(crate) pack: String,

    /// The same seed, clip and pack give the same words.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) reading: Reading,

    /// Print words and notes as JSON, once all are found.
    #[arg(long)]
    pub(crate) json: bool,
}

pub(super) async fn run(context: &Context, command: &Describe) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_able("describe", &command.pack).await?;
    let clip = read_clip(&command.clip, &pack, &command.reading, &context.term)?;
    let clip = part(clip, command)?;
    let frames = clip.frames();
    let motion = Motion::new(clip).seed(command.seed);
    let asked = std::time::Instant::now();
    let describing = client.describe(&pack, &motion).await?;
    if !command.json {
        return print_as_found(context, describing).await;
    }
    let found = describing.whole().await?;
    let took_ms = asked.elapsed().as_secs_f64() * 1e3;
    print(&format!(
        "{:#}",
        json!({
            "text": found.text,
            "frames": frames,
            "pack": pack.name(),
            "pack_version": pack.description().version,
            "notes": found.notes,
            "took_ms": took_ms,
        })
    ))
}

/// The frames of a clip to describe.
fn part(clip: Clip, command: &Describe) -> Result<Clip, Failure> {
    let last = clip.frames().saturating_sub(1);
    let to = command.to.unwrap_or(last);
    if command.from > to || to > last {
        return Err(Failure::Input(format!(
            "frames {} to {to} are no part of the clip, whose frames are 0 to {last}",
            command.from
        )));
    }
    clip.slice(command.from..to + 1)
        .map_err(|e| Failure::file(&command.clip, e))
}

/// Prints words as they come.
async fn print_as_found(context: &Context, mut describing: Describing) -> Result<(), Failure> {
    while let Some(part) = describing.next().await? {
        if let DescriptionPart::Words(words) = part {
            write(&words)?;
        }
    }
    write("\n")?;
    for note in &describing.notes {
        context.term.note(format_args!("note: {note}"));
    }
    Ok(())
}

/// Writes at once. A reader that closes the pipe is no error.
fn write(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Other(format!("cannot print: {e}"))),
        _ => Ok(()),
    }
}
