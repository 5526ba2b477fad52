//! How far an engine's answers are from the reference's: f32 on ONNX Runtime's own CPU kernels.
//!
//! Both engines run every stage on the same inputs, which the reference makes. Otherwise a small
//! difference in one stage could grow in the next. The tasks are the pack's own motion, see
//! [`probe`].

mod bars;
mod paths;
mod probe;

use troupe_motion::fk::{local_from_world_rotations, world_transforms};
use troupe_motion::model::{Dims, GLOBAL_ROOT, KeyframeTask, SIX_D};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::from_six_ds;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::fill::FillRows as _;
use super::sampling::fill_root_noise;
use super::{
    DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, Stages, TokenInput, length_of, lengths,
};
use crate::pack::Pack;

pub use bars::Bar;
pub use paths::{compare_paths, compare_planners};
pub use probe::{PROBE_BATCH, Probe, probe};

/// Contact probability from which on there is contact.
const CONTACT: f32 = 0.5;

/// What is compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The stages of MotionBricks, each with the reference's inputs.
    #[default]
    Stages,
    /// Whole motions along paths. Lengths are those of bodies scaled to a size of 1 m.
    Paths,
}

/// Distance of an engine from the reference over the tasks of a probe. A figure that the family
/// does not have is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Accuracy {
    /// What was compared.
    pub kind: Kind,
    /// Number of characters compared.
    pub characters: usize,
    /// Share of characters whose root stage chose another token count.
    pub counts_differ: f64,
    /// Mean distance of roots (r_g3), metres.
    pub root_mean_m: f64,
    /// Largest distance of roots, metres.
    pub root_max_m: f64,
    /// Largest difference in the heading of roots, radians.
    pub root_max_rad: f64,
    /// Share of pose tokens with another most likely code.
    pub tokens_differ: f64,
    /// Loss of those codes in the reference: mean log-probability a token, nats.
    pub token_loss_nats: f64,
    /// Mean distance of joints in the world, metres: from root and rotations by forward kinematics.
    pub joint_mean_m: f64,
    /// Largest distance of joints in the world, metres.
    pub joint_max_m: f64,
    /// Share of contacts that differ from the reference.
    pub contacts_differ: f64,
}

/// Compares `candidate` with `reference` on batches of tasks. All tasks of a batch have one segment
/// length.
///
/// # Errors
/// [`EngineError`] if a stage of either fails.
pub fn compare(
    pack: &Pack,
    reference: &mut dyn Stages,
    candidate: &mut dyn Stages,
    batches: &[Vec<KeyframeTask>],
) -> Result<Accuracy, EngineError> {
    let mut sums = Sums::default();
    for items in batches {
        let mut pair = Pair::new(pack, items.len(), reference, candidate);
        let counts = pair.compare_roots(items, &mut sums)?;
        pair.compare_tokens(items, counts, &mut sums)?;
        pair.compare_frames(counts, &mut sums)?;
    }
    Ok(sums.accuracy())
}

/// Running sums of all comparisons.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    counts: Share,
    root: Distance,
    root_max_rad: f64,
    tokens: Share,
    token_loss: f64,
    joints: Distance,
    contacts: Share,
}

impl Sums {
    fn accuracy(&self) -> Accuracy {
        Accuracy {
            kind: Kind::Stages,
            characters: self.counts.of,
            counts_differ: self.counts.share(),
            root_mean_m: self.root.mean(),
            root_max_m: self.root.max,
            root_max_rad: self.root_max_rad,
            tokens_differ: self.tokens.share(),
            token_loss_nats: self.token_loss / self.tokens.of.max(1) as f64,
            joint_mean_m: self.joints.mean(),
            joint_max_m: self.joints.max,
            contacts_differ: self.contacts.share(),
        }
    }
}

/// A share: how many of how many differ.
#[derive(Debug, Clone, Copy, Default)]
struct Share {
    differ: usize,
    of: usize,
}

impl Share {
    fn add(&mut self, differs: bool) {
        self.differ += usize::from(differs);
        self.of += 1;
    }

    fn share(self) -> f64 {
        self.differ as f64 / self.of.max(1) as f64
    }
}

/// Mean and largest of many distances. A distance that is not a number makes both infinite.
#[derive(Debug, Clone, Copy, Default)]
struct Distance {
    sum: f64,
    max: f64,
    of: usize,
}

