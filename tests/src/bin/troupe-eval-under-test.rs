//! The `troupe-eval` command under a name of its own, so that tests of this package can start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_eval::main()
}
