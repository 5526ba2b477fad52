//! Networks for tests, which add whole numbers: their results are exact in any order.
//!
//! The language model's next token depends, by way of the cache, on all tokens before it and on
//! their positions. Motion codes stand for steps ahead and turns.

use std::path::Path;
use std::sync::{Arc, Mutex};

use troupe_motion::features::FEATURES_PER_JOINT;
use troupe_motion::rotation::{six_d, yaw};

use super::*;
use crate::EngineError;
use crate::pack::{Lexicon, Manifest, Pack};
use crate::random::step64;

/// Rows, columns and longest start of each call of the language model.
pub(super) type Calls = Arc<Mutex<Vec<(usize, usize, i64)>>>;

/// Networks of a pack whose skeleton has `joints` joints.
pub(super) struct Toy {
    pub shape: Shape,
    pub vocabulary: Vocabulary,
    pub joints: usize,
    pub motion_codes: u32,
    pub calls: Calls,
    /// The logit of the end: a large one ends replies early.
    pub end: f32,
    /// After this token, logits are not finite.
    pub broken: Option<u32>,
}

impl Toy {
    /// A code moves ahead by its number of centimetres a frame, and turns left by its number of
    /// hundredths of a radian.
    pub(super) fn decoded(&self, codes: &[u32]) -> Frames {
        let mut frames = Frames::default();
        let (mut x, mut z, mut heading) = (0.0_f32, 0.0_f32, 0.0_f32);
        for frame in 0..codes.len() * 4 {
            if frame > 0 {
                let code = codes[frame / 4] as f32;
                heading += 0.01 * code;
                x += 0.01 * code * heading.sin();
                z += 0.01 * code * heading.cos();
            }
            frames.root.extend([x, 0.9, z, heading.cos(), heading.sin()]);
            for _ in 0..self.joints {
                frames.pose.extend([0.0, 0.9, 0.0]);
                frames.pose.extend(six_d(yaw(heading)));
            }
        }
        assert_eq!(frames.pose.len(), frames.len() * self.joints * FEATURES_PER_JOINT);
        frames
    }
}

/// Whole numbers for a token at a position, as wide as a column.
fn column(token: i64, place: i64, width: usize) -> impl Iterator<Item = f32> {
    let key = step64(token as u64, place as u64);
    (0..width).map(move |n| (step64(key, n as u64) % 64) as f32)
}

impl Networks for Toy {
    fn language(&mut self, call: &LanguageCall<'_>, answer: &mut LanguageAnswer) -> Result<(), EngineError> {
        let Shape { heads, width, .. } = self.shape;
        let numbers = self.vocabulary.len();
        let longest = call.start.iter().max().copied().unwrap_or(0);
        self.calls
            .lock()
            .unwrap()
            .push((call.sequences, call.columns, longest));
        for row in 0..call.sequences {
            let (start, count) = (call.start[row] as usize, call.count[row] as usize);
            let mut sum = vec![0.0_f32; heads * width];
            for head in 0..heads {
                let cache = &call.cache[(row * heads + head) * call.cached * width..];
                for column in cache[..start * width].chunks_exact(width) {
                    for (sum, number) in sum[head * width..].iter_mut().zip(column) {
                        *sum += number;
                    }
                }
            }
            let mut last = 0;
            for place in 0..call.columns {
                let token = call.tokens[row * call.columns + place];
                for (n, number) in column(token, (start + place) as i64, heads * width).enumerate() {
                    let (head, within) = (n / width, n % width);
                    let to = ((row * heads + head) * call.columns + place) * width + within;
                    answer.columns[to] = number;
                    if place < count {
                        sum[n] += number;
                        last = token;
                    }
                }
            }
            let key = sum.iter().fold(0, |key, &number| step64(key, number as u64));
            let logits = &mut answer.logits[row * numbers..(row + 1) * numbers];
            for (token, logit) in logits.iter_mut().enumerate() {
                *logit = (step64(key, token as u64) % 1000) as f32 / 100.0;
            }
            logits[vocabulary::EOS as usize] = self.end;
            if self.broken == Some(last as u32) {
                logits.fill(f32::NAN);
            }
        }
        Ok(())
    }

    /// The code of a token: the distance from its first frame to its last, in centimetres.
    fn encode(&mut self, frames: &Frames) -> Result<Vec<u32>, EngineError> {
        let roots = frames.root.as_chunks::<5>().0;
        Ok(roots
            .chunks_exact(4)
            .map(|token| {
                let ahead = (token[3][0] - token[0][0]).hypot(token[3][2] - token[0][2]);
                ((ahead * 100.0 / 3.0).round() as u32) % self.motion_codes
            })
            .collect())
    }

