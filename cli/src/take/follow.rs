//! A character along a scripted path, on the client's clock.

use glam::{Vec2, Vec3};
use troupe_client::{AnswerError, ClientError, FrameOptions, Recording};
use troupe_motion::GlobalRoot;
use troupe_motion::clip::Clip;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use super::character::{Character, options_of, pack_of, scene_of};
use super::events::{Event, Moved, Seen};
use crate::context::Context;
use crate::failure::Failure;
use crate::path::{MOMENT_S, Moment, Path, Player};
use crate::replay::save_recording;

/// Times a second that the path is followed up. In between the character is stepped.
const LOOKS_HZ: u32 = 10;
/// Time over which a speed is averaged, seconds, so that the sway of a step does not count.
const SPEED_OVER_S: f32 = 0.5;

/// A character that has followed a path.
#[derive(Debug)]
pub(crate) struct Take {
    /// The motion, native convention.
    pub(crate) clip: Clip,
    /// The commands, each from its frame on.
    pub(crate) orders: Vec<Order>,
    /// The commanded way, (x, z).
    pub(crate) commanded: Vec<Vec2>,
    /// The last waypoint, if the path has any.
    pub(crate) goal: Option<Vec2>,
    /// The scene before the take, if the character lives in one.
    pub(crate) scene: Option<v1::Scene>,
    /// Events of the character in its scene, in order.
    pub(crate) events: Vec<Event>,
    /// Places of objects that were in its hand, in order.
    pub(crate) moved: Vec<Moved>,
    /// Commands that were sent.
    pub(crate) commands: u64,
    /// The server's count.
    pub(crate) stats: v1::SessionStats,
}

/// The command from a frame of the clip on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Order {
    pub(crate) frame: usize,
    pub(crate) style: String,
    /// (x, z), m/s.
    pub(crate) velocity: Vec2,
}

/// Figures of a take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measures {
    pub(crate) distance_m: f32,
    /// Mean over the time in which it was commanded to go, if there is any.
    pub(crate) mean_speed_mps: Option<f32>,
    pub(crate) most_speed_mps: f32,
    pub(crate) end_to_last_waypoint_m: Option<f32>,
}

impl Take {
    pub(crate) fn measures(&self) -> Measures {
        let ground = self.clip.root_positions.iter().map(|p| Vec2::new(p.x, p.z));
        let ground = ground.collect::<Vec<_>>();
        // A window of half a second averages the sway of the hips.
        let window = ((SPEED_OVER_S * self.clip.fps) as usize).clamp(1, ground.len().max(2) - 1);
        let span_s = window as f32 / self.clip.fps;
        let (mut sum, mut count, mut most) = (0.0, 0_usize, 0.0_f32);
        let mut distance_m = 0.0;
        for (frame, pair) in ground.windows(window + 1).enumerate() {
            let way = pair[0].distance(pair[window]);
            most = most.max(way / span_s);
            if self
                .order_at(frame)
                .is_some_and(|order| order.velocity != Vec2::ZERO)
            {
                sum += way / span_s;
                count += 1;
            }
            if frame % window == 0 {
                distance_m += way;
            }
        }
        Measures {
            distance_m,
            mean_speed_mps: (count > 0).then(|| sum / count as f32),
            most_speed_mps: most,
            end_to_last_waypoint_m: self
                .goal
                .zip(ground.last())
                .map(|(goal, end)| goal.distance(*end)),
        }
    }

    /// The command at a frame.
    pub(crate) fn order_at(&self, frame: usize) -> Option<&Order> {
        let after = self.orders.partition_point(|order| order.frame <= frame);
        self.orders.get(after.checked_sub(1)?)
    }
}

/// Has a new character follow a path to its end.
pub(crate) async fn follow(
    context: &Context,
    path: &Path,
    character: &Character,
    options: FrameOptions,
) -> Result<Take, Failure> {
    let (client, pack) = context.connect_to_pack(pack_of(Some(path), character)).await?;
    let scene = match scene_of(Some(path), character) {
        Some(name) => Some(client.scene(name, Convention::Native).await?),
        None => None,
    };
    let mut live = client.session(&pack, &options_of(Some(path), character)).await?;
    live.set_frame_options(options);
    let take = Taking {
        path,
        character,
        hz: options.rate.hz() as f32,
        is_watched: scene.is_some() || path.does_skills(),
        recording: Recording::of(&live),
        orders: Vec::new(),
        seen: Seen::default(),
    };
    let id = live.id().to_owned();
    let outcome = take.play(context, &mut live).await;
    // The session is closed in any case. An earlier failure comes first.
    let closed = live.close().await;
    if let Some(file) = &character.record {
        save_recording(context, &client, &id, file).await?;
    }
    let mut take = outcome?;
    closed?;
    take.scene = scene;
    Ok(take)
}

