//! Chooses the engine of a pack, and the number of its workers and their threads.

use std::fmt;

/// The engine that the configuration asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum EngineChoice {
    /// CUDA on a GPU, else OpenVINO in bf16, else the CPU in f32: the first that can run and with
    /// which the pack passes its accuracy check.
    Auto,
    /// ONNX Runtime's own CPU kernels, f32.
    Cpu,
    /// OpenVINO on the CPU, bf16.
    OpenvinoBf16,
    /// CUDA, through ONNX Runtime's GPU library.
    Cuda,
    /// TensorRT, through ONNX Runtime's GPU library. Never run by this project's authors.
    Tensorrt,
}

/// What happens with an engine that fails a pack's accuracy check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum AccuracyCheck {
    /// It does not serve.
    Enforce,
    /// It serves, with a warning.
    Report,
}

/// An engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EngineKind {
    /// ONNX Runtime's own CPU kernels, f32: the reference of every accuracy check.
    Cpu,
    /// OpenVINO on the CPU, bf16.
    OpenvinoBf16,
    /// CUDA.
    Cuda,
    /// TensorRT. Never run by this project's authors.
    Tensorrt,
}

impl EngineKind {
    /// Every engine once.
    pub const ALL: [Self; 4] = [Self::Cpu, Self::OpenvinoBf16, Self::Cuda, Self::Tensorrt];

    /// Name of the engine: a value of the option `engine`, and a metric label.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::OpenvinoBf16 => "openvino-bf16",
            Self::Cuda => "cuda",
            Self::Tensorrt => "tensorrt",
        }
    }

    /// Whether this project's authors have ever run it.
    pub fn is_tested(self) -> bool {
        self != Self::Tensorrt
    }
}

impl fmt::Display for EngineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl EngineChoice {
    /// The engine, if the configuration names one.
    pub fn named(self) -> Option<EngineKind> {
        match self {
            Self::Auto => None,
            Self::Cpu => Some(EngineKind::Cpu),
            Self::OpenvinoBf16 => Some(EngineKind::OpenvinoBf16),
            Self::Cuda => Some(EngineKind::Cuda),
            Self::Tensorrt => Some(EngineKind::Tensorrt),
        }
    }
}

/// Most workers that are chosen automatically. Beyond, more threads go to the same workers.
const AUTO_WORKERS: usize = 8;

/// The workers of a pack: each is a thread that owns a generator and runs one batch at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Workers {
    /// Number of workers.
    pub count: usize,
    /// Threads for the networks of one worker, including the worker's own.
    pub threads: usize,
}

impl Workers {
    /// `count` workers with `threads` threads in total; 0 chooses by the machine, of which the
    /// process may use `available` cores. As many workers as threads is best: a single network
    /// scales badly over threads, several networks side by side scale well.
    pub fn plan(count: usize, threads: usize, available: usize) -> Self {
        let threads = if threads == 0 { available.max(1) } else { threads };
        let count = if count == 0 {
            threads.min(AUTO_WORKERS)
        } else {
            count
        };
        Self {
            count,
            threads: (threads / count).max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_share_the_threads() {
        let workers = |count, threads, available| {
            let workers = Workers::plan(count, threads, available);
            (workers.count, workers.threads)
        };
        assert_eq!(workers(0, 0, 1), (1, 1));
        assert_eq!(workers(0, 0, 2), (2, 1));
        assert_eq!(workers(0, 0, 8), (8, 1));
        assert_eq!(workers(0, 0, 16), (8, 2));
        assert_eq!(workers(0, 3, 64), (3, 1));
        assert_eq!(workers(1, 0, 4), (1, 4));
        assert_eq!(workers(2, 0, 5), (2, 2));
        assert_eq!(
            workers(4, 2, 2),
            (4, 1),
            "a caller may ask for more workers than threads"
        );
    }

    #[test]
    fn the_name_of_an_engine_is_its_option() {
        use clap::ValueEnum as _;
        for choice in EngineChoice::value_variants() {
            let name = choice
                .to_possible_value()
                .map(|value| value.get_name().to_owned());
            assert_eq!(
                name.as_deref(),
                Some(choice.named().map_or("auto", EngineKind::name))
            );
        }
    }
}
