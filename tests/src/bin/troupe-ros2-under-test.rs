//! The `troupe-ros2` command under a name of its own, so that tests of this package can start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_ros2::main()
}
