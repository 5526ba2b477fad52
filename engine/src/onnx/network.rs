//! A stage's networks as a worker sees them: one session for all shapes, or one network for each.
//!
//! OpenVINO computes a graph of fixed shape in 20 to 45 % less time than one for all shapes. The
//! latter also takes 0.7 to 2 ms longer whenever its shape differs from the call before, which is
//! almost always with changing callers. So there is a network for each size of a
//! [call](super::calls::Calls) and each length. A batch runs in several calls, and the
//! [pool](NetworkPool) keeps the open networks.

use std::borrow::Cow;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::Range;
use std::sync::Arc;

use ort::session::{Session, SessionInputValue, SessionOutputs};
use ort::value::{PrimitiveTensorElementType, TensorRef};

use super::openvino::{Compiled, Element};
use super::pool::{Graph, NetworkPool};
use super::{Growth, exit, one_line, run_error};
use crate::EngineError;
use crate::tensors::ROOM_MULTIPLE;
use troupe_motion::model::Dims;

use crate::pack::Stage;
use crate::specs::{StageTensors as _, TensorSpec, TensorType};

/// The inputs of one call, by name.
pub(super) type Inputs<'a> = Vec<(&'static str, View<'a>)>;

/// A tensor that borrows its numbers.
pub(super) struct View<'a> {
    shape: Vec<usize>,
    numbers: Numbers<'a>,
}

enum Numbers<'a> {
    F32(&'a [f32]),
    I64(&'a [i64]),
}

/// The type of a tensor's numbers.
pub(super) trait Number: Element + PrimitiveTensorElementType + Default {
    fn view(shape: Vec<usize>, numbers: &[Self]) -> View<'_>;
}

impl Number for f32 {
    fn view(shape: Vec<usize>, numbers: &[Self]) -> View<'_> {
        let numbers = Numbers::F32(numbers);
        View { shape, numbers }
    }
}

impl Number for i64 {
    fn view(shape: Vec<usize>, numbers: &[Self]) -> View<'_> {
        let numbers = Numbers::I64(numbers);
        View { shape, numbers }
    }
}

/// The outputs of a call.
pub(super) enum Given<'a, 's> {
    Session(&'a SessionOutputs<'s>),
    Compiled(&'a Compiled),
}

impl<'a> Given<'a, '_> {
    pub(super) fn get<T: Number>(&self, name: &str) -> Result<&'a [T], String> {
        match self {
            Self::Session(outputs) => {
                let value = outputs.get(name).ok_or_else(|| format!("no {name}"))?;
                let tensor = value
                    .try_extract_tensor::<T>()
                    .map_err(|error| one_line(&error))?;
                Ok(tensor.1)
            }
            Self::Compiled(network) => network.get(name),
        }
    }
}

/// The network or networks that run a stage.
pub(super) enum Network {
    /// A session for all shapes.
    Open(Session),
    /// A network for each shape.
    Fixed(FixedNetworks),
}

/// A stage's networks of fixed shapes.
pub(super) struct FixedNetworks {
    pub(super) pool: NetworkPool,
    pub(super) graph: Arc<Graph>,
    pub(super) growth: Growth,
}

impl Network {
    /// Runs `rows` rows of `length` tokens in one call or several. `inputs` returns a call's inputs
    /// for its rows, the last of which may be padding. `read` takes the call's outputs.
    pub(super) fn run<'i>(
        &mut self,
        stage: Stage,
        rows: usize,
        length: usize,
        inputs: impl Fn(Range<usize>) -> Inputs<'i>,
        mut read: impl FnMut(Range<usize>, &Given<'_, '_>) -> Result<(), EngineError>,
    ) -> Result<(), EngineError> {
        match self {
            Self::Open(session) => {
                let inputs = inputs(0..rows).into_iter().map(|(name, view)| {
                    let shape = view.shape;
                    let value: SessionInputValue<'_> = match view.numbers {
                        Numbers::F32(numbers) => TensorRef::from_array_view((shape, numbers))?.into(),
                        Numbers::I64(numbers) => TensorRef::from_array_view((shape, numbers))?.into(),
                    };
                    Ok((Cow::Borrowed(name), value))
                });
                let inputs = inputs.collect::<ort::Result<Vec<(Cow<'_, str>, SessionInputValue<'_>)>>>();
                let _call = exit::enter();
                let outputs = inputs
                    .and_then(|inputs| session.run(inputs))
                    .map_err(|error| run_error(stage, &error))?;
                read(0..rows, &Given::Session(&outputs))
            }
            Self::Fixed(networks) => {
                let (mut done, room) = (0, rows.next_multiple_of(ROOM_MULTIPLE));
                while done < rows {
                    let left = (rows - done, room - done);
                    let mut borrowed =
                        networks
                            .pool
                            .borrow(&networks.graph, length, left, networks.growth)?;
                    let call = done..done + borrowed.rows();
                    let network = borrowed.network()?;
                    run_call(network, &inputs(call.clone())).map_err(|error| run_error(stage, &error))?;
                    done = call.end;
                    read(call, &Given::Compiled(network))?;
                }
                Ok(())
            }
        }
    }
}

