//! `troupe replay`, and files of recordings.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};
use troupe_client::Client;
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::output::print;

/// Play a recorded session again on the server, and compare its frames bit by bit.
///
/// A server records a session if it is asked to (`troupe drive --record FILE`, or `record` of a
/// new session) and the key may. The same pack, engine and server give the same frames.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe drive --path examples/paths/square.toml --record square.jsonl
  troupe sessions recording guard-1 --out guard.jsonl
  troupe replay guard.jsonl
  troupe replay guard.jsonl --anyway --json")]
pub(crate) struct Replay {
    /// Recording: lines of JSON.
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,

    /// Play it even if the server has another version, engine, pack, style or skeleton.
    #[arg(long)]
    pub(crate) anyway: bool,

    /// Print the result as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

pub(super) async fn run(context: &Context, command: &Replay) -> Result<(), Failure> {
    let text = std::fs::read_to_string(&command.file).map_err(|why| Failure::file(&command.file, why))?;
    // Lines that show a frame say how long it takes.
    let frames = text.lines().filter(|line| line.starts_with("{\"frame\"")).count();
    let client = context.connect().await?;
    let mut replaying = client.replay(text, command.anyway).await?;
    let bar = context.term.bar(frames, "frames");
    let mut result = v1::ReplayResponse::default();
    while let Some(part) = replaying.next().await? {
        bar.set_position(part.frames);
        result = part;
    }
    bar.finish_and_clear();
    print(&match command.json {
        true => format!("{:#}", to_json(&result)),
        false => in_words(&result),
    })?;
    match &result.difference {
        Some(difference) => Err(Failure::Other(format!(
            "the replay differs from frame {} on",
            difference.frame
        ))),
        None => Ok(()),
    }
}

fn to_json(result: &v1::ReplayResponse) -> Value {
    json!({
        "equal": result.equal,
        "frames": result.frames,
        "commands": result.commands,
        "underruns": result.underruns,
        "difference": result.difference.as_ref().map(|difference| json!({
            "frame": difference.frame,
            "field": difference.field,
            "message": difference.message,
        })),
        "notes": result.notes,
    })
}

fn in_words(result: &v1::ReplayResponse) -> String {
    let mut text = match &result.difference {
        None => format!(
            "equal: {} frames, {} commands, {} underruns",
            result.frames, result.commands, result.underruns
        ),
        Some(difference) => format!(
            "different: frame {}, {}: {}",
            difference.frame, difference.field, difference.message
        ),
    };
    for note in &result.notes {
        text.push_str("\nnote: ");
        text.push_str(note);
    }
    text
}

/// Fetches the recording of a session and writes it to a file.
pub(crate) async fn save_recording(
    context: &Context,
    client: &Client,
    session: &str,
    out: &Path,
) -> Result<(), Failure> {
    let recording = client.recording_of(session).await?;
    std::fs::write(out, &recording.lines).map_err(|why| Failure::output(out, why))?;
    let lines = recording.lines.lines().count();
    context
        .term
        .note(format_args!("{lines} lines written to {}", out.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_result_names_the_first_frame_and_field_that_differ() {
        let equal = v1::ReplayResponse {
            frames: 90,
            is_last: true,
            equal: true,
            commands: 10,
            underruns: 1,
            notes: vec!["the recording ends at frame 90 because the session ended".to_owned()],
            ..v1::ReplayResponse::default()
        };
        assert_eq!(
            in_words(&equal),
            "equal: 90 frames, 10 commands, 1 underruns\n\
             note: the recording ends at frame 90 because the session ended"
        );
        let different = v1::ReplayResponse {
            equal: false,
            difference: Some(v1::ReplayDifference {
                frame: 41,
                field: "root".to_owned(),
                message: "frame 41 differs in its root, after 40 equal frames".to_owned(),
            }),
            notes: Vec::new(),
            ..equal
        };
        assert_eq!(
            in_words(&different),
            "different: frame 41, root: frame 41 differs in its root, after 40 equal frames"
        );
        assert_eq!(to_json(&different)["difference"]["field"], "root");
    }
}
