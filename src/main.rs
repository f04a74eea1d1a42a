use std::process::ExitCode;

fn main() -> ExitCode {
    turnaround::app::main()
}
