//! The `troupe-ros2` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    troupe_ros2::main()
}
