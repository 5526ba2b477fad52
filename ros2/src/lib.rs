//! A ROS 2 node whose robots move by live sessions on a Troupe server.
//!
//! Each robot is a namespace: `joint_states` and `/tf` go out, `cmd_vel`, `path`, `say` and `style`
//! come in. Pure parts decide what these mean (`steering`, `body`). `ports` is the node, and
//! `driver` the task that has the session.

mod body;
mod command;
mod driver;
mod error;
mod inbox;
mod log;
mod messages;
mod output;
mod ports;
mod robots;
mod steering;

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::time::Duration;

use ros2_client::dds::rustdds::DomainParticipantBuilder;
use ros2_client::{Context, CreateError};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::sleep;
use troupe_client::live::Session;
use troupe_client::{Client, ClientError, ConnectOptions, Rate};

use self::body::Body;
pub use self::command::main;
use self::driver::{Driver, Link};
use self::error::Ros2Error;
use self::inbox::Inbox;
use self::output::Output;
use self::ports::{Parameters, Ports};
use self::robots::Robot;

/// Pause before the next try to reach a server that is not there yet.
const PAUSE: Duration = Duration::from_secs(1);

/// What a node is to do.
#[derive(Debug)]
pub(crate) struct Options {
    /// Address of the server.
    pub(crate) server: String,
    /// How to connect to it.
    pub(crate) connect: ConnectOptions,
    /// Poses a second.
    pub(crate) rate: Rate,
    /// Whether stamps come from `/clock` at first.
    pub(crate) use_sim_time: bool,
    /// Domain of DDS, 0 to 232.
    pub(crate) domain: u16,
    /// Whether to stay on this machine.
    pub(crate) is_local: bool,
    /// The robots, which [`check`] finds right.
    pub(crate) robots: Vec<Robot>,
}

/// Runs the node until `stop` is ready.
///
/// # Errors
/// See [`Ros2Error`]. A server that is lost later is no error.
pub(crate) async fn run(options: Options, stop: impl Future<Output = ()>) -> Result<(), Ros2Error> {
    let mut stop = std::pin::pin!(stop);
    let client = tokio::select! {
        client = connect(&options) => client?,
        () = &mut stop => return Ok(()),
    };
    let context = join(&options)?;
    let (end, ends) = watch::channel(false);
    let mut drivers = JoinSet::new();
    for (nth, robot) in options.robots.iter().enumerate() {
        let opened = open(&options, &client, &context, (nth as u64, robot), ends.clone());
        let (driver, session) = tokio::select! {
            opened = opened => opened?,
            () = &mut stop => return Ok(()),
        };
        drivers.spawn(driver.run(session));
    }
    stop.await;
    // Drivers that are gone need no word.
    let _ = end.send(true);
    drivers.join_all().await;
    Ok(())
}

/// Connects to the server, and waits for one that is not there yet.
async fn connect(options: &Options) -> Result<Client, ClientError> {
    let mut noted = false;
    loop {
        match Client::connect_with(&options.server, options.connect.clone()).await {
            Err(error @ (ClientError::Unreachable { .. } | ClientError::TimedOut { .. })) => {
                if !std::mem::replace(&mut noted, true) {
                    tracing::warn!("{error}; waits for it");
                }
                sleep(PAUSE).await;
            }
            other => return other,
        }
    }
}

/// Joins the domain.
fn join(options: &Options) -> Result<Context, Ros2Error> {
    let mut participant = DomainParticipantBuilder::new(options.domain);
    if options.is_local {
        participant = participant.with_only_networks([Ipv4Addr::LOCALHOST]);
    }
    let participant = participant.build().map_err(CreateError::from)?;
    Ok(Context::from_domain_participant(participant)?)
}

/// Opens the session and the node of one robot.
async fn open(
    options: &Options,
    client: &Client,
    context: &Context,
    (seed, robot): (u64, &Robot),
    stop: watch::Receiver<bool>,
) -> Result<(Driver, Session), Ros2Error> {
    let fault = |error: ClientError| Ros2Error::Robot {
        robot: robot.name.clone(),
        error,
    };
    let pack = client.pack(&robot.pack).await.map_err(fault)?;
    let pack = pack.of_body(&robot.body).map_err(fault)?;
    let body = Body::of(&pack, &robot.name, &robot.joint_suffix).ok_or_else(|| no_robot(robot))?;
    let styles = client.styles(&pack).await.map_err(fault)?;
    let link = Link {
        client: client.clone(),
        pack,
        seed,
        style: robot.style.clone(),
    };
    let session = link.open(robot.start()).await.map_err(fault)?;
    let parameters = Parameters {
        server: options.server.clone(),
        rate_hz: options.rate.hz(),
        pack: robot.pack.clone(),
        body: robot.body.clone(),
        style: robot.style.clone(),
        use_sim_time: options.use_sim_time,
        styles: styles.styles.into_iter().map(|style| style.name).collect(),
    };
    let inbox = Arc::default();
    let ports = Ports::open(context, &robot.name, &parameters, &inbox)?;
    let driver = Driver {
        link,
        output: Output::new(ports, body, options.rate, robot.start()),
        inbox: Arc::<Inbox>::clone(&inbox),
        steering: Default::default(),
        stop,
    };
    Ok((driver, session))
}

fn no_robot(robot: &Robot) -> Ros2Error {
    Ros2Error::NoRobot {
        robot: robot.name.clone(),
        pack: robot.pack.clone(),
        body: match robot.body.as_str() {
            "" => String::new(),
            body => format!("/{body}"),
        },
    }
}
