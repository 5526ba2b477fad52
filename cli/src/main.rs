//! The `troupe` command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_cli::main()
}
