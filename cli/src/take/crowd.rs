//! The characters of a cast, stepped together and recorded.

use glam::{Vec2, Vec3};
use troupe_client::{
    Act, AnswerError, ClientError, Crowd, CrowdOptions, Frames, MemberId, Rate, Recording, SessionOptions,
};
use troupe_motion::GlobalRoot;
use troupe_motion::clip::Clip;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use super::events::{Event, TIMELINE_HZ};
use crate::context::Context;
use crate::failure::Failure;
use crate::path::{Cast, Path, Player};

/// Frames of a step. The paths are followed up ten times a second.
const STEP_FRAMES: u32 = 6;
const RATE: Rate = Rate::Hz60;

/// Characters that have followed the paths of a cast.
#[derive(Debug)]
pub(crate) struct CrowdTake {
    /// In the order of the cast.
    pub(crate) members: Vec<Recorded>,
    /// The scene before the take, if they live in one.
    pub(crate) scene: Option<v1::Scene>,
    /// Events of the characters.
    pub(crate) events: Vec<Event>,
    /// Plans of all characters.
    pub(crate) plans: u64,
}

/// What one character did.
#[derive(Debug)]
pub(crate) struct Recorded {
    /// Motion, 60 frames a second, native convention.
    pub(crate) clip: Clip,
    /// Name of the pack.
    pub(crate) pack: String,
    /// Styles, and sentences that it acts out, each with its first frame.
    pub(crate) labels: Vec<(usize, String)>,
}

/// A character on its way.
struct Member<'a> {
    id: MemberId,
    /// Index of its troupe.
    troupe: usize,
    player: Player<'a>,
    recording: Recording,
    labels: Vec<(usize, String)>,
    place: Vec2,
}

/// The characters of a pack.
struct Troupe {
    pack: troupe_client::Pack,
    crowd: Crowd,
}

