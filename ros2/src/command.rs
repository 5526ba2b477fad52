//! The command: arguments, signals, and where notes go.

use std::error::Error;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;
use troupe_client::{ApiKey, ConnectOptions, Rate};

use crate::robots::{Fleet, Robot, check};
use crate::{Options, run};

/// Notes of this node, and warnings of the libraries; RUST_LOG decides otherwise. RustDDS warns of
/// each packet that it cannot send yet, and of the library's type for `/clock`. What goes to
/// `/rosout` is written once.
const NOTES: &str = "warn,troupe_ros2=info,ros2_client=error,ros2_client::rosout=off,rustdds=error,\
    rustdds::discovery::discovery_db=off";
/// Threads of the runtime. DDS has its own.
const THREADS: usize = 2;

/// A ROS 2 node whose robots move by live sessions on a Troupe server.
///
/// Each robot is a namespace. NAME/joint_states and /tf (odom -> NAME/pelvis) go out.
/// NAME/cmd_vel, NAME/path, NAME/say and NAME/style come in.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// TOML file of the robots: names, packs, bodies, styles, places.
    #[arg(value_name = "FILE", conflicts_with_all = ["robots", "style"])]
    file: Option<PathBuf>,

    /// A robot, as often as there are robots: NAME, NAME:PACK or NAME:PACK/BODY. Default: g1
    #[arg(long = "robot", value_name = "ROBOT")]
    robots: Vec<Robot>,

    /// First style of all robots. Default: the packs'
    #[arg(long, value_name = "NAME")]
    style: Option<String>,

    /// Address of the server. Default: the file's, or http://127.0.0.1:8080
    #[arg(long, env = "TROUPE_SERVER", value_name = "URL")]
    server: Option<String>,

    /// API key, if the server asks for one
    #[arg(long, env = "TROUPE_KEY", hide_env_values = true, value_name = "KEY")]
    key: Option<ApiKey>,

    /// Poses a second: 30, 50 or 60. Default: the file's, or 50
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,

    /// Take stamps from /clock
    #[arg(long)]
    use_sim_time: bool,

    /// Domain of DDS
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232), value_name = "ID")]
    domain: u16,
}

impl Arguments {
    fn options(self) -> Result<Options, String> {
        let fleet = match &self.file {
            Some(file) => {
                let name = file.display();
                let text = std::fs::read_to_string(file).map_err(|error| format!("{name}: {error}"))?;
                Fleet::parse(&text).map_err(|why| format!("{name}: {why}"))?
            }
            None => Fleet {
                robots: self.robots(),
                ..Fleet::default()
            },
        };
        check(&fleet.robots)?;
        let server = self.server.or(fleet.server);
        Ok(Options {
            server: server.unwrap_or_else(|| "http://127.0.0.1:8080".to_owned()),
            connect: ConnectOptions {
                key: self.key,
                ..ConnectOptions::default()
            },
            rate: rate(self.rate.or(fleet.rate).unwrap_or(50))?,
            use_sim_time: self.use_sim_time || fleet.use_sim_time.unwrap_or(false),
            domain: self.domain,
            is_local: is_local(|name| std::env::var(name).ok()),
            robots: fleet.robots,
        })
    }

    fn robots(&self) -> Vec<Robot> {
        let mut robots = match self.robots.as_slice() {
            [] => vec![Robot::g1()],
            robots => robots.to_vec(),
        };
        for robot in &mut robots {
            robot.style = self.style.clone().unwrap_or_default();
        }
        robots
    }
}

fn rate(hz: u32) -> Result<Rate, String> {
    match hz {
        30 => Ok(Rate::Hz30),
        50 => Ok(Rate::Hz50),
        60 => Ok(Rate::Hz60),
        other => Err(format!("rate is {other}; allowed: 30, 50, 60")),
    }
}

/// Whether ROS's variables of the environment keep nodes on this machine.
fn is_local(variable: impl Fn(&str) -> Option<String>) -> bool {
    variable("ROS_LOCALHOST_ONLY").as_deref() == Some("1")
        || variable("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref() == Some("LOCALHOST")
}

/// Runs the command.
pub fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(NOTES));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match node(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("troupe-ros2: {error}");
            ExitCode::FAILURE
        }
    }
}

fn node(arguments: Arguments) -> Result<(), Box<dyn Error>> {
    let options = arguments.options()?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(THREADS)
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // `ros2 launch` sends the first, and the second to a node that does not end.
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let stop = async move {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
        };
        Ok(run(options, stop).await?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(arguments: &[&str]) -> Result<Options, String> {
        let all = ["troupe-ros2"].iter().chain(arguments);
        Arguments::try_parse_from(all)
            .map_err(|error| error.to_string())?
            .options()
    }

    #[test]
    fn arguments_have_robots_and_defaults() {
        let all = options(&[
            "--server",
            "http://a:1",
            "--robot",
            "a",
            "--robot",
            "b:p/q",
            "--style",
            "slow",
        ]);
        let all = all.unwrap();
        assert_eq!((all.rate, all.use_sim_time), (Rate::Hz50, false));
        let named: Vec<_> = all
            .robots
            .iter()
            .map(|r| (&*r.name, &*r.body, &*r.style))
            .collect();
        assert_eq!(named, [("a", "", "slow"), ("b", "q", "slow")]);
        assert_eq!(options(&[]).unwrap().robots, [Robot::g1()]);
    }

    #[test]
    fn arguments_that_cannot_be_are_named() {
        for (arguments, wanted) in [
            (&["--rate", "25"][..], "rate is 25; allowed: 30, 50, 60"),
            (
                &["--robot", "a", "--robot", "a"],
                "two robots have the name \"a\"",
            ),
            (&["--robot", "a-b"], "name is \"a-b\""),
            (&["--domain", "233"], "0..=232"),
            (&["no-such.toml"], "no-such.toml: "),
        ] {
            let why = options(arguments).unwrap_err();
            assert!(why.contains(wanted), "{wanted}: {why}");
        }
    }

    #[test]
    fn variables_of_ros_keep_the_node_here() {
        let with = |name: &'static str, value: &'static str| {
            is_local(move |asked| (asked == name).then(|| value.to_owned()))
        };
        assert!(with("ROS_LOCALHOST_ONLY", "1"));
        assert!(with("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"));
        assert!(!with("ROS_LOCALHOST_ONLY", "0"));
        assert!(!with("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"));
    }
}
