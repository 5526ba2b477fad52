//! Motion along a path.

use std::sync::Arc;

use glam::Vec3;
use tonic::Streaming;
use troupe_motion::clip::Clip;
use troupe_motion::rotation::from_wxyz;
use troupe_proto::v1;

use crate::connection::Client;
use crate::error::{AnswerError, ClientError, RequestError};
use crate::inbetween::{CONTEXT_FRAMES, Key};
use crate::pack::Pack;

/// A path to follow. Positions are in the world, metres; only x and z count.
///
/// ```
/// use glam::Vec3;
/// use troupe_client::FollowPath;
///
/// let path = FollowPath::along([Vec3::ZERO, Vec3::Z * 4.0]).style("walk", 1.0).seed(7);
/// # assert_eq!(path, path.clone());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FollowPath {
    goal: v1::PathGoal,
    past: Vec<v1::Keyframe>,
    seed: u64,
    temperature: Option<f32>,
    raw: bool,
}

impl FollowPath {
    /// Through these places, at the usual speed of the body.
    pub fn along(places: impl IntoIterator<Item = Vec3>) -> Self {
        let points = places.into_iter().map(|place| (place, None, None));
        Self::through(points)
    }

    /// Through places, each optionally with a heading (radians) and a time (seconds from the
    /// start). All of them have times, or none has.
    pub fn through(points: impl IntoIterator<Item = (Vec3, Option<f32>, Option<f32>)>) -> Self {
        let point = |(place, heading, time): (Vec3, Option<f32>, Option<f32>)| v1::PathPoint {
            position: Some(v1::Vec3 {
                x: place.x,
                y: place.y,
                z: place.z,
            }),
            heading,
            time,
        };
        Self {
            goal: v1::PathGoal {
                points: points.into_iter().map(point).collect(),
                ..v1::PathGoal::default()
            },
            past: Vec::new(),
            seed: 0,
            temperature: None,
            raw: false,
        }
    }

    /// Uses a body that the caller defines.
    #[must_use]
    pub fn skeleton(mut self, skeleton: v1::BodySkeleton) -> Self {
        self.goal.skeleton = Some(skeleton);
        self
    }

    /// Sets the length of the motion, seconds.
    #[must_use]
    pub fn seconds(mut self, seconds: f32) -> Self {
        self.goal.seconds = Some(seconds);
        self
    }

    /// Sets the speed, metres a second, for points without times.
    #[must_use]
    pub fn speed(mut self, speed_mps: f32) -> Self {
        self.goal.speed = Some(speed_mps);
        self
    }

    /// Adds a word of the pack with a weight of 0 to 1.
    #[must_use]
    pub fn style(mut self, word: impl Into<String>, weight: f32) -> Self {
        self.goal.style.push(v1::StyleWord {
            word: word.into(),
            weight: Some(weight),
        });
        self
    }

    /// Sets the steps of the sampler.
    #[must_use]
    pub fn steps(mut self, steps: u32) -> Self {
        self.goal.steps = Some(steps);
        self
    }

    /// Sets the weight of the style. 1 is that of the training.
    #[must_use]
    pub fn guidance(mut self, guidance: f32) -> Self {
        self.goal.guidance = Some(guidance);
        self
    }

    /// Lets the server refuse a path that is not feasible for the body, judged by its data, and end
    /// with an error if frames are not feasible.
    #[must_use]
    pub fn strict(mut self, yes: bool) -> Self {
        self.goal.strict = yes;
        self
    }

    /// The same seed and path give the same motion.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Continues these frames.
    #[must_use]
    pub fn after(mut self, past: &[Key; CONTEXT_FRAMES]) -> Self {
        self.past = past.iter().map(Key::to_message).collect();
        self
    }

    /// Ends in these frames.
    #[must_use]
    pub fn ending_in(mut self, targets: &[Key]) -> Self {
        self.goal.targets = targets.iter().map(Key::to_message).collect();
        self
    }

    /// Adds a pose at a time, seconds from the start. Only for packs that walk along paths.
    #[must_use]
    pub fn passing(mut self, time_s: f32, key: &Key) -> Self {
        self.goal.keyframes.push(v1::PathKeyframe {
            time: time_s,
            keyframe: Some(key.to_message()),
        });
        self
    }

    /// 0 for the most likely motion, above 0 to sample, at most 2. Only for packs that walk along
    /// paths; 1 without it.
    #[must_use]
    pub fn temperature(mut self, temperature: f32) -> Self {
        self.temperature = Some(temperature);
        self
    }

    /// Sets whose network plans the path: that of the pack, or of another pack whose motion is
    /// carried over. Only for packs with the capability `path`.
    #[must_use]
    pub fn planner(mut self, planner: v1::PathPlanner) -> Self {
        self.goal.planner = planner.into();
        self
    }

    /// Gives the network's own frames: feet may slide, and windows may not lead over to each other.
    #[must_use]
    pub fn raw(mut self, yes: bool) -> Self {
        self.raw = yes;
        self
    }

    fn to_message(&self, pack: &Pack) -> v1::GenerateRequest {
        let body = match self.goal.skeleton {
            Some(_) => String::new(),
            None => pack.body().to_owned(),
        };
        v1::GenerateRequest {
            pack: pack.name().to_owned(),
            goal: Some(v1::generate_request::Goal::Path(v1::PathGoal {
                body,
                ..self.goal.clone()
            })),
            past: self.past.clone(),
            seed: self.seed,
            sampling: self.temperature.map(|temperature| v1::Sampling {
                temperature: Some(temperature),
                ..v1::Sampling::default()
            }),
            skeleton: pack.worn().to_owned(),
            raw: self.raw,
        }
    }
}

