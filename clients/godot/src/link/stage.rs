//! The stream of a connection, and the characters on it.

use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::time::timeout;
use troupe_client::{Client, ClientError, ConnectOptions, Drive, DriveOptions, FrameOptions, Rate};

use super::cast::{Cast, command};
use super::opening::Opened;
use super::{Shared, Status};

/// Time without a tick after which the stream may be broken, in ticks. From then on commands and
/// newcomers wait for the client, which would begin again to reopen the stream at each of them.
const QUIET_TICKS: u32 = 4;
/// Time for the last calls of a connection.
const FAREWELL: Duration = Duration::from_secs(2);
/// Characters that are opened and not on the stream yet.
const NEWCOMERS: usize = 64;

/// Connects, and serves the characters until the link is dropped or the stream ends.
pub(super) async fn run(url: &str, connect: ConnectOptions, rate: Rate, shared: &Shared) {
    let end = tokio::select! {
        biased;
        () = shared.stop.notified() => stopped(),
        connected = Stage::connect(url, connect, rate) => match connected {
            Ok(mut stage) => {
                *shared.status() = Status::Open;
                let end = tokio::select! {
                    biased;
                    () = shared.stop.notified() => stopped(),
                    end = stage.play(shared) => end,
                };
                stage.cast.fail(&end);
                stage.farewell().await;
                end
            }
            Err(error) => error.to_string(),
        },
    };
    // Characters that join from now on find the status, those before it are in the list.
    *shared.status() = Status::Failed(end.clone());
    for actor in shared.wake.take() {
        actor.fail(end.clone());
    }
}

fn stopped() -> String {
    "the connection was closed".to_owned()
}

struct Stage {
    drive: Drive,
    period: Duration,
    newcomers: mpsc::Receiver<Opened>,
    cast: Cast,
}

impl Stage {
    async fn connect(url: &str, connect: ConnectOptions, rate: Rate) -> Result<Self, ClientError> {
        let client = Client::connect_with(url, connect).await?;
        let options = DriveOptions {
            frames: FrameOptions {
                rate,
                ..FrameOptions::default()
            },
            ..DriveOptions::default()
        };
        let drive = client.drive(options).await?;
        let (opened, newcomers) = mpsc::channel(NEWCOMERS);
        Ok(Self {
            drive,
            period: rate.period(),
            newcomers,
            cast: Cast::new(client, opened),
        })
    }

    /// Serves the characters until the stream ends, and says why it did.
    async fn play(&mut self, shared: &Shared) -> String {
        let Self {
            drive,
            period,
            newcomers,
            cast,
        } = self;
        let mut last = None::<Instant>;
        loop {
            let mut leaving = Vec::new();
            for actor in shared.wake.take() {
                leaving.extend(cast.attend(drive, &actor));
            }
            // A stream that is broken says so by itself.
            let _ = drive.detach(leaving).await;
            drive.flush();
            let ticks_come = last.is_some_and(|last| last.elapsed() < *period * QUIET_TICKS);
            let may_interrupt = ticks_come || cast.is_empty();
            let update = tokio::select! {
                biased;
                Some(opened) = newcomers.recv(), if may_interrupt => {
                    enter(drive, cast, opened).await;
                    continue;
                }
                () = shared.wake.notify.notified(), if may_interrupt => continue,
                update = drive.next() => update,
            };
            let update = match update {
                Ok(Some(update)) => update,
                Ok(None) => return "the stream is over".to_owned(),
                Err(error) => return error.to_string(),
            };
            if let Some(tick) = update.tick {
                last = Some(Instant::now());
                for (id, frames) in tick.characters() {
                    if let Some(frame) = frames.last() {
                        cast.show(id, frame);
                    }
                }
            }
            for event in update.events {
                cast.take(event);
            }
        }
    }

    /// Frees the sessions, so that they can be closed, and closes them. Those that remain expire.
    async fn farewell(self) {
        let Self {
            drive,
            mut newcomers,
            cast,
            ..
        } = self;
        let opened = std::iter::from_fn(|| newcomers.try_recv().ok());
        let opened = opened.filter_map(|one| Some(one.session.ok()?.id().to_owned()));
        let opened: Vec<String> = opened.collect();
        let last = async {
            let _ = drive.close().await;
            cast.close_all(opened).await;
        };
        let _ = timeout(FAREWELL, last).await;
    }
}

/// Takes a character onto the stream.
async fn enter(drive: &mut Drive, cast: &mut Cast, opened: Opened) {
    let Some((session, actor)) = cast.enter(opened) else {
        return;
    };
    let id = session.id().to_owned();
    // A stream that is broken says so by itself.
    let _ = drive.attach([session]).await;
    command(drive, &id, &actor);
}
