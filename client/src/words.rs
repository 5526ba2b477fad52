//! Words that become motion, and motion that becomes words.

use tonic::Streaming;
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use crate::connection::Client;
use crate::error::{AnswerError, ClientError, RequestError};
use crate::generate::Generating;
use crate::inbetween::Key;
use crate::pack::Pack;

/// How a language model chooses tokens. The pack decides all options that are not set.
///
/// ```
/// use troupe_client::TokenSampling;
///
/// let likeliest = TokenSampling::new().temperature(0.0);
/// # assert_ne!(likeliest, TokenSampling::default());
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TokenSampling(v1::Sampling);

impl TokenSampling {
    /// The pack's own sampling.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the temperature, 0 to 2. 0 takes the most likely token. Above 0 tokens are drawn with
    /// the seed.
    #[must_use]
    pub fn temperature(mut self, temperature: f32) -> Self {
        self.0.temperature = Some(temperature);
        self
    }

    /// Sets the number of likeliest tokens that may be drawn; 0 for all.
    #[must_use]
    pub fn top_k(mut self, count: u32) -> Self {
        self.0.top_k = Some(count);
        self
    }

    /// Sets the probability of the likeliest tokens that may be drawn, together: above 0, and 1 for
    /// all tokens.
    #[must_use]
    pub fn top_p(mut self, probability: f32) -> Self {
        self.0.top_p = Some(probability);
        self
    }

    /// Sets the penalty on repeating the last tokens: 1 for none, up to 10.
    #[must_use]
    pub fn repetition(mut self, penalty: f32) -> Self {
        self.0.repetition = Some(penalty);
        self
    }

    /// The message, if anything is set.
    fn to_message(self) -> Option<v1::Sampling> {
        Some(self.0).filter(|sampling| *sampling != v1::Sampling::default())
    }
}

/// Words to act out. For packs with the capability `text`.
///
/// ```
/// use troupe_client::Prompt;
///
/// let prompt = Prompt::new("an elderly man waves").seconds(4.0).seed(7);
/// # assert_eq!(prompt, prompt.clone());
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prompt {
    goal: v1::Prompt,
    past: Vec<v1::Keyframe>,
    seed: u64,
    sampling: TokenSampling,
    raw: bool,
}

impl Prompt {
    /// A sentence for the character. If it is empty beside a past, targets or audio, the model
    /// decides.
    pub fn new(text: impl Into<String>) -> Self {
        Self {
            goal: v1::Prompt {
                text: text.into(),
                ..v1::Prompt::default()
            },
            ..Self::default()
        }
    }

    /// Sets the length, seconds. Without it and [`Self::frames`] the model decides.
    #[must_use]
    pub fn seconds(mut self, seconds: f32) -> Self {
        self.goal.seconds = Some(seconds);
        self.goal.frame_count = None;
        self
    }

    /// Sets the length, in frames of the pack.
    #[must_use]
    pub fn frames(mut self, frames: u32) -> Self {
        self.goal.frame_count = Some(frames);
        self.goal.seconds = None;
        self
    }

    /// The same seed, prompt and pack give the same motion.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets how tokens are chosen.
    #[must_use]
    pub fn sampling(mut self, sampling: TokenSampling) -> Self {
        self.sampling = sampling;
        self
    }

    /// Continues these frames: at least the pack's context frames, at most its longest reply.
    #[must_use]
    pub fn after(mut self, past: &[Key]) -> Self {
        self.past = messages(past);
        self
    }

    /// Leads to these frames, from those of [`Self::after`]. Then the length must be given.
    #[must_use]
    pub fn ending_in(mut self, targets: &[Key]) -> Self {
        self.goal.targets = messages(targets);
        self
    }

    /// Ends at a place over the ground (x and z, metres), with this heading (radians). The motion's
    /// way is bent to it. Replaces the frames of [`Self::ending_in`].
    #[must_use]
    pub fn ending_at(mut self, [x, z]: [f32; 2], heading: f32) -> Self {
        let place = v1::Keyframe {
            root: Some(v1::Root {
                position: Some(v1::Vec3 { x, y: 0.0, z }),
                heading: Some(heading),
            }),
            ..v1::Keyframe::default()
        };
        self.goal.targets = vec![place];
        self
    }