/// A motion that is being generated.
#[derive(Debug)]
pub struct Generating {
    client: Client,
    pack: Pack,
    parts: Streaming<v1::GenerateResponse>,
    ended: bool,
    /// Notes about parts of the request that the model may not do well. They come with the first
    /// part.
    pub notes: Vec<String>,
    /// The verdict of the least feasible part so far. None if the body has no limits.
    pub feasibility: Option<v1::Feasibility>,
}

/// New frames of one character in a motion that is being generated.
#[derive(Debug, Clone)]
pub struct GeneratedPart {
    /// Index of the character: 0 for the first, 1 and more for the others of a
    /// [`Prompt`](crate::Prompt).
    pub character: usize,
    /// The next frames of the character.
    pub clip: Clip,
}

/// A motion.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Frames of the first character.
    pub clip: Clip,
    /// Frames of the other characters, in the order of the request.
    pub others: Vec<Clip>,
    /// Notes about parts of the request that the model may not do well.
    pub notes: Vec<String>,
    /// The verdict of the least feasible part. None if the body has no limits.
    pub feasibility: Option<v1::Feasibility>,
}

impl Client {
    /// Lets the body of `pack` follow a path (see [`Pack::of_body`]). Frames come in parts while
    /// they are generated.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn follow(&self, pack: &Pack, path: &FollowPath) -> Result<Generating, ClientError> {
        self.generate(pack, path.to_message(pack)).await
    }

    pub(crate) async fn generate(
        &self,
        pack: &Pack,
        request: v1::GenerateRequest,
    ) -> Result<Generating, ClientError> {
        let answer = self.rpc.clone().generate(request).await;
        Ok(Generating {
            client: self.clone(),
            pack: pack.clone(),
            parts: answer.map_err(|status| self.sort(&status))?.into_inner(),
            ended: false,
            notes: Vec::new(),
            feasibility: None,
        })
    }
}

impl Generating {
    /// The next frames. None after the last.
    ///
    /// # Errors
    /// See [`ClientError`]. The motion ends with an error.
    pub async fn next(&mut self) -> Result<Option<GeneratedPart>, ClientError> {
        while !self.ended {
            let part = self.parts.message().await;
            let part = part.map_err(|status| self.client.sort(&status))?;
            let part = part.ok_or(AnswerError::Missing("is_last"))?;
            self.ended = part.is_last;
            self.notes.extend(part.notes);
            self.keep_worse(part.feasibility);
            let Some(v1::generate_response::Part::Frames(frames)) = part.part else {
                return Err(AnswerError::Missing("frames").into());
            };
            // The end may come without frames.
            if frames.frame_count > 0 {
                return Ok(Some(GeneratedPart {
                    character: part.character as usize,
                    clip: clip(&frames, &self.pack)?,
                }));
            }
        }
        Ok(None)
    }

    /// Keeps the verdict that is farther from feasible.
    fn keep_worse(&mut self, found: Option<v1::Feasibility>) {
        let ratio = |verdict: &Option<v1::Feasibility>| verdict.as_ref().map(|verdict| verdict.ratio);
        if ratio(&found) > ratio(&self.feasibility) {
            self.feasibility = found;
        }
    }

    /// Waits for the whole motion.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn whole(mut self) -> Result<Generated, ClientError> {
        let mut clips: Vec<Clip> = Vec::new();
        while let Some(GeneratedPart { character, clip }) = self.next().await? {
            if character == clips.len() {
                clips.push(clip);
                continue;
            }
            let earlier = clips.get_mut(character);
            let whole = earlier.ok_or(AnswerError::Missing("frames of an earlier character"))?;
            whole.root_positions.extend(clip.root_positions);
            whole.rotations.extend(clip.rotations);
        }
        let mut clips = clips.into_iter();
        Ok(Generated {
            clip: clips.next().ok_or(AnswerError::Missing("frames"))?,
            others: clips.collect(),
            notes: self.notes,
            feasibility: self.feasibility,
        })
    }
}

fn clip(frames: &v1::Frames, pack: &Pack) -> Result<Clip, AnswerError> {
    let (count, joints) = (frames.frame_count as usize, pack.skeleton().joint_count());
    let roots = frames.root_positions.as_chunks::<3>().0;
    let rotations = frames.rotations.as_chunks::<4>().0;
    for (field, got, expected) in [
        ("frames.root_positions", roots.len(), count),
        ("frames.rotations", rotations.len(), count * joints),
    ] {
        if got != expected {
            return Err(AnswerError::Length { field, got, expected });
        }
    }
    Ok(Clip::new(
        Arc::clone(pack.skeleton()),
        pack.fps(),
        roots.iter().map(|&root| Vec3::from_array(root)).collect(),
        rotations.iter().copied().map(from_wxyz).collect(),
    )?)
}

impl Pack {
    /// The pack with the skeleton and the robot of one of its bodies. The empty name stands for the
    /// default body. A pack of one skeleton has that one alone, under the pack's name.
    ///
    /// # Errors
    /// [`RequestError::UnknownBody`], with the names of all bodies.
    pub fn of_body(&self, name: &str) -> Result<Self, ClientError> {
        let bodies = &self.description().bodies;
        if bodies.is_empty() && (name.is_empty() || name == self.name()) {
            return Ok(self.clone());
        }
        let found = match name {
            "" => bodies.first(),
            name => bodies.iter().find(|body| body.name == name),
        };
        let Some(body) = found else {
            return Err(RequestError::UnknownBody {
                pack: self.name().to_owned(),
                body: name.to_owned(),
                bodies: bodies.iter().map(|body| body.name.clone()).collect(),
            }
            .into());
        };
        Ok(self.with_body(body)?)
    }
}
