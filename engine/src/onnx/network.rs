//! A stage's networks on one lane: one session for all shapes, or one for each.
//!
//! OpenVINO computes a graph whose shape is fixed in 20 to 45 % less time than one that takes any. And a graph that takes any
//! pays 0.7 to 2 ms whenever its shape is not that of the call before, which with callers who come and go is nearly always. So there
//! is a session for each size of a [call](Calls) and each length, a batch is run in several calls, and warm-up opens them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use ort::session::{Session, SessionInputValue, SessionOutputs};
use ort::value::{TensorRef, ValueType};
use troupe_motion::model::Dims;

use super::calls::Calls;
use super::session::{self, FixedAxis};
use super::{Runtime, SessionOptions, run_error};
use crate::EngineError;
use crate::pack::Stage;
use crate::specs::{StageTensors as _, TensorSpec, TensorType};

/// The inputs of one call.
pub(super) type Inputs<'a> = Vec<(Cow<'a, str>, SessionInputValue<'a>)>;

/// A stage's sessions.
pub(super) enum Network {
    /// One that takes every shape.
    Open(Session),
    /// One for each shape.
    Fixed(Box<FixedNetworks>),
}

impl Network {
    /// Runs `rows` rows of `length` tokens, in one call or several. `inputs` gives those of a call for its rows, of which the
    /// last may be padding, and `read` takes its outputs.
    pub(super) fn run<'i>(
        &mut self,
        stage: Stage,
        rows: usize,
        length: usize,
        inputs: impl Fn(Range<usize>) -> ort::Result<Inputs<'i>>,
        mut read: impl FnMut(Range<usize>, &SessionOutputs<'_>) -> Result<(), EngineError>,
    ) -> Result<(), EngineError> {
        let mut done = 0;
        while done < rows {
            let (size, session) = match self {
                Self::Open(session) => (rows, session),
                Self::Fixed(networks) => networks.next_call(length, rows - done)?,
            };
            let call = done..done + size;
            let outputs = inputs(call.clone())
                .and_then(|inputs| session.run(inputs))
                .map_err(|error| run_error(stage, &error))?;
            read(call, &outputs)?;
            done += size;
        }
        Ok(())
    }
}

/// A stage's sessions of fixed shapes, opened when a call of their shape is first made.
pub(super) struct FixedNetworks {
    graph: Graph,
    lengths: BTreeMap<usize, OfLength>,
}

impl FixedNetworks {
    /// For a graph with open axes, of which `open` is a session; none where it does not name them all.
    pub(super) fn new(
        runtime: &Runtime,
        options: SessionOptions,
        file: PathBuf,
        stage: Stage,
        dims: Dims,
        open: &Session,
    ) -> Option<Self> {
        let graph = Graph {
            runtime: runtime.clone(),
            options,
            file,
            stage,
            dims,
            axes: OpenAxes::of(&dims.inputs(stage), open)?,
        };
        Some(Self {
            graph,
            lengths: BTreeMap::new(),
        })
    }

    /// The rows of the next call where so many are left, and its session.
    fn next_call(&mut self, length: usize, rows: usize) -> Result<(usize, &mut Session), EngineError> {
        let of_length = self.lengths.entry(length).or_insert_with(|| OfLength {
            length,
            calls: Calls::new(),
            sessions: BTreeMap::new(),
        });
        of_length.next_call(&self.graph, rows)
    }
}

/// What sessions are opened of.
struct Graph {
    runtime: Runtime,
    options: SessionOptions,
    file: PathBuf,
    stage: Stage,
    dims: Dims,
    axes: OpenAxes,
}

impl Graph {
    fn open(&self, length: usize, rows: usize) -> Result<Session, EngineError> {
        let axes = self.axes.fixed(rows, length, self.dims.max_tokens);
        session::open(&self.runtime, self.options, &self.file, &axes).map_err(|reason| EngineError::Load {
            file: self.stage.file_name(),
            reason,
        })
    }
}

/// The sessions of one length.
struct OfLength {
    length: usize,
    calls: Calls,
    /// By rows of a call.
    sessions: BTreeMap<usize, Session>,
}

impl OfLength {
    fn next_call(&mut self, graph: &Graph, rows: usize) -> Result<(usize, &mut Session), EngineError> {
        let mut size = self.calls.next(rows);
        while !self.sessions.contains_key(&size) {
            let mut session = graph.open(self.length, size)?;
            if size == 1 || self.gives_the_same_alone(graph, size, &mut session)? {
                self.sessions.insert(size, session);
            } else {
                self.forbid(graph.stage, size);
                size = self.calls.next(rows);
            }
        }
        let session = self.sessions.get_mut(&size);
        session.map(|session| (size, session)).ok_or(EngineError::Stopped)
    }

    /// Whether a row of such a call is, bit for bit, what it is alone: a CPU may have other instructions for larger products.
    fn gives_the_same_alone(
        &mut self,
        graph: &Graph,
        size: usize,
        session: &mut Session,
    ) -> Result<bool, EngineError> {
        let sample = Sample::new(&graph.dims, graph.stage, self.length, size);
        let alone = self.next_call(graph, 1)?.1;
        let same = sample.same_alone(session, alone);
        same.map_err(|error| run_error(graph.stage, &error))
    }

