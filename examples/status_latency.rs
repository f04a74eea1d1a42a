//! Times an address under an open-loop load: requests leave on schedule,
//! whatever became of the ones before, and count from when they were due.
//!
//! ```text
//! cargo run --release --example status_latency -- URL [REQUESTS [PER_SECOND]]
//! ```
//!
//! With a key in the variable `KEY`, it is sent along. Prints one JSON line: requests, failures, and the 50th, 90th, 99th
//! percentile and maximum of the latency in milliseconds.

use std::env;
use std::time::Duration;

use reqwest::header::{AUTHORIZATION, HeaderMap};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = env::args().skip(1);
    let url = arguments.next().ok_or("which URL?")?;
    let requests: u32 = arguments.next().map_or(Ok(2000), |text| text.parse())?;
    let per_second: f64 = arguments.next().map_or(Ok(100.0), |text| text.parse())?;

    // `reqwest` leaves the choice to the program, also where there is no TLS.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let mut headers = HeaderMap::new();
    if let Ok(key) = env::var("KEY") {
        headers.insert(AUTHORIZATION, format!("Bearer {key}").parse()?);
    }
    let client = reqwest::Client::builder().default_headers(headers).build()?;
    let begin = Instant::now() + Duration::from_millis(100);
    let mut running = JoinSet::new();
    for number in 0..requests {
        let due = begin + Duration::from_secs_f64(f64::from(number) / per_second);
        let (client, url) = (client.clone(), url.clone());
        running.spawn(async move {
            sleep_until(due).await;
            let answer = client.get(&url).send().await;
            let is_good = match answer {
                Ok(answer) => answer.status().is_success() && answer.bytes().await.is_ok(),
                Err(_) => false,
            };
            (is_good, due.elapsed().as_secs_f64() * 1e3)
        });
    }
    let results = running.join_all().await;
    let failures = results.iter().filter(|(is_good, _)| !is_good).count();
    let mut latencies: Vec<f64> = results.into_iter().map(|(_, latency)| latency).collect();
    latencies.sort_by(f64::total_cmp);
    let percentile = |share: f64| {
        let rank = (share * latencies.len() as f64).ceil() as usize;
        latencies[rank.clamp(1, latencies.len()) - 1]
    };
    let report = serde_json::json!({
        "requests": requests,
        "failures": failures,
        "p50_ms": percentile(0.5),
        "p90_ms": percentile(0.9),
        "p99_ms": percentile(0.99),
        "max_ms": percentile(1.0),
    });
    println!("{report}");
    Ok(())
}