/// Has new characters follow their paths together for some seconds.
pub(crate) async fn follow_together(
    context: &Context,
    cast: &Cast,
    seconds: f32,
) -> Result<CrowdTake, Failure> {
    let client = context.connect().await?;
    let scene = match &cast.scene {
        Some(name) => Some(client.scene(name, Convention::Native).await?),
        None => None,
    };
    let mut options = CrowdOptions::default();
    options.frames.rate = RATE;
    let (mut troupes, mut members): (Vec<Troupe>, Vec<Member<'_>>) = (Vec::new(), Vec::new());
    for path in &cast.paths {
        let pack = client.pack(path.pack.as_deref().unwrap_or_default()).await?;
        let known = troupes
            .iter()
            .position(|troupe| troupe.pack.name() == pack.name());
        let troupe = known.unwrap_or_else(|| {
            let crowd = Crowd::new(&client, &pack, options);
            troupes.push(Troupe {
                pack: pack.clone(),
                crowd,
            });
            troupes.len() - 1
        });
        let ids = troupes[troupe].crowd.add(&[options_of(path)]).await?;
        members.extend(ids.into_iter().map(|id| Member {
            id,
            troupe,
            player: Player::new(path),
            recording: Recording::new(&pack, Convention::Native, RATE),
            labels: Vec::new(),
            place: path.start,
        }));
    }
    let mut events = Vec::new();
    let steps = (seconds * RATE.hz() as f32 / STEP_FRAMES as f32).ceil() as u32;
    let bar = context.term.bar(steps as usize, "steps");
    for step in 0..steps {
        let time_s = (step * STEP_FRAMES) as f32 / RATE.hz() as f32;
        for member in &mut members {
            member.command(&mut troupes[member.troupe].crowd, time_s);
        }
        for (nth, troupe) in troupes.iter_mut().enumerate() {
            let answer = troupe.crowd.step(STEP_FRAMES).await?;
            if let Some(fault) = answer.faults().first() {
                let (session, problem) = (&fault.session, &fault.problem);
                return Err(Failure::Other(format!("session {session}: {problem}")));
            }
            for (_, event) in answer.events() {
                events.extend(event_of(event)?);
            }
            for member in members.iter_mut().filter(|member| member.troupe == nth) {
                let frames = answer.get(member.id);
                let frames = frames.ok_or_else(|| Failure::Other("a character has no frames".to_owned()))?;
                member.record(frames, &troupe.pack);
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let mut plans = 0;
    let mut packs = Vec::new();
    for Troupe { pack, crowd } in troupes {
        plans += crowd.stats().await?.plans();
        crowd.close().await?;
        packs.push(pack.name().to_owned());
    }
    let recorded = members.into_iter().map(|member| {
        let pack = packs[member.troupe].clone();
        member.into_recorded(pack)
    });
    Ok(CrowdTake {
        members: recorded.collect::<Result<_, Failure>>()?,
        scene,
        events,
        plans,
    })
}

impl Member<'_> {
    /// Commands it for the next frames.
    fn command(&mut self, crowd: &mut Crowd, time_s: f32) {
        // An intent is sent once it is borrowed, and would end an interaction.
        if let Some(now) = self.player.intent(time_s, self.place) {
            if let Some(intent) = crowd.intent_mut(self.id) {
                intent.clone_from(now);
            }
            if let Some(style) = &now.style
                && self.labels.last().is_none_or(|(_, last)| last != style)
            {
                self.labels.push((self.recording.len(), style.clone()));
            }
        }
        for act in self.player.take_acts() {
            if let Act::Perform(sentence) = act {
                self.labels.push((self.recording.len(), sentence.text.clone()));
            }
            crowd.act(self.id, act);
        }
    }

    fn record(&mut self, frames: Frames<'_>, pack: &troupe_client::Pack) {
        frames.iter().for_each(|frame| self.recording.push(frame));
        if let Some(last) = frames.last() {
            let root: GlobalRoot = last.native_root(pack.skeleton(), Convention::Native);
            self.place = Vec2::new(root.position.x, root.position.z);
        }
    }

    fn into_recorded(self, pack: String) -> Result<Recorded, Failure> {
        let clip = self.recording.into_clip();
        Ok(Recorded {
            clip: clip.map_err(|e| ClientError::from(AnswerError::Frames(e)))?,
            pack,
            labels: self.labels,
        })
    }
}

/// An event at its time.
///
/// # Errors
/// [`Failure::Other`] if an interaction failed.
fn event_of(event: &v1::SessionEvent) -> Result<Option<Event>, Failure> {
    let Some(kind) = event.kind.clone() else {
        return Ok(None);
    };
    let time_s = event.frame as f32 / TIMELINE_HZ;
    let event = Event {
        frame: (time_s * RATE.hz() as f32) as usize,
        time_s,
        kind,
    };
    match event.kind {
        Kind::Failed(_) | Kind::Interrupted(_) => Err(Failure::Other(event.to_string())),
        _ => Ok(Some(event)),
    }
}

fn options_of(path: &Path) -> SessionOptions {
    let mut options = SessionOptions::new().seed(path.seed);
    if let Some(style) = &path.style {
        options = options.style(style);
    }
    if let Some(scene) = &path.scene {
        options = options.scene(scene);
    }
    options.at(Vec3::new(path.start.x, 0.0, path.start.y), path.heading)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(kind: Kind) -> v1::SessionEvent {
        v1::SessionEvent {
            frame: 45,
            kind: Some(kind),
        }
    }

    #[test]
    fn events_have_their_frame_and_failures_end_the_take() {
        let started = event_of(&event(Kind::Started(v1::InteractionStarted::default())));
        let started = started.unwrap().unwrap();
        assert_eq!((started.frame, started.time_s), (90, 1.5));
        assert!(event_of(&event(Kind::Failed(v1::InteractionFailed::default()))).is_err());
    }
}
