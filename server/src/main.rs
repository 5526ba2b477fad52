//! The `troupe-server` binary.

use std::process::ExitCode;

/// The allocator of the process, including the C libraries. In one run of a network, ONNX Runtime
/// and OpenVINO allocate and free memory hundreds of times. With the C library's allocator that
/// took 5 % of a worker's time.
#[cfg(all(
    feature = "jemalloc",
    target_os = "linux",
    target_env = "gnu",
    target_arch = "x86_64"
))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// Returns unused memory to the system even while the server is idle, and in small pieces. By
/// default, blocks of 8 MiB and more are returned at once. When 100 large bodies ended together,
/// nothing ran for half a second. `MALLOC_CONF` in the environment overrides this.
#[cfg(all(
    feature = "jemalloc",
    target_os = "linux",
    target_env = "gnu",
    target_arch = "x86_64"
))]
#[allow(unsafe_code, reason = "the allocator looks for this name")]
#[unsafe(export_name = "malloc_conf")]
pub static ALLOCATOR_SETTINGS: &[u8; 44] = b"background_thread:true,oversize_threshold:0\0";

fn main() -> ExitCode {
    troupe_server::program::main()
}
