//! NVIDIA GPUs of this machine, by the management library (NVML) that comes with their driver.

use std::ffi::OsStr;
use std::sync::OnceLock;

use nvml_wrapper::Nvml;
use nvml_wrapper::error::NvmlError;
use serde::Serialize;

/// The library's name without its development files, which containers lack.
const LIBRARY: &str = "libnvidia-ml.so.1";

/// A GPU of this machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Gpu {
    /// The driver's number for it, in the order of the slots.
    pub index: u32,
    /// Model, as in "NVIDIA H200".
    pub name: String,
    /// Version of the driver.
    pub driver: String,
    /// Its memory, bytes.
    pub memory_bytes: u64,
}

/// What a GPU does now, for all processes of the machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuUse {
    /// Memory that is taken, bytes.
    pub used_bytes: u64,
    /// Memory in all, bytes.
    pub memory_bytes: u64,
    /// Share of the last second or less in which it computed, 0 to 1.
    pub busy: f64,
}

/// The GPU that networks run on, and how much of its memory they may take.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// CUDA's number of the GPU.
    pub device: u32,
    /// Most memory of all networks together, bytes. 0: no limit.
    pub memory_bytes: u64,
}

/// A worker's part of a GPU, for the networks of one pack.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GpuShare {
    /// CUDA's number of the GPU.
    pub device: u32,
    /// Most memory of the worker's networks together, bytes. 0: no limit.
    pub memory_bytes: u64,
    /// Sizes of the pack's graphs together, bytes. A network gets memory by the size of its own.
    pub graph_bytes: u64,
}

impl GpuOptions {
    /// The part of each of `workers` workers of a pack, beside `packs - 1` others. `graph_bytes` is
    /// the size of the pack's graphs together.
    pub(crate) fn share(self, packs: usize, workers: usize, graph_bytes: u64) -> GpuShare {
        let parts = (packs * workers).max(1) as u64;
        GpuShare {
            device: self.device,
            // A limit never becomes 0, which is none.
            memory_bytes: match self.memory_bytes {
                0 => 0,
                bytes => (bytes / parts).max(1),
            },
            graph_bytes,
        }
    }
}

impl GpuShare {
    /// Most memory of the network whose graph has this size. None: no limit.
    pub(crate) fn of_graph(self, bytes: u64) -> Option<usize> {
        let wanted = u128::from(self.memory_bytes) * u128::from(bytes) / u128::from(self.graph_bytes.max(1));
        let most = wanted.clamp(1, u128::from(self.memory_bytes.max(1)));
        (self.memory_bytes > 0).then(|| usize::try_from(most).unwrap_or(usize::MAX))
    }
}

/// The management library. None: there is no driver.
fn nvml() -> Option<&'static Nvml> {
    static OPENED: OnceLock<Option<Nvml>> = OnceLock::new();
    let open = || Nvml::builder().lib_path(OsStr::new(LIBRARY)).init().ok();
    OPENED.get_or_init(open).as_ref()
}

/// The GPUs of this machine. Empty without a driver.
pub fn gpus() -> Vec<Gpu> {
    let Some(nvml) = nvml() else {
        return Vec::new();
    };
    let driver = nvml.sys_driver_version().unwrap_or_default();
    let gpu = |index| -> Result<Gpu, NvmlError> {
        let device = nvml.device_by_index(index)?;
        Ok(Gpu {
            index,
            name: device.name()?,
            driver: driver.clone(),
            memory_bytes: device.memory_info()?.total,
        })
    };
    let count = nvml.device_count().unwrap_or_default();
    (0..count).filter_map(|index| gpu(index).ok()).collect()
}

/// What the GPU with this number does now. None if it cannot be asked.
pub fn gpu_use(index: u32) -> Option<GpuUse> {
    let device = nvml()?.device_by_index(index).ok()?;
    let memory = device.memory_info().ok()?;
    Some(GpuUse {
        used_bytes: memory.used,
        memory_bytes: memory.total,
        busy: f64::from(device.utilization_rates().ok()?.gpu) / 100.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;

    #[test]
    fn workers_share_the_memory_and_networks_by_their_size() {
        let options = GpuOptions {
            device: 1,
            memory_bytes: 8 * 1024 * MIB,
        };
        let share = options.share(2, 4, 100 * MIB);
        assert_eq!((share.device, share.memory_bytes), (1, 1024 * MIB));
        assert_eq!(share.of_graph(25 * MIB), Some(256 << 20));
        assert_eq!(
            share.of_graph(200 * MIB),
            Some(1024 << 20),
            "never more than the worker"
        );
        assert_eq!(share.of_graph(0), Some(1), "a limit stays one");
    }

    #[test]
    fn without_a_limit_there_is_none() {
        let share = GpuOptions::default().share(0, 0, 0);
        assert_eq!(share.of_graph(MIB), None);
    }

    #[test]
    fn a_machine_without_a_driver_has_no_gpu() {
        let gpus = gpus();
        assert_eq!(gpus.is_empty(), gpu_use(0).is_none(), "{gpus:?}");
    }
}
