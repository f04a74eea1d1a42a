//! What the dashboard and the alert rules in `deploy` ask for, held against what a
//! service exports.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use serde_json::Value;

use crate::faults::process::Process;

const DASHBOARD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/grafana/turnaround.json");
const ALERTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/prometheus/alerts.yaml");

/// The expressions of the dashboard's panels.
fn collect(document: &Value, into: &mut Vec<String>) {
    match document {
        Value::Object(fields) => {
            into.extend(fields.get("expr").and_then(Value::as_str).map(str::to_owned));
            fields.values().for_each(|field| collect(field, into));
        }
        Value::Array(items) => items.iter().for_each(|item| collect(item, into)),
        _ => {}
    }
}

fn expressions() -> Vec<String> {
    let mut found = Vec::new();
    let dashboard = fs::read_to_string(DASHBOARD).unwrap();
    collect(&serde_json::from_str(&dashboard).unwrap(), &mut found);
    let panels = found.len();
    let alerts = fs::read_to_string(ALERTS).unwrap();
    let rules = alerts.lines().filter_map(|line| line.trim().strip_prefix("expr: "));
    found.extend(rules.map(str::to_owned));
    assert!(panels >= 10 && found.len() >= panels + 8, "{found:?}");
    found
}

/// The words that are names of metrics.
fn names(expression: &str) -> BTreeSet<&str> {
    let words = expression.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    words.filter(|word| word.starts_with("turnaround_")).collect()
}

/// The labels by which it groups or filters; those that Prometheus itself gives apart.
fn labels(expression: &str) -> BTreeSet<&str> {
    let grouped = expression.split("by (").skip(1).filter_map(|rest| rest.split(')').next());
    let filtered = expression.split('{').skip(1).filter_map(|rest| rest.split('}').next());
    let filtered = filtered.flat_map(|inner| inner.split(','));
    let filtered = filtered.filter_map(|one| one.split(['=', '!']).next());
    let all = grouped.flat_map(|list| list.split(',')).chain(filtered).map(str::trim);
    all.filter(|label| !label.is_empty() && *label != "instance").collect()
}

/// Of each exported series, the labels.
fn series(text: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut found: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        let name = line.split([' ', '{']).next().unwrap().to_owned();
        let inner = line.split_once('{').and_then(|(_, rest)| rest.split_once('}'));
        let of_line = inner.map_or("", |(inner, _)| inner).split("\",");
        let of_line = of_line.filter_map(|one| Some(one.split_once('=')?.0.to_owned()));
        found.entry(name).or_default().extend(of_line);
    }
    found
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn dashboard_and_alerts_ask_for_what_is_exported() {
    let folder = tempfile::tempdir().unwrap();
    let service = Process::start(folder.path(), &["--workers", "1"]);
    let text = async || service.get("/metrics").send().await.unwrap().text().await.unwrap();
    let mut last = Value::Null;
    for _ in 0..3 {
        last = service.upload().await.1;
    }
    // One runs and others wait.
    let queued = text().await;
    let path = format!("/v1/reconstructions/{}", last["id"].as_str().unwrap());
    service.until(&path, |_, job| job["finished_at"].is_string()).await;
    let mut exported = series(&queued);
    exported.extend(series(&text().await));

    for expression in expressions() {
        let names = names(&expression);
        assert!(!names.is_empty(), "{expression} asks for nothing of ours");
        let mut known = BTreeSet::new();
        for name in names {
            let found = exported.get(name);
            known.extend(found.unwrap_or_else(|| panic!("{expression}: no {name} is exported")));
        }
        for label in labels(&expression) {
            assert!(known.iter().any(|it| *it == label), "{expression}: no label {label}");
        }
    }
}
