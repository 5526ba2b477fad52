//! Turns the parts of an answer into messages.

use std::sync::Arc;

use troupe_character::live::WordsPart;
use troupe_character::post::{
    NonFinite, check_finite, onto_hinges, parent_relative, roots, to_world_rotations,
};
use troupe_character::take::Track;
use troupe_motion::feasibility::Judge;
use troupe_motion::model::{Motion, Output, Rig, Sound, Telling};
use troupe_motion::robot::HingeRates;
use troupe_motion::rotation::{align_sign, to_wxyz};
use troupe_motion::{Quat, SegmentFrame, Vec3};
use troupe_proto::v1;

use super::feasible;

/// Turns the parts of a motion into messages, one after another.
#[derive(Debug)]
pub struct PartWriter {
    rig: Arc<Rig>,
    frame: SegmentFrame,
    /// Each character's pose at the end of its last part. Empty before the first part.
    last: Vec<Vec<Quat>>,
    /// How fast each character's hinges turned so far.
    rates: Vec<HingeRates>,
    /// Judges frames along a path, if the body has limits.
    judge: Option<Judge>,
    /// Number of judged frames.
    judged: usize,
}

impl PartWriter {
    /// A writer for an answer whose segment lies at `frame`.
    pub fn new(rig: Arc<Rig>, frame: SegmentFrame) -> Self {
        Self {
            rig,
            frame,
            last: Vec::new(),
            rates: Vec::new(),
            judge: None,
            judged: 0,
        }
    }

    /// Also judges the frames, which must be those of one character.
    #[must_use]
    pub fn judged_by(self, judge: Option<Judge>) -> Self {
        Self { judge, ..self }
    }

    /// The messages of the next part: one for each character with frames in it. The last part has
    /// at least one message.
    ///
    /// # Errors
    /// [`NonFinite`] if the model gave numbers that are not finite.
    pub fn write(&mut self, output: Output, is_last: bool) -> Result<Vec<v1::GenerateResponse>, NonFinite> {
        let motions = match output {
            Output::Motion(motion) => vec![motion],
            Output::Motions(motions) => motions,
            // Tasks that make motion have no such output.
            Output::Text(_) | Output::Audio(_) => Vec::new(),
        };
        let mut messages = Vec::with_capacity(motions.len());
        for (character, motion) in motions.iter().enumerate() {
            if motion.frames() > 0 {
                messages.push(message(character, self.frames(character, motion)?));
            }
        }
        Ok(self.ended(messages, is_last))
    }

    /// The body of the answer.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// The messages of the next frames of characters that act out words, as
    /// [`write`](Self::write).
    pub fn write_words(&mut self, parts: Vec<WordsPart>, is_last: bool) -> Vec<v1::GenerateResponse> {
        let mut messages = Vec::with_capacity(parts.len());
        for (character, mut part) in parts.into_iter().enumerate() {
            if part.roots.is_empty() {
                continue;
            }
            to_world_rotations(&self.frame, self.rig.dims.joints, &mut part.rotations);
            let places = part.roots.iter().map(|&root| self.frame.to_world_position(root));
            let contacts = self.touches(&part.contacts);
            let columns = self.columns(character, places.collect(), part.rotations, contacts);
            messages.push(message(character, columns));
        }
        self.ended(messages, is_last)
    }

    /// The messages of one character's next frames, as [`write`](Self::write).
    pub fn write_track(&mut self, track: Track, is_last: bool) -> Vec<v1::GenerateResponse> {
        let mut messages = Vec::new();
        if !track.is_empty() {
            let contacts = self.touches(&track.contacts);
            messages.push(message(
                0,
                self.columns(0, track.roots, track.rotations, contacts),
            ));
        }
        self.ended(messages, is_last)
    }

    /// The column of contacts, from a byte a frame.
    fn touches(&self, contacts: &[u8]) -> Vec<f32> {
        let joints = 0..self.rig.dims.contacts;
        let touches = |bits: u8| {
            joints
                .clone()
                .map(move |bit| f32::from(bits.checked_shr(bit as u32).unwrap_or(0) & 1))
        };
        contacts.iter().copied().flat_map(touches).collect()
    }

