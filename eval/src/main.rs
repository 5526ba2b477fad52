//! The `troupe-eval` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_eval::main()
}