impl Distance {
    fn add(&mut self, distance: f32) {
        let distance = finite_or_huge(distance);
        self.sum += distance;
        self.max = self.max.max(distance);
        self.of += 1;
    }

    fn mean(self) -> f64 {
        self.sum / self.of.max(1) as f64
    }
}

fn finite_or_huge(value: f32) -> f64 {
    if value.is_finite() {
        f64::from(value)
    } else {
        f64::INFINITY
    }
}

/// Two engines side by side, with the memory for one batch.
struct Pair<'a> {
    skeleton: &'a Skeleton,
    dims: Dims,
    rows: usize,
    reference: &'a mut dyn Stages,
    candidate: &'a mut dyn Stages,
    root_input: RootInput,
    token_input: TokenInput,
    roots: [RootOutput; 2],
    poses: [PoseOutput; 2],
    frames: [DecoderOutput; 2],
}

impl<'a> Pair<'a> {
    fn new(
        pack: &'a Pack,
        rows: usize,
        reference: &'a mut dyn Stages,
        candidate: &'a mut dyn Stages,
    ) -> Self {
        let dims = pack.rig.dims;
        Self {
            skeleton: &pack.rig.skeleton,
            dims,
            rows,
            reference,
            candidate,
            root_input: RootInput::new(&dims, rows),
            token_input: TokenInput::new(&dims, rows),
            roots: [RootOutput::new(&dims, rows), RootOutput::new(&dims, rows)],
            poses: [PoseOutput::new(&dims, rows), PoseOutput::new(&dims, rows)],
            frames: [DecoderOutput::new(&dims, rows), DecoderOutput::new(&dims, rows)],
        }
    }

    fn run_roots(&mut self) -> Result<(), EngineError> {
        let [reference, candidate] = &mut self.roots;
        self.reference.root(self.rows, &self.root_input, reference)?;
        self.candidate.root(self.rows, &self.root_input, candidate)
    }

    /// Compares token counts, with every count allowed, then trajectories at the tasks' own length.
    /// These are the likeliest, and, if the pack samples them, sampled ones too. Returns the length
    /// in tokens.
    fn compare_roots(&mut self, items: &[KeyframeTask], sums: &mut Sums) -> Result<usize, EngineError> {
        let dims = self.dims;
        for (row, item) in items.iter().enumerate() {
            item.fill_root_input(&dims, row, &mut self.root_input);
            self.root_input.allowed_counts.fill_row(row, 1.0);
        }
        self.run_roots()?;
        for row in 0..self.rows {
            let [reference, candidate] = &self.roots;
            sums.counts
                .add(reference.num_tokens.row(row) != candidate.num_tokens.row(row));
        }
        let tokens = items
            .first()
            .and_then(|item| item.frames)
            .map_or(dims.max_tokens, |frames| dims.tokens_for(frames));
        // The likeliest trajectories come last, because the rest is compared on them.
        let temperatures: &[f32] = if dims.root_choices > 0 {
            &[1.0, 0.0]
        } else {
            &[0.0]
        };
        for &temperature in temperatures {
            for (row, item) in items.iter().enumerate() {
                item.fill_root_input(&dims, row, &mut self.root_input);
                fill_root_noise(item.seed, temperature, self.root_input.root_noise.row_mut(row));
            }
            self.run_roots()?;
            self.compare_trajectories(tokens, sums);
        }
        Ok(tokens)
    }

    /// Compares what the root stages just gave, over `tokens` tokens.
    fn compare_trajectories(&self, tokens: usize, sums: &mut Sums) {
        for row in 0..self.rows {
            let frames = tokens * self.dims.frames_per_token;
            let [reference, candidate] = &self.roots;
            let pairs = global_roots(reference.global_root.row(row))
                .zip(global_roots(candidate.global_root.row(row)))
                .take(frames);
            for (a, b) in pairs {
                sums.root.add(a.position.distance(b.position));
                let turn = finite_or_huge(wrap_angle(a.heading - b.heading).abs());
                sums.root_max_rad = sums.root_max_rad.max(turn);
            }
        }
    }

