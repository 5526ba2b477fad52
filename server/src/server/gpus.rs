//! What GPUs do, as metrics.

use troupe_base::telemetry::{Gauge, Labels, Metric, Telemetry};
use troupe_engine::gpu::{Gpu, GpuUse};

const MEMORY: Metric = Metric::new(
    "troupe_gpu_memory_bytes",
    "Memory of a GPU in all, by its number and model",
);
const USED: Metric = Metric::new(
    "troupe_gpu_memory_used_bytes",
    "Memory of a GPU that any process has taken",
);
const BUSY: Metric = Metric::new(
    "troupe_gpu_busy_ratio",
    "Share of the last second in which a GPU computed for any process, 0 to 1",
);

/// The series of each GPU.
pub(super) struct GpuMetrics(Vec<Series>);

struct Series {
    index: u32,
    memory: Gauge,
    used: Gauge,
    busy: Gauge,
}

impl GpuMetrics {
    /// The series of these GPUs.
    pub(super) fn new(gpus: &[Gpu], telemetry: &Telemetry) -> Self {
        let series = |gpu: &Gpu| {
            let labels = Labels::default().with("gpu", gpu.index.to_string());
            let labels = labels.with("name", gpu.name.clone());
            Series {
                index: gpu.index,
                memory: telemetry.gauge(&MEMORY, &labels),
                used: telemetry.gauge(&USED, &labels),
                busy: telemetry.gauge(&BUSY, &labels),
            }
        };
        Self(gpus.iter().map(series).collect())
    }

    /// Sets the series of all GPUs that `ask` can say something about.
    pub(super) fn look(&self, ask: impl Fn(u32) -> Option<GpuUse>) {
        for series in &self.0 {
            let Some(found) = ask(series.index) else {
                continue;
            };
            series.memory.set(found.memory_bytes as f64);
            series.used.set(found.used_bytes as f64);
            series.busy.set(found.busy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_gpu_has_its_series() {
        let telemetry = Telemetry::new().unwrap();
        let gpus = [0, 1].map(|index| Gpu {
            index,
            name: "NVIDIA H200".into(),
            driver: "580".into(),
            memory_bytes: 100,
        });
        let metrics = GpuMetrics::new(&gpus, &telemetry);
        metrics.look(|index| {
            (index == 1).then_some(GpuUse {
                used_bytes: 25,
                memory_bytes: 100,
                busy: 0.5,
            })
        });
        let text = telemetry.render();
        for line in [
            r#"troupe_gpu_memory_bytes{gpu="1",name="NVIDIA H200"} 100"#,
            r#"troupe_gpu_memory_used_bytes{gpu="1",name="NVIDIA H200"} 25"#,
            r#"troupe_gpu_busy_ratio{gpu="1",name="NVIDIA H200"} 0.5"#,
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