    /// Adds a character of the same motion with its past, which has as many frames as that of the
    /// first. For packs with the capability `agents`.
    #[must_use]
    pub fn beside(mut self, text: impl Into<String>, past: &[Key]) -> Self {
        self.goal.others.push(v1::Agent {
            text: text.into(),
            past: messages(past),
        });
        self
    }

    /// Dances or speaks to audio, given as codes of the pack.
    #[must_use]
    pub fn to(mut self, sound: v1::Sound, codes: impl Into<Vec<u32>>) -> Self {
        self.goal.audio = Some(v1::Audio {
            sound: sound.into(),
            codes: codes.into(),
        });
        self
    }

    /// Sets the steps of the pack's flow decoder, whose frames are finer and come in one part; 0
    /// for the plain decoder.
    #[must_use]
    pub fn flow_steps(mut self, steps: u32) -> Self {
        self.goal.flow_steps = Some(steps);
        self
    }

    /// Gives the network's own frames: feet may slide.
    #[must_use]
    pub fn raw(mut self, yes: bool) -> Self {
        self.raw = yes;
        self
    }

    fn to_message(&self, pack: &Pack) -> v1::GenerateRequest {
        v1::GenerateRequest {
            pack: pack.name().to_owned(),
            goal: Some(v1::generate_request::Goal::Prompt(self.goal.clone())),
            past: self.past.clone(),
            seed: self.seed,
            sampling: self.sampling.to_message(),
            skeleton: pack.worn().to_owned(),
            raw: self.raw,
        }
    }
}

fn messages(keys: &[Key]) -> Vec<v1::Keyframe> {
    keys.iter().map(Key::to_message).collect()
}

/// A motion to put into words. For packs with the capability `describe`.
#[derive(Debug, Clone)]
pub struct Describe {
    clip: Clip,
    others: Vec<Clip>,
    into: v1::Telling,
    seed: u64,
    sampling: TokenSampling,
}

impl Describe {
    /// The motion of a clip, which is on the pack's skeleton and at its rate.
    pub fn new(clip: Clip) -> Self {
        Self {
            clip,
            others: Vec::new(),
            into: v1::Telling::Words,
            seed: 0,
            sampling: TokenSampling::default(),
        }
    }

    /// Adds a character of the same motion. Its clip must have the same number of frames.
    #[must_use]
    pub fn beside(mut self, clip: Clip) -> Self {
        self.others.push(clip);
        self
    }

    /// Asks for audio that goes with the motion, as codes of the pack.
    #[must_use]
    pub fn into_audio(mut self, sound: v1::Sound) -> Self {
        self.into = match sound {
            v1::Sound::Music => v1::Telling::Music,
            v1::Sound::Speech => v1::Telling::Speech,
        };
        self
    }

    /// The same seed, motion and pack give the same words.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets how tokens are chosen.
    #[must_use]
    pub fn sampling(mut self, sampling: TokenSampling) -> Self {
        self.sampling = sampling;
        self
    }

    fn to_message(&self, pack: &Pack) -> Result<v1::DescribeRequest, RequestError> {
        let frames = |clip: &Clip| {
            pack.check_clip(clip.fps, clip.skeleton.joint_count())?;
            Ok(messages(&Key::all(clip)))
        };
        let others = self.others.iter().map(|clip| {
            Ok(v1::OtherMotion {
                frames: frames(clip)?,
            })
        });
        Ok(v1::DescribeRequest {
            pack: pack.name().to_owned(),
            frames: frames(&self.clip)?,
            others: others.collect::<Result<_, _>>()?,
            into: self.into.into(),
            seed: self.seed,
            sampling: self.sampling.to_message(),
        })
    }
}

/// A description that is being generated.
#[derive(Debug)]
pub struct Describing {
    client: Client,
    parts: Streaming<v1::DescribeResponse>,
    ended: bool,
    /// Notes about parts of the request that the model may not do well. They come with the first
    /// part.
    pub notes: Vec<String>,
}