/// A take that is being recorded.
struct Taking<'a> {
    path: &'a Path,
    character: &'a Character,
    hz: f32,
    /// Whether it may have events, because it lives in a scene or does skills.
    is_watched: bool,
    recording: Recording,
    orders: Vec<Order>,
    seen: Seen,
}

impl Taking<'_> {
    async fn play(mut self, context: &Context, live: &mut troupe_client::Session) -> Result<Take, Failure> {
        let (path, hz) = (self.path, self.hz);
        let mut style = live.info().await?.style;
        let mut player = Player::new(path);
        let mut place = path.start;
        let bar = context.term.bar((path.limit_s() * hz) as usize, "frames");
        let skeleton = live.pack().skeleton().clone();
        loop {
            let frame = self.recording.len();
            let time_s = frame as f32 / hz;
            if time_s + 0.5 / hz >= player.ends_s() {
                break;
            }
            if let Some((nth, moment)) = player.waits_in_vain(time_s) {
                bar.finish_and_clear();
                return Err(self.in_vain(nth, moment));
            }
            self.command(live, &mut player, &mut style, place);
            let frames = match self.is_watched {
                // The object in the hand comes for the last frame of a step only.
                true => 1,
                false => frames_until(frame, hz, player.next_command_s(), player.ends_s()),
            };
            let frames = live.step(frames).await?;
            let first_frame = frames.first_frame();
            for frame in frames.iter() {
                self.recording.push(frame);
            }
            if let Some(last) = frames.last() {
                let GlobalRoot {
                    position: Vec3 { x, z, .. },
                    ..
                } = last.native_root(&skeleton, Convention::Native);
                place = Vec2::new(x, z);
            }
            self.look(live, &mut player, first_frame).await?;
            bar.set_position(self.recording.len() as u64);
        }
        bar.finish_and_clear();
        self.into_take(live.info().await?)
    }

    /// Why the path cannot go on: its `nth` command waits for a moment that did not come.
    fn in_vain(&self, nth: usize, moment: Moment) -> Failure {
        let mut text = format!(
            "[[command]] {nth} of the path waited {MOMENT_S} s for after = \"{}\", which did not come; what happened:",
            moment.word()
        );
        match self.seen.events.is_empty() {
            true => text.push_str(" nothing"),
            false => (self.seen.events.iter()).for_each(|event| text.push_str(&format!("\n{event}"))),
        }
        Failure::Other(text)
    }

    /// Tells the character what to do from the next frame on.
    fn command(
        &mut self,
        live: &mut troupe_client::Session,
        player: &mut Player<'_>,
        style: &mut String,
        place: Vec2,
    ) {
        let frame = self.recording.len();
        let intent = player.intent(frame as f32 / self.hz, place).cloned();
        for act in player.take_acts() {
            live.act(act);
        }
        let mut velocity = Vec2::ZERO;
        if let Some(mut intent) = intent {
            // The argument holds until the path has a style of its own to change to.
            if intent.style == self.path.style {
                intent.style = self.character.style.clone().or(intent.style);
            }
            if let Some(new) = &intent.style {
                style.clone_from(new);
            }
            velocity = Vec2::new(intent.velocity.x, intent.velocity.z);
            live.set_intent(intent);
        }
        let last = self
            .orders
            .last()
            .map(|last| (last.style.as_str(), last.velocity));
        if last != Some((style.as_str(), velocity)) {
            self.orders.push(Order {
                frame,
                style: style.clone(),
                velocity,
            });
        }
    }

    /// Takes note of what happened in the last step.
    async fn look(
        &mut self,
        live: &mut troupe_client::Session,
        player: &mut Player<'_>,
        first_frame: u64,
    ) -> Result<(), Failure> {
        if !self.is_watched {
            return Ok(());
        }
        let frame = self.recording.len() - 1;
        let time_s = (frame + 1) as f32 / self.hz;
        let is_over = self
            .seen
            .step(frame, self.hz, first_frame, live.events(), live.held());
        if player.uses() {
            let activity = live.info().await?.activity.unwrap_or_default();
            if activity.kind() == v1::ActivityKind::Held && self.seen.began_to_hold() {
                player.came(Moment::Held, time_s);
            }
        }
        if is_over {
            player.came(Moment::Done, time_s);
        }
        Ok(())
    }

    fn into_take(self, info: v1::Session) -> Result<Take, Failure> {
        let clip = self
            .recording
            .into_clip()
            .map_err(|e| ClientError::from(AnswerError::Frames(e)))?;
        Ok(Take {
            commanded: self.path.commanded(clip.duration_s()),
            goal: self.path.waypoints.last().map(|p| p.at),
            clip,
            orders: self.orders,
            scene: None,
            events: self.seen.events,
            moved: self.seen.moved,
            commands: info.last_sequence,
            stats: info.stats.unwrap_or_default(),
        })
    }
}

