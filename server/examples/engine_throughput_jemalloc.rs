//! [`engine_throughput`] with the allocator that the server has: what of its speed is that of its
//! allocator.

#[path = "engine_throughput.rs"]
mod engine_throughput;

#[cfg(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

fn main() -> anyhow::Result<()> {
    engine_throughput::main()
}
