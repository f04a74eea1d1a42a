//! Faults for tests of debug builds: what a job that goes wrong may do to its
//! process.
//!
//! `TURNAROUND_TEST_FAULT` is a list such as `13=abort,14=loop`: the seeds of
//! the reconstructions that go wrong, and how.

use std::fs::File;
use std::hint::black_box;
use std::net::TcpStream;
use std::time::Duration;
use std::{env, process, thread};

use crate::worker::Task;

/// The name of the list; the service passes it on.
pub(super) const VARIABLE: &str = "TURNAROUND_TEST_FAULT";

/// Goes wrong if the list says so of this task.
pub(super) fn strike(task: &Task) {
    let list = env::var(VARIABLE).unwrap_or_default();
    let Some(seed) = task.payload.pointer("/document/options/seed") else { return };
    let seed = seed.to_string();
    let fault = list.split(',').filter_map(|entry| entry.split_once('='));
    match fault.into_iter().find(|(of, _)| *of == seed).map(|(_, fault)| fault) {
        Some("abort") => process::abort(),
        Some("allocate") => allocate(),
        Some("overflow") => {
            black_box(overflow(1));
        }
        Some("loop") => loop {
            thread::sleep(Duration::from_millis(1));
        },
        Some("reach out") => reach_out(),
        Some(other) => panic!("{VARIABLE}: there is no fault {other}"),
        None => {}
    }
}

/// Until there is no more.
fn allocate() {
    let mut held = Vec::new();
    loop {
        held.push(black_box(vec![1u8; 16 << 20]));
    }
}

#[expect(unconditional_recursion, reason = "that is the fault")]
fn overflow(depth: u64) -> u64 {
    let room = black_box([depth; 64]);
    overflow(depth + 1) + room[0]
}

/// Tries what a child must not, and says what came of it in its panic.
fn reach_out() {
    let network = TcpStream::connect(("127.0.0.1", 9)).map(drop).map_err(|error| error.kind());
    let file = File::open("/etc/hostname").map(drop).map_err(|error| error.kind());
    let program = process::Command::new("true").status().map(drop).map_err(|error| error.kind());
    let spawned = thread::spawn(|| ()).join().is_ok();
    panic!("network {network:?}, file {file:?}, program {program:?}, thread {spawned}");
}