    /// Compares the most likely code of every token, all tokens masked, on the reference's
    /// trajectory.
    fn compare_tokens(
        &mut self,
        items: &[KeyframeTask],
        tokens: usize,
        sums: &mut Sums,
    ) -> Result<(), EngineError> {
        let dims = self.dims;
        let any = self.reference.any_length() && self.candidate.any_length();
        let length = length_of(&lengths(&dims, any), tokens);
        self.token_input.set_length(&dims, length);
        for index in 0..2 {
            self.poses[index].set_length(&dims, length);
            self.frames[index].set_length(&dims, length);
        }
        for (row, item) in items.iter().enumerate() {
            let trajectory = self.roots[0].global_root.row(row);
            item.fill_token_input(&dims, row, tokens, trajectory, &mut self.token_input);
        }
        let [reference, candidate] = &mut self.poses;
        self.reference.pose(self.rows, &self.token_input, reference)?;
        self.candidate.pose(self.rows, &self.token_input, candidate)?;
        for row in 0..self.rows {
            let [reference, candidate] = &self.poses;
            let heads = tokens * dims.heads;
            let pairs = reference
                .logits
                .row(row)
                .chunks_exact(dims.codes)
                .zip(candidate.logits.row(row).chunks_exact(dims.codes))
                .take(heads);
            for (head, (a, b)) in pairs.enumerate() {
                let (best, other) = (most_likely(a), most_likely(b));
                sums.tokens.add(best != other);
                // The logits of a token differ from its log-probabilities by one constant.
                sums.token_loss += finite_or_huge(a[best] - a[other]);
                self.token_input.tokens.row_mut(row)[head] = best as i64;
            }
        }
        Ok(())
    }

    /// Compares the frames of the reference's tokens.
    fn compare_frames(&mut self, tokens: usize, sums: &mut Sums) -> Result<(), EngineError> {
        let [reference, candidate] = &mut self.frames;
        self.reference.decoder(self.rows, &self.token_input, reference)?;
        self.candidate.decoder(self.rows, &self.token_input, candidate)?;
        let frames = tokens * self.dims.frames_per_token;
        let mut poses = [Joints::new(self.skeleton), Joints::new(self.skeleton)];
        for row in 0..self.rows {
            for frame in 0..frames {
                for (joints, output) in poses.iter_mut().zip(&self.frames) {
                    joints.place(self.skeleton, &self.dims, output, row, frame);
                }
                let [a, b] = &poses;
                for (a, b) in a.positions.iter().zip(&b.positions) {
                    sums.joints.add(a.distance(*b));
                }
            }
            let [a, b] = &self.frames;
            let contacts = a.contacts.row(row).iter().zip(b.contacts.row(row));
            for (a, b) in contacts.take(frames * self.dims.contacts) {
                sums.contacts.add((*a >= CONTACT) != (*b >= CONTACT));
            }
        }
        Ok(())
    }
}

/// Index of the largest value; the first of several, 0 without values.
fn most_likely(logits: &[f32]) -> usize {
    let mut best = 0;
    for (index, value) in logits.iter().enumerate() {
        if *value > logits[best] {
            best = index;
        }
    }
    best
}

fn global_roots(values: &[f32]) -> impl Iterator<Item = GlobalRoot> {
    values
        .chunks_exact(GLOBAL_ROOT)
        .map(|r| GlobalRoot::from_array([r[0], r[1], r[2], r[3], r[4]]))
}

/// World positions and rotations of one pose of the decoder.
struct Joints {
    local: Vec<Quat>,
    rotations: Vec<Quat>,
    positions: Vec<Vec3>,
}

impl Joints {
    fn new(skeleton: &Skeleton) -> Self {
        let joints = skeleton.joint_count();
        Self {
            local: vec![Quat::IDENTITY; joints],
            rotations: vec![Quat::IDENTITY; joints],
            positions: vec![Vec3::ZERO; joints],
        }
    }

    /// Places the joints as in one frame of one row.
    fn place(&mut self, skeleton: &Skeleton, dims: &Dims, output: &DecoderOutput, row: usize, frame: usize) {
        let width = dims.joints * SIX_D;
        let six_d = &output.rotations.row(row)[frame * width..(frame + 1) * width];
        from_six_ds(six_d, &mut self.rotations);
        local_from_world_rotations(skeleton, &self.rotations, &mut self.local);
        let root = &output.global_root.row(row)[frame * GLOBAL_ROOT..];
        let root = Vec3::new(root[0], root[1], root[2]);
        world_transforms(
            skeleton,
            root,
            &self.local,
            &mut self.positions,
            &mut self.rotations,
        );
    }
}
