//! Drives a character with the keys of this terminal, on the server's clock.

use std::collections::VecDeque;
use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use crossterm::event::{Event, EventStream};
use futures_util::StreamExt as _;
use glam::Vec2;
use troupe_client::live::Tick;
use troupe_client::{
    Act, Client, ClientError, Drive, DriveEvent, DriveOptions, FrameOptions, Pack, Recording, SessionError,
};
use troupe_motion::conventions::Convention;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use super::args::Drive as Arguments;
use super::keys::{Asked, Choice, Controls};
use super::screen::{SceneObject, Screen, View};
use crate::context::Context;
use crate::failure::Failure;
use crate::files::Format;
use crate::reading::Reading;
use crate::replay::save_recording;
use crate::take::{InWords, options_of, scene_of};

/// File of recordings without --out.
const DEFAULT_OUT: &str = "take.bvh";
/// Time over which the displayed speed is averaged, seconds.
const SPEED_OVER_S: f32 = 0.5;
/// Note if U finds no object.
const NOTHING_AHEAD: &str = "there is nothing to use ahead";
/// Reach of the search for objects ahead, metres.
const REACH_M: f32 = 1.5;

pub(super) async fn run(
    context: &Context,
    command: &Arguments,
    format: Option<Format>,
) -> Result<(), Failure> {
    if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
        let why = "keys need a terminal; to drive along a file, give it with --path";
        return Err(Failure::Input(why.to_owned()));
    }
    let (client, pack) = context.connect_to_pack(&command.character.pack).await?;
    let styles = client.styles(&pack).await?;
    let objects = match scene_of(None, &command.character) {
        Some(name) => Some(places(&client.scene(name, Convention::Native).await?)),
        None => None,
    };
    let session = client
        .session(&pack, &options_of(None, &command.character))
        .await?;
    let id = session.id().to_owned();
    let (choices, style) = choices(&styles, command.character.style.as_deref());

    let options = DriveOptions {
        frames: FrameOptions {
            rate: command.rate.into(),
            ..FrameOptions::default()
        },
        every_tick: true,
        close_sessions: true,
        ..DriveOptions::default()
    };
    let mut drive = client.drive(options).await?;
    drive.attach([session]).await?;

    let screen = Screen::open().map_err(|e| Failure::Other(format!("the terminal: {e}")))?;
    let controls = Controls::new(choices.clone(), style, screen.reports_releases());
    let mut live = KeyDriven {
        client,
        id,
        uses: false,
        pack,
        options: options.frames,
        controls,
        view: View {
            styles: choices,
            objects,
            note: "the character is on its way".to_owned(),
            ..View::default()
        },
        recent: VecDeque::new(),
        recording: None,
        takes: Takes {
            out: command.out.clone().unwrap_or_else(|| PathBuf::from(DEFAULT_OUT)),
            format: format.unwrap_or(Format::BVH),
            written: Vec::new(),
        },
    };
    let outcome = live.play(&mut drive, screen).await;
    // A recording that still runs is kept. The terminal is free for notes again.
    let kept = live.stop_recording();
    for path in &live.takes.written {
        context.term.note(format_args!("{} written", path.display()));
    }
    drive.close().await?;
    if let Some(file) = &command.character.record {
        save_recording(context, &live.client, &live.id, file).await?;
    }
    outcome.and(kept)
}

/// The objects of a scene and their places.
fn places(scene: &v1::Scene) -> Vec<SceneObject> {
    let place = |object: &v1::SceneObject| SceneObject {
        id: object.id.clone(),
        place: place_of(object.position),
    };
    scene.objects.iter().map(place).collect()
}

fn place_of(position: Option<v1::Vec3>) -> Vec2 {
    position.map_or(Vec2::ZERO, |p| Vec2::new(p.x, p.z))
}

/// The styles in the order of their keys, and the index of the first one to use.
fn choices(styles: &v1::ListStylesResponse, wanted: Option<&str>) -> (Vec<Choice>, usize) {
    let wanted = wanted.unwrap_or(&styles.default_style);
    let mut choices = styles
        .styles
        .iter()
        .map(|style| Choice {
            name: style.name.clone(),
            speed_mps: style.default_speed,
        })
        .collect::<Vec<_>>();
    // The first style must have a key.
    let mut at = choices.iter().position(|c| c.name == wanted).unwrap_or_default();
    if at > 8 {
        let choice = choices.remove(at);
        choices.insert(0, choice);
        at = 0;
    }
    (choices, at)
}

