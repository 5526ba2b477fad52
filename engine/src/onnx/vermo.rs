//! The networks of a VerMo pack on ONNX Runtime: one session for each, for all shapes.

use std::borrow::Cow;

use ort::session::{Session, SessionInputValue, SessionOutputs};
use ort::value::{PrimitiveTensorElementType, TensorElementType, TensorRef, ValueType};
use troupe_motion::model::GLOBAL_ROOT;

use super::outlets::{OPEN, Wanted, check};
use super::{Runtime, SessionOptions, exit, one_line, session};
use crate::EngineError;
use crate::pack::{DECODER_FILE, ENCODER_FILE, FLOW_FILE, FRAMES_PER_TOKEN, LANGUAGE_FILE, Pack, VerMoDoc};
use crate::vermo::{FlowCall, Frames, LanguageAnswer, LanguageCall, Networks, Vocabulary};

/// The sessions of one worker.
pub struct OnnxVerMo {
    language: Graph,
    encoder: Graph,
    decoder: Graph,
    /// The flow decoder, with the numbers a frame in its state.
    flow: Option<(Graph, usize)>,
    table: VerMoDoc,
    /// Numbers a frame in the pose feature.
    pose: usize,
}

/// One network with its session.
struct Graph {
    file: &'static str,
    session: Session,
}

/// The inputs of a call, by name.
type Inputs<'a> = Vec<(Cow<'a, str>, SessionInputValue<'a>)>;

impl OnnxVerMo {
    /// Loads the networks of `pack`, and checks their tensors.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`]; [`EngineError::WrongTask`] for a pack
    /// of another family.
    pub fn load(runtime: &Runtime, pack: &Pack, options: SessionOptions) -> Result<Self, EngineError> {
        use TensorElementType::{Float32, Int64};
        let table = pack.manifest.vermo.clone().ok_or(EngineError::WrongTask)?;
        let vocabulary = Vocabulary::new(&table, pack.rig.dims.max_tokens).len();
        let pose = pack.rig.dims.pose();
        let [layers, heads, width] =
            [table.layers, table.key_heads, table.head_width].map(|size| size as i64);
        let open = |file| Graph::load(runtime, pack, options, file);
        let columns = [OPEN, layers, 2, heads, OPEN, width];
        let language = open(LANGUAGE_FILE)?.checked(
            &[
                ("tokens", Int64, &[OPEN, OPEN]),
                ("count", Int64, &[OPEN]),
                ("start", Int64, &[OPEN]),
                ("cache", Float32, &columns),
            ],
            &[
                ("logits", Float32, &[OPEN, vocabulary as i64]),
                ("columns", Float32, &columns),
            ],
        )?;
        let tokens: Wanted<'_> = ("tokens", Int64, &[OPEN, OPEN]);
        let frames: [Wanted<'_>; 2] = [
            ("pose", Float32, &[OPEN, OPEN, pose as i64]),
            ("root", Float32, &[OPEN, OPEN, GLOBAL_ROOT as i64]),
        ];
        let encoder = open(ENCODER_FILE)?.checked(&frames, &[tokens])?;
        let decoder = open(DECODER_FILE)?.checked(&[tokens], &frames)?;
        let flow = match table.flow_steps {
            0 => None,
            _ => {
                let graph = open(FLOW_FILE)?;
                let width = graph.width("state")?;
                let state: Wanted<'_> = ("state", Float32, &[OPEN, OPEN, width as i64]);
                let (time, delta) = (("time", Float32, &[OPEN][..]), ("delta", Float32, &[OPEN][..]));
                let next: Wanted<'_> = ("next", state.1, state.2);
                let graph = graph.checked(&[tokens, state, time, delta], &[next, frames[0], frames[1]])?;
                Some((graph, width))
            }
        };
        Ok(Self {
            language,
            encoder,
            decoder,
            flow,
            pose,
            table,
        })
    }
}

impl Graph {
    fn load(
        runtime: &Runtime,
        pack: &Pack,
        options: SessionOptions,
        file: &'static str,
    ) -> Result<Self, EngineError> {
        let session = session::open(runtime, options, &pack.folder.join(file), None)
            .map_err(|reason| EngineError::Load { file, reason })?;
        Ok(Self { file, session })
    }

    fn checked(self, inputs: &[Wanted<'_>], outputs: &[Wanted<'_>]) -> Result<Self, EngineError> {
        match check((inputs, outputs), self.session.inputs(), self.session.outputs()) {
            Ok(()) => Ok(self),
            Err(problem) => Err(EngineError::Signature {
                file: self.file,
                problem,
            }),
        }
    }

    /// Length of an input's last axis.
    fn width(&self, input: &str) -> Result<usize, EngineError> {
        let outlet = self.session.inputs().iter().find(|outlet| outlet.name() == input);
        let axis = match outlet.map(|outlet| outlet.dtype()) {
            Some(ValueType::Tensor { shape, .. }) => shape.last().copied(),
            _ => None,
        };
        let axis = axis
            .and_then(|axis| usize::try_from(axis).ok())
            .filter(|&axis| axis > 0);
        axis.ok_or_else(|| EngineError::Signature {
            file: self.file,
            problem: format!("the input {input} has no width"),
        })
    }