    /// Completes the messages of a part: whether it is the last one, and its feasibility. A last
    /// part without frames gets one message.
    fn ended(&mut self, mut messages: Vec<v1::GenerateResponse>, is_last: bool) -> Vec<v1::GenerateResponse> {
        if is_last && messages.is_empty() {
            messages.push(message(0, v1::Frames::default()));
        }
        if let Some(last) = messages.last_mut() {
            last.is_last = is_last;
            let found = self.judge.as_mut().map(Judge::part);
            last.feasibility = found.as_ref().map(feasible::message);
        }
        messages
    }

    /// Sets the segment frame of the next part.
    pub fn move_to(&mut self, frame: SegmentFrame) {
        self.frame = frame;
    }

    fn frames(&mut self, character: usize, motion: &Motion) -> Result<v1::Frames, NonFinite> {
        check_finite(motion)?;
        let (rig, count) = (&self.rig, motion.frames());
        let mut rotations = parent_relative(motion, count, &rig.dims, &rig.skeleton);
        to_world_rotations(&self.frame, rig.dims.joints, &mut rotations);
        let positions: Vec<Vec3> = roots(&motion.root)
            .map(|root| self.frame.to_world_position(root.position))
            .collect();
        let contacts = motion.contacts.iter().map(|contact| contact.clamp(0.0, 1.0));
        let contacts = contacts.collect();
        Ok(self.columns(character, positions, rotations, contacts))
    }

    /// The columns of a character's next frames, which are in world coordinates.
    fn columns(
        &mut self,
        character: usize,
        positions: Vec<Vec3>,
        mut rotations: Vec<Quat>,
        contacts: Vec<f32>,
    ) -> v1::Frames {
        let (rig, joints) = (&self.rig, self.rig.dims.joints);
        if self.last.len() <= character {
            self.last.resize(character + 1, Vec::new());
            self.rates.resize_with(character + 1, HingeRates::default);
        }
        let last = &mut self.last[character];
        // Keeps the quaternion hemispheres of the part before, as between frames of one part.
        for index in 0..rotations.len() {
            let before = match index.checked_sub(joints) {
                Some(before) => Some(rotations[before]),
                None => last.get(index).copied(),
            };
            if let Some(before) = before {
                rotations[index] = align_sign(rotations[index], before);
            }
        }
        let hinges = rig.skeleton.robot.as_ref();
        let clock = (&mut self.rates[character], rig.fps);
        let frames = (&*positions, &mut *rotations);
        let hinges = hinges.map(|robot| onto_hinges(robot, frames, clock, true));
        let hinges = hinges.unwrap_or_default();
        if let Some(judge) = &mut self.judge {
            for (root, pose) in positions.iter().zip(rotations.chunks_exact(joints)) {
                judge.push(self.judged, Some(*root), Some((root.y, pose)));
                self.judged += 1;
            }
        }
        *last = rotations[rotations.len().saturating_sub(joints)..].to_vec();
        v1::Frames {
            frame_count: positions.len() as u32,
            root_positions: positions.iter().flat_map(Vec3::to_array).collect(),
            rotations: rotations.iter().copied().flat_map(to_wxyz).collect(),
            contacts,
            qpos: hinges.qpos,
            hinge_residuals: hinges.residuals,
            clamped_hinges: hinges.clamped,
            hinge_speed_ratios: hinges.rates.speed_ratios,
            fastest_hinges: hinges.rates.fastest,
            hinge_accelerations: hinges.rates.accelerations,
            ..v1::Frames::default()
        }
    }
}

fn message(character: usize, frames: v1::Frames) -> v1::GenerateResponse {
    v1::GenerateResponse {
        part: Some(v1::generate_response::Part::Frames(frames)),
        character: character as u32,
        ..v1::GenerateResponse::default()
    }
}