/// The next words or codes of a description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DescriptionPart {
    /// Words, with the spaces between parts.
    Words(String),
    /// Codes of audio.
    Codes(Vec<u32>),
}

/// All words or codes for a motion.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Description {
    /// The words. Empty if the request asked for audio.
    pub text: String,
    /// The codes of audio. Empty if the request asked for words.
    pub codes: Vec<u32>,
    /// Notes about parts of the request that the model may not do well.
    pub notes: Vec<String>,
}

impl Client {
    /// Turns words into motion. Frames come in parts while they are generated.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn say(&self, pack: &Pack, prompt: &Prompt) -> Result<Generating, ClientError> {
        self.generate(pack, prompt.to_message(pack)).await
    }

    /// Turns a motion into words. They come in parts while they are generated.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn describe(&self, pack: &Pack, motion: &Describe) -> Result<Describing, ClientError> {
        let answer = self.rpc.clone().describe(motion.to_message(pack)?).await;
        Ok(Describing {
            client: self.clone(),
            parts: answer.map_err(|status| self.sort(&status))?.into_inner(),
            ended: false,
            notes: Vec::new(),
        })
    }
}

impl Describing {
    /// The next words or codes. None after the last.
    ///
    /// # Errors
    /// See [`ClientError`]. The description ends with an error.
    pub async fn next(&mut self) -> Result<Option<DescriptionPart>, ClientError> {
        if self.ended {
            return Ok(None);
        }
        let part = self.parts.message().await;
        let part = part.map_err(|status| self.client.sort(&status))?;
        let part = part.ok_or(AnswerError::Missing("is_last"))?;
        self.ended = part.is_last;
        self.notes.extend(part.notes);
        match part.part {
            Some(v1::describe_response::Part::Text(text)) => Ok(Some(DescriptionPart::Words(text))),
            Some(v1::describe_response::Part::Audio(audio)) => Ok(Some(DescriptionPart::Codes(audio.codes))),
            None => Err(AnswerError::Missing("text").into()),
        }
    }

    /// Waits for the whole description.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn whole(mut self) -> Result<Description, ClientError> {
        let mut whole = Description::default();
        while let Some(part) = self.next().await? {
            match part {
                DescriptionPart::Words(words) => whole.text.push_str(&words),
                DescriptionPart::Codes(mut codes) => whole.codes.append(&mut codes),
            }
        }
        whole.notes = self.notes;
        Ok(whole)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn key(z: f32) -> Key {
        Key::default().root(Vec3::Z * z, Some(0.0))
    }

    #[test]
    fn the_last_length_counts() {
        let length = |prompt: Prompt| (prompt.goal.frame_count, prompt.goal.seconds);
        assert_eq!(length(Prompt::new("wave")), (None, None));
        assert_eq!(
            length(Prompt::new("wave").seconds(2.0).frames(7)),
            (Some(7), None)
        );
        assert_eq!(
            length(Prompt::new("wave").frames(7).seconds(2.0)),
            (None, Some(2.0))
        );
    }

    #[test]
    fn sampling_options_that_are_not_set_are_left_out() {
        assert_eq!(TokenSampling::new().to_message(), None);
        let said = TokenSampling::new().temperature(0.0).to_message().unwrap();
        assert_eq!(
            (said.temperature, said.top_k, said.top_p),
            (Some(0.0), None, None)
        );
    }

    #[test]
    fn a_prompt_holds_what_was_said() {
        let prompt = Prompt::new("walk")
            .after(&[key(0.0), key(0.1)])
            .ending_in(&[key(1.0)])
            .beside("wave", &[key(0.0)])
            .to(v1::Sound::Speech, [3, 1])
            .flow_steps(4);
        assert_eq!(prompt.past.len(), 2);
        let goal = prompt.goal;
        assert_eq!((goal.targets.len(), goal.flow_steps), (1, Some(4)));
        assert_eq!((&*goal.others[0].text, goal.others[0].past.len()), ("wave", 1));
        let audio = goal.audio.unwrap();
        assert_eq!((audio.sound(), audio.codes), (v1::Sound::Speech, vec![3, 1]));
    }
}
