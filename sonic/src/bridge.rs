//! The parts of a bridge, and what its owner asks of them.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::AbortHandle;
use tokio::time::sleep;
use troupe_client::{Client, Pack};
use troupe_motion::robot::{Hinge, Robot as Hinges};

use crate::error::SonicError;
use crate::feedback::{self, Feedback};
use crate::follower::Follower;
use crate::jitter::Jitter;
use crate::note::{Note, NoteReader, notes};
use crate::order::{Move, Order};
use crate::publisher::Publisher;
use crate::robots::Robot;
use crate::row::check_robot;
use crate::sender::{self, Fastest, Progress, Station, WORDS, Why, Word, look};
use crate::waiting::Waiting;
use crate::wire::{Command, Window};

/// Until a robot stands, after a stop.
const STOP: Duration = Duration::from_secs(1);
/// Until a command has been sent as often as it should be.
const COPIES: Duration = Duration::from_millis(500);

/// Robots that are driven from a server.
#[derive(Debug)]
pub struct Bridge {
    robots: Vec<Driven>,
    words: SyncSender<(usize, Word)>,
    clock: JoinHandle<()>,
    tasks: Vec<AbortHandle>,
    notes: NoteReader,
    /// Joints of the hinges, in MuJoCo's order.
    joints: Vec<String>,
}

#[derive(Debug)]
struct Driven {
    robot: Robot,
    progress: Arc<Mutex<Progress>>,
    moves: Arc<Waiting>,
    feedback: watch::Receiver<Option<Feedback>>,
}

/// How a robot is doing.
#[derive(Debug, Clone)]
pub struct Report {
    /// What orders call it.
    pub name: String,
    /// Subscribers of its poses: 1 once the robot is connected.
    pub subscribers: usize,
    /// Why it stands. None while it moves.
    pub stands: Option<Why>,
    /// Whether the server's frames come in time.
    pub answered: bool,
    /// Windows so far.
    pub windows: u64,
    /// Frames that were due before the server's had come.
    pub guessed: u64,
    /// Times that the server's frames were late, so that it came to stand.
    pub late: u64,
    /// How late windows left.
    pub jitter: Jitter,
    /// Frames in which a hinge would have to be faster than it can.
    pub too_fast: u64,
    /// The hinge that was the fastest of all, as a share of its highest speed.
    pub fastest: Fastest,
    /// Joint of that hinge.
    pub fastest_joint: String,
    /// The newest words of the robot.
    pub feedback: Option<Feedback>,
}

impl Bridge {
    /// Opens a session and a port for each robot. All stand, and nothing moves before an order.
    ///
    /// # Errors
    /// See [`SonicError`].
    pub async fn open(client: &Client, pack: &Pack, robots: &[Robot]) -> Result<Self, SonicError> {
        let hinges = check_robot(pack.name(), pack.robot())?;
        let (words, heard) = sync_channel(WORDS * robots.len().max(1));
        let (say, notes) = notes();
        let (mut driven, mut stations, mut followers) = (Vec::new(), Vec::new(), Vec::new());
        for (index, robot) in robots.iter().enumerate() {
            let (station, ticks) = station(robot, hinges)?;
            let follower = Follower {
                robot: index,
                client: client.clone(),
                pack: pack.clone(),
                style: robot.style.clone(),
                words: words.clone(),
                ticks,
                moves: Arc::clone(&station.session),
                notes: say.clone(),
                noted: None,
            };
            // A style that the pack lacks is found now.
            let session = follower.open(Default::default()).await?;
            driven.push((robot, Arc::clone(&station.progress), Arc::clone(&station.session)));
            stations.push(station);
            followers.push((follower, session));
        }
        let clock = std::thread::Builder::new().name("sonic-clock".to_owned());
        let clock = clock
            .spawn(move || sender::run(stations, &heard))
            .map_err(SonicError::Thread)?;
        let mut tasks = Vec::new();
        for (follower, session) in followers {
            tasks.push(tokio::spawn(follower.run(Some(session))).abort_handle());
        }
        let joint = |hinge: &Hinge| pack.skeleton().joints[hinge.joint].name.clone();
        let joints = hinges.hinges().iter().map(joint);
        let robots = driven.into_iter().map(|(robot, progress, moves)| {
            let (into, feedback) = watch::channel(None);
            if let Some(address) = robot.feedback.clone() {
                tasks.push(tokio::spawn(feedback::listen(address, into)).abort_handle());
            }
            Driven {
                robot: robot.clone(),
                progress,
                moves,
                feedback,
            }
        });
        Ok(Self {
            robots: robots.collect(),
            words,
            clock,
            tasks,
            notes,
            joints: joints.collect(),
        })
    }