    /// No more calls of so many rows, nor of more: slower, but never wrong. OpenVINO has bugs that show so too.
    fn forbid(&mut self, stage: Stage, size: usize) {
        let (stage, length) = (stage.name(), self.length);
        tracing::warn!(
            stage,
            length,
            rows = size,
            "rows of such a call are not what they are alone: batches are run in smaller ones, which is slower"
        );
        self.calls.forbid(size);
        self.sessions.retain(|&rows, _| rows < size);
    }
}

/// The names of a graph's open axes, with their length at the longest segment; the batch has none.
struct OpenAxes(BTreeMap<String, Option<usize>>);

impl OpenAxes {
    fn of(inputs: &[TensorSpec], graph: &Session) -> Option<Self> {
        let mut axes = BTreeMap::new();
        for outlet in graph.inputs() {
            let spec = inputs.iter().find(|spec| spec.name == outlet.name())?;
            let ValueType::Tensor {
                shape,
                dimension_symbols,
                ..
            } = outlet.dtype()
            else {
                return None;
            };
            for (axis, name) in dimension_symbols.iter().enumerate() {
                if shape.get(axis) == Some(&-1) {
                    let longest = axis.checked_sub(1).and_then(|axis| spec.shape.get(axis)).copied();
                    axes.insert(Some(name.clone()).filter(|name| !name.is_empty())?, longest);
                }
            }
        }
        Some(Self(axes))
    }

    fn fixed(&self, rows: usize, length: usize, max_tokens: usize) -> Vec<FixedAxis<'_>> {
        let size = |longest: &Option<usize>| longest.map_or(rows, |longest| longest * length / max_tokens);
        let axes = self.0.iter();
        axes.map(|(name, longest)| FixedAxis {
            name,
            size: size(longest),
        })
        .collect()
    }
}

/// Made-up inputs of a call, other ones in each row.
struct Sample {
    rows: usize,
    tensors: Vec<(TensorSpec, Numbers)>,
    outputs: Vec<TensorSpec>,
}

enum Numbers {
    F32(Vec<f32>),
    I64(Vec<i64>),
}

impl Sample {
    fn new(dims: &Dims, stage: Stage, length: usize, rows: usize) -> Self {
        let tensors = dims.inputs(stage).into_iter().map(|mut spec| {
            if spec.open_time {
                spec.shape[0] = spec.shape[0] * length / dims.max_tokens;
            }
            let count = rows * spec.row();
            let mixed = (0..count).map(|index| index * 7919 % 2003);
            let numbers = match (spec.ty, spec.name) {
                (TensorType::I64, "num_tokens") => Numbers::I64(vec![length as i64; count]),
                (TensorType::I64, _) => Numbers::I64(mixed.map(|n| (n % dims.codes) as i64).collect()),
                (TensorType::F32, "allowed_counts") => Numbers::F32(vec![1.0; count]),
                (TensorType::F32, name) if name.starts_with("has_") || name == "frame_mask" => {
                    Numbers::F32(mixed.map(|n| (n % 2) as f32).collect())
                }
                (TensorType::F32, _) => Numbers::F32(mixed.map(|n| n as f32 / 1001.5 - 1.0).collect()),
            };
            (spec, numbers)
        });
        Self {
            rows,
            tensors: tensors.collect(),
            outputs: dims.outputs(stage),
        }
    }

    /// Whether all rows in one call of `together` give what each gives in a call of `alone`.
    fn same_alone(&self, together: &mut Session, alone: &mut Session) -> ort::Result<bool> {
        let together = self.run(together, 0, self.rows)?;
        for row in 0..self.rows {
            let alone = self.run(alone, row, 1)?;
            let same = together.iter().zip(&alone).all(|(together, alone)| {
                let width = alone.len();
                together.get(row * width..(row + 1) * width) == Some(alone)
            });
            if !same {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The bits of every output of the call for `rows` rows from `first` on.
    fn run(&self, session: &mut Session, first: usize, rows: usize) -> ort::Result<Vec<Vec<u64>>> {
        let inputs = self.tensors.iter().map(|(spec, numbers)| {
            let shape: Vec<usize> = std::iter::once(rows).chain(spec.shape.iter().copied()).collect();
            let part = first * spec.row()..(first + rows) * spec.row();
            let value: SessionInputValue<'_> = match numbers {
                Numbers::F32(numbers) => TensorRef::from_array_view((shape, &numbers[part]))?.into(),
                Numbers::I64(numbers) => TensorRef::from_array_view((shape, &numbers[part]))?.into(),
            };
            Ok((Cow::Borrowed(spec.name), value))
        });
        let outputs = session.run(inputs.collect::<ort::Result<Inputs<'_>>>()?)?;
        let bits = self.outputs.iter().filter_map(|spec| {
            let value = outputs.get(spec.name)?;
            Some(match spec.ty {
                TensorType::F32 => value
                    .try_extract_tensor::<f32>()
                    .map(|(_, data)| data.iter().map(|x| u64::from(x.to_bits())).collect()),
                TensorType::I64 => value
                    .try_extract_tensor::<i64>()
                    .map(|(_, data)| data.iter().map(|&x| x as u64).collect()),
            })
        });
        bits.collect()
    }
}