/// A character between keys, stream and screen.
struct KeyDriven {
    client: Client,
    id: String,
    /// Whether it uses an object. Then it gets no locomotion until a key moves it.
    uses: bool,
    pack: Pack,
    options: FrameOptions,
    controls: Controls,
    view: View,
    /// Places of the last half second.
    recent: VecDeque<Vec2>,
    recording: Option<Recording>,
    takes: Takes,
}

impl KeyDriven {
    /// Runs until the user leaves, the session is gone or the stream ends, and closes the screen.
    async fn play(&mut self, drive: &mut Drive, mut screen: Screen) -> Result<(), Failure> {
        let mut keys = EventStream::new();
        loop {
            self.command(drive);
            tokio::select! {
                event = keys.next() => match event {
                    Some(Ok(Event::Key(key))) => match self.controls.key(key, Instant::now(), self.view.heading) {
                        Asked::Nothing => {}
                        Asked::Record if self.recording.is_some() => self.stop_recording()?,
                        Asked::Record => self.start_recording(),
                        Asked::Use => self.use_nearest(drive).await,
                        Asked::End if self.view.in_use.is_none() && self.view.in_hand.is_none() => {
                            self.nothing("there is nothing in use or in the hand");
                        }
                        Asked::End => self.act(drive, &Act::EndInteraction),
                        Asked::PutDown if self.view.in_hand.is_none() => {
                            self.nothing("there is nothing in the hand");
                        }
                        Asked::PutDown => self.act(drive, &Act::Drop),
                        Asked::Leave => return Ok(()),
                    },
                    Some(Ok(_)) => {}
                    Some(Err(e)) => return Err(Failure::Other(format!("the terminal: {e}"))),
                    None => return Ok(()),
                },
                update = drive.next() => {
                    let Some(update) = update? else { return Ok(()) };
                    if let Some(tick) = &update.tick {
                        self.take(tick);
                    }
                    for event in update.events {
                        self.happened(event)?;
                    }
                    screen.draw(&self.view).map_err(|e| Failure::Other(format!("the terminal: {e}")))?;
                }
            }
        }
    }

    /// Moves the character as the keys say, unless it uses an object and no key is held.
    fn command(&mut self, drive: &mut Drive) {
        let wanted = self.controls.intent(Instant::now());
        self.view.commanded = Vec2::new(wanted.velocity.x, wanted.velocity.z);
        self.view.facing = wanted.facing;
        self.uses &= self.view.commanded == Vec2::ZERO;
        if self.view.commanded != Vec2::ZERO && self.view.note == NOTHING_AHEAD {
            self.view.note.clear();
        }
        if self.uses {
            return;
        }
        if let Some(intent) = drive.intent_mut(&self.id) {
            *intent = wanted;
        }
    }

    fn act(&mut self, drive: &mut Drive, act: &Act) {
        if self.view.objects.is_none() {
            return;
        }
        self.uses |= *act != Act::Drop;
        drive.act(&self.id, act);
    }

    /// Uses the nearest object within reach.
    async fn use_nearest(&mut self, drive: &mut Drive) {
        if self.view.objects.is_none() {
            return;
        }
        let request = v1::DetectRequest {
            session_id: self.id.clone(),
            ahead: REACH_M,
            only_free: true,
            ..v1::DetectRequest::default()
        };
        let found = match self.client.detect(request).await {
            Ok(answer) => answer.objects,
            Err(error) => {
                self.view.note = error.to_string();
                return;
            }
        };
        match found.into_iter().find(|of| of.usable).and_then(|of| of.object) {
            Some(object) => self.act(drive, &Act::interact(object.id)),
            None => self.nothing(NOTHING_AHEAD),
        }
    }

    /// Shows why a key did nothing in the scene.
    fn nothing(&mut self, why: &str) {
        if self.view.objects.is_some() {
            why.clone_into(&mut self.view.note);
        }
    }

    /// Shows an event, and keeps track of objects.
    fn event(&mut self, kind: &Kind) {
        self.view.note = InWords(kind).to_string();
        match kind {
            Kind::Started(of) => self.view.in_use = Some(of.instance.clone()),
            Kind::Entered(of) => self.view.in_use = Some(format!("{}, {}", of.instance, of.set)),
            Kind::Done(_) | Kind::Failed(_) | Kind::Interrupted(_) => {
                self.uses = false;
                self.view.in_use = None;
            }
            Kind::Attached(of) => self.view.in_hand = Some(of.instance.clone()),
            Kind::Released(put) => {
                self.view.in_hand = None;
                self.moved(&put.instance, place_of(put.position));
            }
            _ => {}
        }
    }

