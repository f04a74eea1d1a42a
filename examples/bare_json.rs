//! A bare axum answer of a JSON document, for `scripts/bench-http` to hold the service against:
//! `bare_json FILE` reads it, prints where it listens, and writes it out for every request.

use std::{env, fs};

use axum::extract::State;
use axum::routing::get;
use axum::{Json, Router};
use serde_json::Value;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = env::args().nth(1).ok_or("give the file of the document")?;
    let document: Value = serde_json::from_slice(&fs::read(file)?)?;
    let answer = |State(document): State<Value>| async { Json(document) };
    let router = Router::new().route("/", get(answer)).with_state(document);
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
    println!("listening on http://{}", listener.local_addr()?);
    Ok(axum::serve(listener, router).await?)
}