/// Frames of the next step: those of a tenth of a second, or fewer, so that the next command, or
/// the end, comes at its frame.
fn frames_until(frame: usize, hz: f32, next_command_s: Option<f32>, ends_s: f32) -> u32 {
    let look = hz as u32 / LOOKS_HZ;
    let until = |time_s: f32| (time_s * hz).round() as i64 - frame as i64;
    let soonest = next_command_s.map_or(i64::MAX, until).min(until(ends_s));
    u32::try_from(soonest.max(1)).unwrap_or(u32::MAX).min(look)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Quat;
    use troupe_motion::skeleton::{Joint, Skeleton};

    use super::*;

    #[test]
    fn commands_and_the_end_come_at_their_frame() {
        assert_eq!(frames_until(0, 30.0, None, 9.0), 3);
        assert_eq!(frames_until(13, 30.0, Some(0.5), 9.0), 2);
        assert_eq!(frames_until(14, 30.0, Some(0.5), 9.0), 1);
        assert_eq!(frames_until(269, 30.0, Some(20.0), 9.0), 1);
        assert_eq!(frames_until(0, 60.0, None, 9.0), 6);
        // A command that is due already does not stop the clock.
        assert_eq!(frames_until(20, 30.0, Some(0.5), 9.0), 1);
    }

    #[test]
    fn distance_and_speeds_are_measured_over_the_sway() {
        // Two seconds at 1 m/s along z with a sway across it, then one second of standing.
        let joint = Joint {
            name: "Hips".to_owned(),
            parent: None,
            offset_m: Vec3::ZERO,
        };
        let skeleton = Arc::new(Skeleton::new(vec![joint], Vec3::X, 0.0, None).unwrap());
        let place = |f: usize| {
            let z = f.min(60) as f32 / 30.0;
            Vec3::new(0.02 * (f as f32 * std::f32::consts::TAU / 15.0).sin(), 0.9, z)
        };
        let roots = (0..91).map(place).collect();
        let order = |frame, velocity| Order {
            frame,
            style: "walk".to_owned(),
            velocity,
        };
        let take = Take {
            clip: Clip::new(skeleton, 30.0, roots, vec![Quat::IDENTITY; 91]).unwrap(),
            orders: vec![order(0, Vec2::Y), order(46, Vec2::ZERO)],
            commanded: Vec::new(),
            goal: Some(Vec2::new(0.0, 2.5)),
            scene: None,
            events: Vec::new(),
            moved: Vec::new(),
            commands: 2,
            stats: v1::SessionStats::default(),
        };
        let measures = take.measures();
        assert!((measures.distance_m - 2.0).abs() < 0.02, "{measures:?}");
        assert!(
            (measures.mean_speed_mps.unwrap() - 1.0).abs() < 0.02,
            "{measures:?}"
        );
        assert!((measures.most_speed_mps - 1.0).abs() < 0.05, "{measures:?}");
        assert!((measures.end_to_last_waypoint_m.unwrap() - 0.5).abs() < 0.01);
        assert_eq!(take.order_at(45).unwrap().frame, 0);
        assert_eq!(take.order_at(46).unwrap().frame, 46);
    }
}