    fn decode(&mut self, windows: &[&[u32]]) -> Result<Vec<Frames>, EngineError> {
        Ok(windows.iter().map(|codes| self.decoded(codes)).collect())
    }

    fn flow_width(&self) -> Option<usize> {
        Some(3)
    }

    /// The state goes to 1 in a straight line from any start. The height is the remaining distance.
    fn flow(&mut self, call: &FlowCall<'_>) -> Result<(Vec<f32>, Frames), EngineError> {
        let left = (1.0 - call.time).max(call.delta);
        let next: Vec<f32> = (call.state.iter())
            .map(|state| state + call.delta / left * (1.0 - state))
            .collect();
        let mut frames = self.decoded(call.codes);
        for (root, state) in frames.root.chunks_exact_mut(5).zip(next.chunks_exact(3)) {
            root[1] = state[0];
        }
        Ok((next, frames))
    }
}

/// The text pieces of a toy pack: letters, digits, and the mark before a word.
const PIECES: &str = r#"{
"version": "1.0", "truncation": null, "padding": null, "added_tokens": [], "post_processor": null,
"normalizer": {"type": "Sequence", "normalizers": [{"type": "Lowercase"},
    {"type": "Replace", "pattern": {"Regex": "[^a-z0-9]+"}, "content": " "},
    {"type": "Strip", "strip_left": true, "strip_right": true}]},
"pre_tokenizer": {"type": "Metaspace", "replacement": "▁", "prepend_scheme": "always", "split": true},
"decoder": {"type": "Metaspace", "replacement": "▁", "prepend_scheme": "always", "split": true},
"model": {"type": "BPE", "dropout": null, "unk_token": null, "continuing_subword_prefix": null, "end_of_word_suffix": null,
    "fuse_unk": false, "byte_fallback": false, "ignore_merges": false, "vocab": {VOCAB}, "merges": []}}"#;

/// Number of text pieces of a toy pack.
pub(super) const TEXT_PIECES: usize = 37;

/// The manifest of a toy pack.
pub(crate) const MANIFEST: &str = r#"
format = 2
family = "vermo"
name = "toy"
version = "1.0.0"
licence = "Apache-2.0"
fps = 30.0
frames_per_token = 4
min_tokens = 2
max_tokens = 16
context_frames = 16
parameters = 12
content_hash = "sha256:0000000000000000000000000000000000000000000000000000000000000000"

[capabilities]
text = true
describe = true
agents = true

[vermo]
layers = 2
key_heads = 1
head_width = 3
positions = 80
text_pieces = 37
motion_codes = 9
audio_codes = 5
tasks = ["text_to_motion", "motion_to_text", "inbetween", "continuation", "unconditional", "music_to_dance", "dance_to_music"]
max_prompt_pieces = 32
max_agents = 3
flow_steps = 4
temperature = 1.0
top_k = 0
top_p = 1.0
repetition = 1.0

[skeleton]
left_axis = [1.0, 0.0, 0.0]
[[skeleton.joints]]
name = "Hips"
parent = ""
offset_m = [0.0, 0.0, 0.0]
[[skeleton.joints]]
name = "Foot"
parent = "Hips"
offset_m = [0.0, -0.85, 0.0]
[skeleton.contacts]
joints = ["Foot"]
max_height_m = [0.1]
max_speed_mps = 0.5
clearance_m = [0.05]
"#;

/// The lexicon of a toy pack: it knows the words "walk" and "wave".
pub(crate) fn lexicon() -> Lexicon {
    let letters = "▁abcdefghijklmnopqrstuvwxyz0123456789".chars().enumerate();
    let vocab: Vec<String> = letters
        .map(|(id, letter)| format!("\"{letter}\": {id}"))
        .collect();
    let text = PIECES.replace("VOCAB", &vocab.join(", "));
    Lexicon::parse(&text, "walk\nwave\n", TEXT_PIECES).unwrap()
}

/// A toy pack, without files.
pub(super) fn pack() -> Pack {
    let mut pack = Pack::from_manifest(Manifest::parse(MANIFEST).unwrap(), Path::new("toy")).unwrap();
    pack.lexicon = Some(Arc::new(lexicon()));
    pack
}

/// The networks of a toy pack. A reply without a fixed length ends late.
pub(super) fn toy(pack: &Pack) -> Toy {
    let table = pack.manifest.vermo.as_ref().unwrap();
    Toy {
        shape: Shape::new(table),
        vocabulary: Vocabulary::new(table, pack.rig.dims.max_tokens),
        joints: pack.rig.dims.joints,
        motion_codes: table.motion_codes as u32,
        calls: Calls::default(),
        end: 9.0,
        broken: None,
    }
}
