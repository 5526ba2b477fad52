//! `troupe sessions`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use comfy_table::{Cell, Table};
use serde_json::{Value, json};
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, table};
use crate::replay::save_recording;

/// List the open sessions of the server, close some, or fetch a recording.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_long_help = "\
Examples:
  troupe sessions
  troupe sessions --json | jq '.[].id'
  troupe sessions close guard-1 guard-2
  troupe sessions close --all
  troupe sessions recording guard-1 --out guard.jsonl"
)]
pub(crate) struct Sessions {
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,

    #[command(subcommand)]
    pub(crate) command: Option<SessionsCommand>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum SessionsCommand {
    /// Close sessions. Closing one that is gone is no error.
    Close {
        /// Their names.
        #[arg(required_unless_present = "all", value_name = "NAME")]
        ids: Vec<String>,

        /// All open sessions, also those of other clients.
        #[arg(long, conflicts_with = "ids")]
        all: bool,
    },
    /// Write the recording of a session to a file. The server keeps it for an hour after its end.
    Recording {
        /// Its name.
        #[arg(value_name = "NAME")]
        id: String,

        /// File to write to.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
}

pub(super) async fn run(context: &Context, command: &Sessions) -> Result<(), Failure> {
    let client = context.connect().await?;
    match &command.command {
        Some(SessionsCommand::Close { ids, all }) => {
            let ids = if *all {
                let open = client.list_sessions().await?;
                open.into_iter().map(|s| s.id).collect()
            } else {
                ids.clone()
            };
            let closed = client.close_sessions(ids).await?;
            context.term.note(format_args!("{closed} closed"));
            Ok(())
        }
        Some(SessionsCommand::Recording { id, out }) => save_recording(context, &client, id, out).await,
        None => {
            let open = client.list_sessions().await?;
            print(&if command.json {
                format!("{:#}", open.iter().map(to_json).collect::<Value>())
            } else {
                list(&open).to_string()
            })
        }
    }
}

fn to_json(session: &v1::Session) -> Value {
    serde_json::to_value(session).unwrap_or_else(|_| json!({ "id": session.id }))
}

fn list(sessions: &[v1::Session]) -> Table {
    let mut table = table();
    table.set_header([
        "session",
        "pack",
        "skeleton",
        "style",
        "time",
        "place",
        "speed",
        "advanced by",
        "expires in",
        "plans",
        "late",
        "underruns",
    ]);
    for of in sessions {
        let stats = of.stats.unwrap_or_default();
        let place = of.position.unwrap_or_default();
        let clock = match of.clock() {
            v1::Clock::Free => "–",
            v1::Clock::Step => "a step",
            v1::Clock::Drive => "a stream",
        };
        table.add_row([
            Cell::new(&of.id),
            Cell::new(&of.pack),
            Cell::new(match of.skeleton.as_str() {
                "" => "–",
                skeleton => skeleton,
            }),
            Cell::new(&of.style),
            Cell::new(format!("{:.1} s", of.frame as f64 / 30.0)),
            Cell::new(format!("{:.1} {:.1} {:.1}", place.x, place.y, place.z)),
            Cell::new(format!("{:.2} m/s", of.speed)),
            Cell::new(clock),
            Cell::new(format!("{:.0} s", f64::from(of.expires_in_ms) / 1e3)),
            Cell::new(stats.plans()),
            Cell::new(stats.late_plans),
            Cell::new(stats.underruns),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_tells_who_advances_it_and_how_it_went() {
        let session = v1::Session {
            id: "guard".to_owned(),
            skeleton: "hero".to_owned(),
            frame: 45,
            speed: 1.3,
            clock: v1::Clock::Drive.into(),
            expires_in_ms: 60_000,
            stats: Some(v1::SessionStats {
                plans_for_command: 2,
                plans_for_interval: 5,
                underruns: 1,
                ..v1::SessionStats::default()
            }),
            ..v1::Session::default()
        };
        let mut table = list(&[session]);
        table.set_width(200);
        let row = table.to_string();
        for wanted in ["guard", "hero", "1.5 s", "1.30 m/s", "a stream", "60 s", "7", "1"] {
            assert!(row.contains(wanted), "{wanted}: {row}");
        }
    }
}