    fn moved(&mut self, id: &str, place: Vec2) {
        let mut objects = self.view.objects.iter_mut().flatten();
        if let Some(object) = objects.find(|object| object.id == id) {
            object.place = place;
        }
    }

    fn take(&mut self, tick: &Tick<'_>) {
        if let Some((_, held)) = tick.held().find(|(id, _)| *id == self.id) {
            self.moved(&held.instance, place_of(held.position));
        }
        let Some((_, frames)) = tick.characters().find(|(id, _)| *id == self.id) else {
            return;
        };
        let Some(frame) = frames.last() else { return };
        if let Some(recording) = &mut self.recording {
            recording.push(frame);
        }
        let root = frame.native_root(self.pack.skeleton(), Convention::Native);
        let place = Vec2::new(root.position.x, root.position.z);
        let window = (SPEED_OVER_S * self.options.rate.hz() as f32) as usize;
        if self.recent.len() > window {
            self.recent.pop_front();
        }
        self.recent.push_back(place);
        let span_s = (self.recent.len() - 1).max(1) as f32 / self.options.rate.hz() as f32;

        let view = &mut self.view;
        view.moved(place);
        view.heading = root.heading;
        view.speed_mps = self
            .recent
            .front()
            .map_or(0.0, |first| first.distance(place) / span_s);
        view.chosen_speed_mps = self.controls.speed_mps();
        view.style = self.controls.style();
        view.tick = tick.number();
        view.dropped = tick.dropped();
        view.underruns += u64::from(tick.underruns());
        view.recording_s = self
            .recording
            .as_ref()
            .map(|recording| recording.len() as f32 / self.options.rate.hz() as f32);
    }

    fn happened(&mut self, event: DriveEvent) -> Result<(), Failure> {
        match event {
            DriveEvent::Attached { .. } => self.view.note = "the character is there".to_owned(),
            DriveEvent::Resumed { .. } => self.view.note = "the connection broke; it goes on".to_owned(),
            DriveEvent::Refused { problem, .. } => {
                self.view.note = problem.to_string();
                self.uses = false;
            }
            DriveEvent::Happened { events, .. } => {
                for kind in events.iter().filter_map(|event| event.kind.as_ref()) {
                    self.event(kind);
                }
            }
            DriveEvent::NotAttached { problem, id, .. } | DriveEvent::Left { problem, id, .. } => {
                let error = SessionError {
                    session: id,
                    problem,
                    request_id: None,
                };
                return Err(ClientError::Session(Box::new(error)).into());
            }
        }
        Ok(())
    }

    fn start_recording(&mut self) {
        self.recording = Some(Recording::new(&self.pack, Convention::Native, self.options.rate));
        self.view.note = "recording".to_owned();
    }

    /// Writes the recording, if there is one.
    fn stop_recording(&mut self) -> Result<(), Failure> {
        let Some(recording) = self.recording.take().filter(|r| !r.is_empty()) else {
            return Ok(());
        };
        let path = self.takes.write(recording)?;
        self.view.note = format!("{} written", path.display());
        Ok(())
    }
}

/// The files of recordings.
struct Takes {
    out: PathBuf,
    format: Format,
    written: Vec<PathBuf>,
}

impl Takes {
    fn write(&mut self, recording: Recording) -> Result<&Path, Failure> {
        let path = nth(&self.out, self.written.len() + 1);
        let clip = recording.into_clip().map_err(|e| Failure::Other(e.to_string()))?;
        self.format.write(&clip, &path, &Reading::default())?;
        self.written.push(path);
        Ok(self.written.last().map_or(&self.out, |path| path))
    }
}

/// The file of a take: the first has the given name, others get their number.
fn nth(out: &Path, take: usize) -> PathBuf {
    if take == 1 {
        return out.to_owned();
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let ending = out.extension().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{take}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_are_numbered() {
        let out = Path::new("a/dance.v2.bvh");
        assert_eq!(nth(out, 1), out);
        assert_eq!(nth(out, 3), Path::new("a/dance.v2-3.bvh"));
    }

    #[test]
    fn the_first_style_has_a_key() {
        let styles = v1::ListStylesResponse {
            styles: (0..12)
                .map(|i| v1::Style {
                    name: format!("s{i:02}"),
                    default_speed: i as f32,
                    ..v1::Style::default()
                })
                .collect(),
            default_style: "s03".to_owned(),
            ..v1::ListStylesResponse::default()
        };
        assert_eq!(choices(&styles, None).1, 3);
        let (order, at) = choices(&styles, Some("s11"));
        assert_eq!((order[at].name.as_str(), at, order.len()), ("s11", 0, 12));
        assert_eq!(order[1].name, "s00");
    }
}