    /// Runs the network on the tensors that `inputs` makes, and passes the outputs to `read`.
    fn run<'a, T>(
        &mut self,
        inputs: Result<Inputs<'a>, String>,
        read: impl FnOnce(&Outputs<'_, '_>) -> Result<T, String>,
    ) -> Result<T, EngineError> {
        let file = self.file;
        let run = || {
            let _call = exit::enter();
            let outputs = self.session.run(inputs?).map_err(|error| one_line(&error))?;
            read(&Outputs(&outputs))
        };
        run().map_err(|problem| EngineError::Network { file, problem })
    }
}

/// The outputs of a call.
struct Outputs<'a, 's>(&'a SessionOutputs<'s>);

impl Outputs<'_, '_> {
    fn get<T: PrimitiveTensorElementType>(&self, name: &str, wanted: usize) -> Result<&[T], String> {
        let value = self.0.get(name).ok_or_else(|| format!("it gave no {name}"))?;
        let (_, found) = value
            .try_extract_tensor::<T>()
            .map_err(|error| one_line(&error))?;
        match found.len() == wanted {
            true => Ok(found),
            false => Err(format!(
                "it gave {name} of {} elements, expected {wanted}",
                found.len()
            )),
        }
    }

    fn frames(&self, count: usize, pose: usize) -> Result<Frames, String> {
        Ok(Frames {
            pose: self.get("pose", count * pose)?.to_vec(),
            root: self.get("root", count * GLOBAL_ROOT)?.to_vec(),
        })
    }
}

/// A tensor that borrows its numbers.
fn view<'a, T: PrimitiveTensorElementType + Clone + std::fmt::Debug + 'static>(
    name: &'static str,
    shape: &[usize],
    numbers: &'a [T],
) -> Result<(Cow<'a, str>, SessionInputValue<'a>), String> {
    let tensor = TensorRef::from_array_view((shape.to_vec(), numbers)).map_err(|error| one_line(&error))?;
    Ok((name.into(), tensor.into()))
}

fn ids(codes: &[u32]) -> Vec<i64> {
    codes.iter().map(|&code| code.into()).collect()
}

impl Networks for OnnxVerMo {
    fn language(&mut self, call: &LanguageCall<'_>, answer: &mut LanguageAnswer) -> Result<(), EngineError> {
        let VerMoDoc {
            layers,
            key_heads,
            head_width,
            ..
        } = self.table;
        let (rows, cached) = (call.sequences, call.cached);
        let inputs = [
            view("tokens", &[rows, call.columns], call.tokens),
            view("count", &[rows], call.count),
            view("start", &[rows], call.start),
            view(
                "cache",
                &[rows, layers, 2, key_heads, cached, head_width],
                call.cache,
            ),
        ];
        self.language.run(inputs.into_iter().collect(), |outputs| {
            let LanguageAnswer { logits, columns } = answer;
            let found = outputs.get("logits", logits.len())?;
            logits.copy_from_slice(found);
            let found = outputs.get("columns", columns.len())?;
            columns.copy_from_slice(found);
            Ok(())
        })
    }

    fn encode(&mut self, frames: &Frames) -> Result<Vec<u32>, EngineError> {
        let count = frames.len();
        let inputs = [
            view("pose", &[1, count, self.pose], &frames.pose),
            view("root", &[1, count, GLOBAL_ROOT], &frames.root),
        ];
        let known = self.table.motion_codes;
        self.encoder.run(inputs.into_iter().collect(), |outputs| {
            let found = outputs.get::<i64>("tokens", count / FRAMES_PER_TOKEN)?;
            let code = |&token: &i64| match usize::try_from(token) {
                Ok(code) if code < known => Ok(code as u32),
                _ => Err(format!("it gave the token {token}; there are {known}")),
            };
            found.iter().map(code).collect()
        })
    }

    fn decode(&mut self, windows: &[&[u32]]) -> Result<Vec<Frames>, EngineError> {
        let (tokens, pose) = (ids(&windows.concat()), self.pose);
        let (rows, length) = (windows.len(), tokens.len() / windows.len().max(1));
        let inputs = view("tokens", &[rows, length], &tokens).map(|input| vec![input]);
        self.decoder.run(inputs, |outputs| {
            let all = outputs.frames(tokens.len() * FRAMES_PER_TOKEN, pose)?;
            Ok(all.split(length * FRAMES_PER_TOKEN))
        })
    }

    fn flow_width(&self) -> Option<usize> {
        self.flow.as_ref().map(|(_, width)| *width)
    }

    fn flow(&mut self, call: &FlowCall<'_>) -> Result<(Vec<f32>, Frames), EngineError> {
        let pose = self.pose;
        let Some((graph, width)) = &mut self.flow else {
            return Err(EngineError::WrongTask);
        };
        let (tokens, frames) = (ids(call.codes), call.codes.len() * FRAMES_PER_TOKEN);
        let (time, delta) = ([call.time], [call.delta]);
        let inputs = [
            view("tokens", &[1, tokens.len()], &tokens),
            view("state", &[1, frames, *width], call.state),
            view("time", &[1], &time),
            view("delta", &[1], &delta),
        ];
        graph.run(inputs.into_iter().collect(), |outputs| {
            let next = outputs.get("next", frames * *width)?.to_vec();
            Ok((next, outputs.frames(frames, pose)?))
        })
    }
}