fn run_call(network: &mut Compiled, inputs: &Inputs<'_>) -> Result<(), String> {
    for (name, view) in inputs {
        match &view.numbers {
            Numbers::F32(numbers) => network.set(name, numbers)?,
            Numbers::I64(numbers) => network.set(name, numbers)?,
        }
    }
    network.infer()
}

/// Artificial inputs of a call, different in each row. A row is the same in larger samples.
pub(super) struct Sample {
    tensors: Vec<(TensorSpec, Made)>,
    outputs: Vec<TensorSpec>,
}

enum Made {
    F32(Vec<f32>),
    I64(Vec<i64>),
}

impl Sample {
    pub(super) fn new(dims: &Dims, stage: Stage, length: usize, rows: usize) -> Self {
        let tensors = dims.inputs(stage).into_iter().map(|mut spec| {
            if spec.open_time {
                spec.shape[0] = spec.shape[0] * length / dims.max_tokens;
            }
            let count = rows * spec.row();
            let mixed = (0..count).map(|index| index * 7919 % 2003);
            let numbers = match (spec.ty, spec.name) {
                (TensorType::I64, "num_tokens") => Made::I64(vec![length as i64; count]),
                (TensorType::I64, _) => Made::I64(mixed.map(|n| (n % dims.codes) as i64).collect()),
                (TensorType::F32, "allowed_counts") => Made::F32(vec![1.0; count]),
                (TensorType::F32, name) if name.starts_with("has_") || name == "frame_mask" => {
                    Made::F32(mixed.map(|n| (n % 2) as f32).collect())
                }
                (TensorType::F32, _) => Made::F32(mixed.map(|n| n as f32 / 1001.5 - 1.0).collect()),
            };
            (spec, numbers)
        });
        Self {
            tensors: tensors.collect(),
            outputs: dims.outputs(stage),
        }
    }

    /// Runs a call for these rows. Returns a hash of the bits of all outputs for each row.
    pub(super) fn run(&self, network: &mut Compiled, rows: Range<usize>) -> Result<Vec<u64>, String> {
        let inputs = self.tensors.iter().map(|(spec, numbers)| {
            let part = rows.start * spec.row()..rows.end * spec.row();
            let numbers = match numbers {
                Made::F32(numbers) => Numbers::F32(&numbers[part]),
                Made::I64(numbers) => Numbers::I64(&numbers[part]),
            };
            let shape = Vec::new();
            (spec.name, View { shape, numbers })
        });
        run_call(network, &inputs.collect())?;
        let mut hashes = vec![DefaultHasher::new(); rows.len()];
        for spec in &self.outputs {
            match spec.ty {
                TensorType::F32 => {
                    let numbers = network.get::<f32>(spec.name)?;
                    let bits: Vec<u64> = numbers.iter().map(|x| u64::from(x.to_bits())).collect();
                    hash_rows(&mut hashes, &bits);
                }
                TensorType::I64 => {
                    let numbers = network.get::<i64>(spec.name)?;
                    let bits: Vec<u64> = numbers.iter().map(|&x| x as u64).collect();
                    hash_rows(&mut hashes, &bits);
                }
            }
        }
        Ok(hashes.iter().map(DefaultHasher::finish).collect())
    }
}

fn hash_rows(hashes: &mut [DefaultHasher], bits: &[u64]) {
    let width = bits.len() / hashes.len();
    for (hash, row) in hashes.iter_mut().zip(bits.chunks(width.max(1))) {
        row.hash(hash);
    }
}
