//! `troupe top`.

mod figures;
mod reading;
mod screen;
#[cfg(test)]
mod testing;

use std::future::Future;
use std::io::{self, IsTerminal as _};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use crossterm::event::{Event, EventStream, KeyEventKind};
use futures_util::StreamExt as _;
use ratatui::DefaultTerminal;
use troupe_client::{ApiKey, Client, ClientError, ConnectOptions};
use troupe_proto::v1;

use self::figures::{CALL_HEADERS, Figures, PACK_HEADERS, SESSION_HEADERS, session_row};
use self::reading::Reading;
use self::screen::{Asked, View};
use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, table};
use crate::values::Seconds;

/// Watch a server: packs, calls and live sessions, refreshed in the terminal.
///
/// It shows the sessions that the key may see. If the server asks for keys, metrics need a key of
/// the role metrics or admin: --key, or --metrics-key beside it.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Keys:
  Left, Right   sort the sessions by another column
  r             reverse the order
  Up, Down      scroll
  q, Esc        leave

Examples:
  troupe top
  troupe top --once
  troupe top --metrics-key \"$(cat metrics.key)\" --interval 5")]
pub(crate) struct Top {
    /// Print one table and leave. It takes one interval, because rates need two readings.
    #[arg(long)]
    pub(crate) once: bool,

    /// Time between two readings.
    #[arg(long, default_value = "1", value_name = "SECONDS")]
    pub(crate) interval: Seconds,

    /// API key for the metrics, if it is not the key for the sessions.
    #[arg(long, env = "TROUPE_METRICS_KEY", hide_env_values = true, value_name = "KEY")]
    pub(crate) metrics_key: Option<ApiKey>,
}

pub(super) async fn run(context: &Context, command: &Top) -> Result<(), Failure> {
    let mut watch = Watch::new(context, command).await?;
    if command.once {
        watch.look().await?;
        tokio::time::sleep(watch.interval).await;
        watch.look().await?;
        return print(&text(&watch.view, None));
    }
    if !io::stdout().is_terminal() {
        return Err(Failure::Input(
            "top needs a terminal; --once prints one table".to_owned(),
        ));
    }
    let mut screen = Screen::open()?;
    let mut events = EventStream::new();
    loop {
        let due = tokio::time::Instant::now() + watch.interval;
        let look = look(&watch.sessions, &watch.metrics, watch.began.elapsed());
        match screen.until(look, &mut watch.view, &mut events).await? {
            Some(looked) => watch.take(looked),
            None => return Ok(()),
        }
        let pause = tokio::time::sleep_until(due);
        if screen.until(pause, &mut watch.view, &mut events).await?.is_none() {
            return Ok(());
        }
    }
}

/// What a server answered.
struct Looked {
    sessions: Result<Vec<v1::Session>, ClientError>,
    metrics: Result<Reading, Failure>,
}

async fn look(sessions: &Client, metrics: &Client, at: Duration) -> Looked {
    let text = metrics.metrics().await.map_err(Failure::from);
    Looked {
        sessions: sessions.list_sessions().await,
        metrics: text.and_then(|text| Reading::parse(&text, at.as_secs_f64())),
    }
}

/// A server that is looked at again and again.
struct Watch {
    sessions: Client,
    metrics: Client,
    interval: Duration,
    began: Instant,
    last: Option<Reading>,
    view: View,
}

impl Watch {
    async fn new(context: &Context, command: &Top) -> Result<Self, Failure> {
        let sessions = context.connect().await?;
        let metrics = match &command.metrics_key {
            Some(key) => {
                let options = ConnectOptions {
                    key: Some(key.clone()),
                    ..context.options.clone()
                };
                Client::connect_with(&context.url, options).await?
            }
            None => sessions.clone(),
        };
        Ok(Self {
            sessions,
            metrics,
            interval: command.interval.into(),
            began: Instant::now(),
            last: None,
            view: View::new(&context.url),
        })
    }

    /// Looks once.
    ///
    /// # Errors
    /// Where neither sessions nor metrics can be had.
    async fn look(&mut self) -> Result<(), Failure> {
        let looked = look(&self.sessions, &self.metrics, self.began.elapsed()).await;
        match looked {
            Looked {
                sessions: Err(error),
                metrics: Err(_),
            } => Err(error.into()),
            looked => {
                self.take(looked);
                Ok(())
            }
        }
    }

    fn take(&mut self, looked: Looked) {
        self.view.notes.clear();
        match looked.sessions {
            Ok(sessions) => self.view.set_sessions(sessions),
            Err(error) => self.view.notes.push(format!("sessions: {error}")),
        }
        match looked.metrics {
            Ok(reading) => {
                let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                self.view.figures = Figures::new(self.last.as_ref(), &reading, unix.as_secs_f64());
                self.last = Some(reading);
            }
            Err(failure) => self.view.notes.push(format!("metrics: {failure}")),
        }
    }
}

/// All that the screen shows, as plain text, in tables as wide as the terminal or of a given width.
fn text(view: &View, width: Option<u16>) -> String {
    let mut parts = vec![format!("Troupe at {}", view.server)];
    parts.extend(Some(view.figures.head.clone()).filter(|head| !head.is_empty()));
    parts.extend(view.notes.iter().cloned());
    let mut packs = table();
    packs.set_header(PACK_HEADERS).add_rows(&view.figures.packs);
    let mut calls = table();
    calls.set_header(CALL_HEADERS).add_rows(&view.figures.calls);
    let mut sessions = table();
    sessions
        .set_header(SESSION_HEADERS)
        .add_rows(view.sessions().iter().map(session_row));
    for mut table in [packs, calls, sessions] {
        if let Some(width) = width {
            table.set_width(width);
        }
        parts.push(table.to_string());
    }
    parts.join("\n")
}

/// The terminal in full-screen mode. Dropping it brings back what was there, whatever happened.
struct Screen(DefaultTerminal);

impl Screen {
    fn open() -> Result<Self, Failure> {
        // Also sets a panic hook that restores the terminal first.
        ratatui::try_init().map(Self).map_err(terminal)
    }

    /// Draws and obeys keys until `look` is done. None if the user leaves first.
    async fn until<T>(
        &mut self,
        what: impl Future<Output = T>,
        view: &mut View,
        events: &mut EventStream,
    ) -> Result<Option<T>, Failure> {
        tokio::pin!(what);
        loop {
            self.0.draw(|frame| view.draw(frame)).map_err(terminal)?;
            tokio::select! {
                there = &mut what => return Ok(Some(there)),
                event = events.next() => match event {
                    Some(Ok(Event::Key(key))) if key.kind != KeyEventKind::Release => {
                        if view.press(key) == Asked::Leave {
                            return Ok(None);
                        }
                    }
                    // Another size: drawn again.
                    Some(Ok(_)) => {}
                    Some(Err(error)) => return Err(terminal(error)),
                    None => return Ok(None),
                },
            }
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn terminal(error: io::Error) -> Failure {
    Failure::Other(format!("the terminal: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_as_documented() {
        let mut view = View::new("http://127.0.0.1:8080");
        view.figures = testing::figures();
        view.set_sessions(testing::sessions());
        insta::assert_snapshot!(text(&view, Some(120)));
    }

    #[test]
    fn missing_metrics_are_reported() {
        let mut view = View::new("http://127.0.0.1:8080");
        view.notes
            .push("metrics: the server refused: it needs the role metrics".to_owned());
        assert!(text(&view, Some(120)).contains("needs the role metrics"));
    }
}
