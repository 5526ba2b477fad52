//! `troupe sessions`.

use comfy_table::{Cell, Table};
use serde_json::{Value, json};
use troupe_proto::v1;

use super::failure::Failure;
use super::live_args::{Sessions, SessionsCommand};
use super::packs::table;
use super::{Session, print};

pub(super) async fn run(session: &Session, command: &Sessions) -> Result<(), Failure> {
    let client = session.connect().await?;
    match &command.command {
        Some(SessionsCommand::Close { ids, all }) => {
            let ids = if *all {
                let open = client.list_sessions().await?;
                open.into_iter().map(|s| s.id).collect()
            } else {
                ids.clone()
            };
            let closed = client.close_sessions(ids).await?;
            session.term.note(format_args!("{closed} closed"));
            Ok(())
        }
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
            v1::Clock::Free => "nobody",
            v1::Clock::Step => "a step",
            v1::Clock::Drive => "a stream",
        };
        table.add_row([
            Cell::new(&of.id),
            Cell::new(&of.pack),
            Cell::new(&of.style),
            Cell::new(format!("{:.1} s", of.frame as f64 / 30.0)),
            Cell::new(format!("{:.1} {:.1} {:.1}", place.x, place.y, place.z)),
            Cell::new(format!("{:.2} m/s", of.speed)),
            Cell::new(clock),
            Cell::new(format!("{:.0} s", f64::from(of.expires_in_ms) / 1e3)),
            Cell::new(plans(&stats)),
            Cell::new(stats.late_plans),
            Cell::new(stats.underruns),
        ]);
    }
    table
}

/// Plans that took over, whatever called for them.
pub(super) fn plans(stats: &v1::SessionStats) -> u64 {
    stats.plans_for_command + stats.plans_for_low_buffer + stats.plans_for_interval + stats.plans_for_object
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_tells_who_advances_it_and_how_it_went() {
        let session = v1::Session {
            id: "guard".to_owned(),
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
        for told in ["guard", "1.5 s", "1.30 m/s", "a stream", "60 s", "7", "1"] {
            assert!(row.contains(told), "{told}: {row}");
        }
    }
}
