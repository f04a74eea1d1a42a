//! A farm on this machine: how soon its jobs begin, and what it loses when everything breaks.
//!
//! ```text
//! cargo build --release && cargo run --release --example farm -- latency [JOBS]
//! cargo build --release && cargo run --release --example farm -- isolation [JOBS]
//! cargo build --release && cargo run --release --example farm -- scaling [JOBS [ROUNDS]]
//! cargo build --release && cargo run --release --example farm -- upgrade OLD_PROGRAM
//! cargo build --release && cargo run --release --example farm -- chaos [SECONDS [JOBS [SEED]]]
//! ```
//!
//! PostgreSQL and an S3 server run in temporary folders, the nodes are processes of the program
//! beside this one. `latency` has one idle worker, on a farm and on the embedded stores; `isolation`
//! one with and one without processes for its jobs. `scaling` does a batch with one worker on one
//! core and with two on two, in turn. `upgrade` begins with nodes of another build.
//! `chaos` has two API nodes and three workers, and prints a ledger; its exit status is 1 if anything was
//! lost, ended twice or was left over. It mounts a small disk to fill it and sets clocks of nodes wrong:
//! for root, with Debian's `faketime`.

mod chaos;
mod clock;
mod disk;
mod isolation;
mod latency;
mod nodes;
mod scaling;
mod upgrade;
mod upload;

use std::env;
use std::error::Error;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

#[tokio::main]
async fn main() -> Result<()> {
    // `reqwest` leaves the choice to the program, also where there is no TLS.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let mut arguments = env::args().skip(1);
    let what = arguments.next();
    if what.as_deref() == Some("upgrade") {
        let old = arguments.next().ok_or("which program is the older one?")?;
        return upgrade::run(Path::new(&old)).await;
    }
    let numbers =
        arguments.map(|text| text.parse()).collect::<std::result::Result<Vec<u64>, _>>()?;
    let number = |at: usize, default| numbers.get(at).copied().unwrap_or(default);
    match what.as_deref() {
        Some("latency") => latency::measure(number(0, 50)).await,
        Some("isolation") => isolation::measure(number(0, 50)).await,
        Some("scaling") => scaling::measure(number(0, 20), number(1, 3)).await,
        Some("chaos") => chaos::run(number(0, 240), number(1, 200), number(2, 1)).await,
        _ => Err("latency, isolation, scaling, upgrade or chaos?".into()),
    }
}
