//! `troupe bridge`: robots of other programs, driven from live sessions.

mod lines;
mod show;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use tokio::time::{Instant, interval, sleep_until};
use troupe_sonic::{Bridge as Robots, FORMS, Line, Robot, SonicError};

use self::lines::lines;
use self::show::Display;
use crate::context::Context;
use crate::failure::Failure;

/// Drive robots that run other programs' controllers, from live sessions.
#[derive(Debug, Args)]
pub(crate) struct Bridge {
    #[command(subcommand)]
    command: BridgeCommand,
}

#[derive(Debug, Subcommand)]
enum BridgeCommand {
    Sonic(Sonic),
}

/// Drive Unitree G1 robots that run SONIC's deployed controller, over ZeroMQ.
///
/// Each robot connects to a port of this machine and gets the coming second of its motion, fifty
/// times a second. It stands until an order comes. Orders are read from standard input, one a line.
/// If the server is lost or late, robots stand within a second, and go on with the next order.
#[derive(Debug, Args)]
#[command(after_long_help = format!("\
Orders, for the named robots or for all:
{FORMS}

Examples:
  troupe bridge sonic
  troupe bridge sonic examples/robots/two.toml
  (echo start; echo go; sleep 60; echo quit) | troupe bridge sonic robots.toml --json"))]
struct Sonic {
    /// TOML file of the robots: names, ports, routes. Default: one robot, on port 5556.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,

    /// Model pack of a G1.
    #[arg(long, default_value = "g1", value_name = "NAME")]
    pack: String,

    /// Print what was sent as JSON.
    #[arg(long)]
    json: bool,
}

impl From<SonicError> for Failure {
    fn from(error: SonicError) -> Self {
        match error {
            SonicError::Client(error) => Self::Client(error),
            SonicError::NoG1(_) | SonicError::Listen { .. } => Self::Input(error.to_string()),
            SonicError::Thread(_) => Self::Other(error.to_string()),
        }
    }
}

pub(crate) async fn run(context: &Context, command: &Bridge) -> Result<(), Failure> {
    let BridgeCommand::Sonic(command) = &command.command;
    let robots = match &command.file {
        Some(file) => {
            let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
            Robot::parse(&text).map_err(|why| Failure::file(file, why))?
        }
        None => vec![Robot::one()],
    };
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let mut bridge = Robots::open(&client, &pack, &robots).await?;
    let mut display = Display::new(context, &robots);
    obey(&mut bridge, &mut display).await;
    display.note("all stand");
    let reports = bridge.close().await;
    display.end(&reports, command.json)
}

/// Reads orders until one ends it, or Ctrl-C.
async fn obey(bridge: &mut Robots, display: &mut Display<'_>) {
    let mut lines = lines();
    let (mut reading, mut waits) = (true, Instant::now());
    let mut look = interval(Duration::from_secs(1));
    loop {
        tokio::select! {
            line = lines.recv(), if reading && waits <= Instant::now() => match line.map(|line| Line::parse(&line?)) {
                Some(Ok(Some(Line::Quit))) => return,
                Some(Ok(Some(Line::Wait(seconds)))) => waits = Instant::now() + Duration::from_secs_f32(seconds),
                Some(Ok(Some(Line::Robots(names, order)))) => {
                    if let Err(why) = bridge.give(&names, &order) {
                        display.note(why);
                    }
                }
                Some(Ok(None)) => {}
                Some(Err(why)) => display.note(why),
                // Without standard input the bridge runs until it is interrupted.
                None => reading = false,
            },
            () = sleep_until(waits), if waits > Instant::now() => {}
            Some(note) = bridge.note() => display.note(note),
            _ = look.tick() => display.show(&bridge.reports()),
            // Without signals it is ended by force.
            Ok(()) = tokio::signal::ctrl_c() => return,
        }
    }
}