/// The message of the next part of a description in the form `into`.
pub fn write_description(output: Output, into: Telling, is_last: bool) -> v1::DescribeResponse {
    use v1::describe_response::Part;

    let part = match output {
        Output::Text(text) => Part::Text(text),
        Output::Audio(codes) => Part::Audio(v1::Audio {
            sound: match into {
                Telling::Audio(Sound::Speech) => v1::Sound::Speech,
                Telling::Audio(Sound::Music) | Telling::Words => v1::Sound::Music,
            }
            .into(),
            codes,
        }),
        // Tasks that describe a motion have no such output.
        Output::Motion(_) | Output::Motions(_) => Part::Text(String::new()),
    };
    v1::DescribeResponse {
        part: Some(part),
        is_last,
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use troupe_engine::pack::Pack;
    use troupe_motion::GlobalRoot;
    use troupe_motion::rotation::{six_d, yaw};
    use v1::generate_response::Part;

    use super::*;

    fn rig() -> Arc<Rig> {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
        Pack::load(&folder).unwrap().rig
    }

    fn origin() -> SegmentFrame {
        SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0))
    }

    /// Frames in which everything is turned by these angles.
    fn turned(rig: &Rig, angles: &[f32]) -> Motion {
        let mut motion = Motion::default();
        for &angle in angles {
            motion.root.extend([0.0, 0.9, 0.0, angle.cos(), angle.sin()]);
            for _ in 0..rig.dims.joints {
                motion.rotations.extend(six_d(yaw(angle)));
            }
            motion
                .contacts
                .extend(std::iter::repeat_n(1.0, rig.dims.contacts));
        }
        motion
    }

    fn frames(message: &v1::GenerateResponse) -> &v1::Frames {
        match &message.part {
            Some(Part::Frames(frames)) => frames,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_characters_frames_are_a_message_and_the_last_ends_the_answer() {
        let rig = rig();
        let mut writer = PartWriter::new(rig.clone(), origin());
        let part = |counts: [usize; 3]| {
            let motions = counts.map(|count| turned(&rig, &vec![0.0; count]));
            Output::Motions(motions.to_vec())
        };
        let mut seen = |counts, is_last| -> Vec<(u32, u32, bool)> {
            let messages = writer.write(part(counts), is_last).unwrap();
            let outline = |message: &v1::GenerateResponse| {
                (message.character, frames(message).frame_count, message.is_last)
            };
            messages.iter().map(outline).collect()
        };
        assert_eq!(seen([8, 0, 0], false), [(0, 8, false)]);
        assert_eq!(seen([0, 8, 4], false), [(1, 8, false), (2, 4, false)]);
        assert_eq!(seen([0, 0, 0], false), []);
        assert_eq!(seen([0, 4, 4], true), [(1, 4, false), (2, 4, true)]);
        assert_eq!(seen([0, 0, 0], true), [(0, 0, true)]);
    }

    #[test]
    fn each_character_keeps_to_its_own_hemispheres() {
        let rig = rig();
        let mut writer = PartWriter::new(rig.clone(), origin());
        // The second turns once around, part after part; the first stands.
        let mut before: [Option<Vec<f32>>; 2] = [None, None];
        for step in 0..24 {
            let angle = step as f32 * 0.3;
            let motions = vec![turned(&rig, &[0.0]), turned(&rig, &[angle])];
            for message in writer.write(Output::Motions(motions), false).unwrap() {
                let root = frames(&message).rotations[..4].to_vec();
                let slot = &mut before[message.character as usize];
                if let Some(before) = slot {
                    let dot: f32 = before.iter().zip(&root).map(|(a, b)| a * b).sum();
                    assert!(dot > 0.9, "step {step}, character {}: {dot}", message.character);
                }
                *slot = Some(root);
            }
        }
    }

    #[test]
    fn audio_says_what_sounds() {
        for (into, sound) in [
            (Sound::Music, v1::Sound::Music),
            (Sound::Speech, v1::Sound::Speech),
        ] {
            let written = write_description(Output::Audio(vec![3, 1]), Telling::Audio(into), true);
            let audio = v1::Audio {
                sound: sound.into(),
                codes: vec![3, 1],
            };
            assert_eq!(written.part, Some(v1::describe_response::Part::Audio(audio)));
            assert!(written.is_last);
        }
    }
}
