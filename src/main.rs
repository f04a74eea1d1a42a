//! The program `turnaround`: the service and its command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    turnaround::app::main()
}