    /// Gives robots an order: those of these names, or all.
    ///
    /// # Errors
    /// A line for each robot that cannot do that now. The others get the order, unless a name is
    /// unknown. A newer style or motion replaces one that the session has not got yet.
    pub fn give(&self, names: &[String], order: &Order) -> Result<(), String> {
        let chosen = |name: &String| {
            let found = self.robots.iter().position(|driven| driven.robot.name == *name);
            found.ok_or_else(|| format!("there is no robot {name:?}"))
        };
        let robots: Vec<usize> = match names {
            [] => (0..self.robots.len()).collect(),
            names => names.iter().map(chosen).collect::<Result<_, _>>()?,
        };
        let cannot: Vec<String> = robots
            .into_iter()
            .filter_map(|index| self.give_one(index, order).err())
            .collect();
        match cannot.as_slice() {
            [] => Ok(()),
            all => Err(all.join("\n")),
        }
    }

    fn give_one(&self, index: usize, order: &Order) -> Result<(), String> {
        let driven = &self.robots[index];
        if let Some(order) = driven.check(order)? {
            driven.moves.give(order);
        }
        let word = match order {
            Order::Start => Word::Control(Command::Start),
            Order::End => Word::Control(Command::End),
            Order::Stop => Word::Halt(Why::Stopped),
            Order::Go | Order::Move(_) => return Ok(()),
        };
        self.words.try_send((index, word)).map_err(|_| {
            let name = &driven.robot.name;
            format!("{name}: the clock hangs, so the order is not taken; give it again")
        })
    }

    /// The next note.
    pub async fn note(&mut self) -> Option<String> {
        let Note { robot, text } = self.notes.next().await?;
        Some(format!("{}: {text}", self.robots[robot].robot.name))
    }

    /// How each robot is doing.
    pub fn reports(&self) -> Vec<Report> {
        let report = |driven: &Driven| driven.report(&self.joints);
        self.robots.iter().map(report).collect()
    }

    /// Has all robots stand, waits until they do, and stops sending. They hold the stand.
    pub async fn close(self) -> Vec<Report> {
        // All robots know how to stop.
        let _ = self.give(&[], &Order::Stop);
        sleep(STOP + COPIES).await;
        let reports = self.reports();
        for task in &self.tasks {
            task.abort();
        }
        let (words, clock) = (self.words, self.clock);
        drop(words);
        // It ends once the tasks are gone too.
        let _ = tokio::task::spawn_blocking(|| clock.join()).await;
        reports
    }
}

impl Driven {
    /// What an order means for the session.
    fn check(&self, order: &Order) -> Result<Option<Move>, String> {
        let order = match order {
            Order::Start | Order::End => return Ok(None),
            // It stands by itself if the session does not hear.
            Order::Stop => return Ok(Some(Move::Stand)),
            Order::Go => {
                let route = self.robot.route.clone();
                Move::Path(route.ok_or_else(|| format!("{} has no route", self.robot.name))?)
            }
            Order::Move(order) => order.clone(),
        };
        match look(&self.progress).answered {
            true => Ok(Some(order)),
            false => Err(format!(
                "{}: the server does not answer, so it stands",
                self.robot.name
            )),
        }
    }

    fn report(&self, joints: &[String]) -> Report {
        let progress = look(&self.progress);
        Report {
            name: self.robot.name.clone(),
            subscribers: progress.subscribers,
            stands: progress.stands,
            answered: progress.answered,
            windows: progress.windows,
            guessed: progress.guessed,
            late: progress.late,
            jitter: progress.jitter.clone(),
            too_fast: progress.too_fast,
            fastest: progress.fastest,
            fastest_joint: joints.get(progress.fastest.hinge).cloned().unwrap_or_default(),
            feedback: *self.feedback.borrow(),
        }
    }
}

/// The station of a robot, and the session's end of its ticks.
fn station(robot: &Robot, hinges: &Hinges) -> Result<(Station, watch::Receiver<u64>), SonicError> {
    let publisher = Publisher::bind(robot.listen).map_err(|error| SonicError::Listen {
        address: robot.listen,
        error,
    })?;
    let (ticks, of_ticks) = watch::channel(0);
    let limits = hinges
        .hinges()
        .iter()
        .map(|hinge| (hinge.lower_rad, hinge.upper_rad));
    let speeds = hinges.hinges().iter().map(|hinge| hinge.max_speed_rad_per_s);
    let station = Station {
        publisher,
        playback: None,
        limits: limits.collect(),
        speeds: speeds.collect(),
        ticks,
        session: Arc::default(),
        progress: Arc::default(),
        control: None,
        why: Why::New,
        late: 0,
        window: Window::default(),
        buffer: Vec::new(),
    };
    Ok((station, of_ticks))
}
