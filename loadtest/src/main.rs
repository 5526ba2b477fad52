//! The `troupe-loadtest` command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_loadtest::cli::main()
}
