//! Documents that clients read, held against reviewed snapshots.

use std::collections::BTreeMap;
use std::io::{self, Write};

use artifacts::{Artifact, ArtifactName, ArtifactSink, ArtifactWriter};
use drawing::{DrawError, DrawOptions, PreparedModel, SheetLimits, draw_sheet};
use frames::{Elevation, ViewpointList};
use mesh::builtin::ProceduralModel;
use progress::Silent;
use reqwest::multipart::Form;
use serde_json::{Value, json};
use sheet::SheetDocument;
use turnaround::draft::{DraftLimits, produce};
use turnaround::failure_code::FailureCode;

use crate::api::harness::Service;

/// Keeps files by name.
#[derive(Default)]
struct Files(BTreeMap<String, Vec<u8>>);

/// What is written piece by piece is not looked at here.
struct Nowhere;

impl ArtifactSink for Files {
    fn put(&mut self, artifact: Artifact) -> io::Result<()> {
        self.0.insert(artifact.name, artifact.bytes.into());
        Ok(())
    }

    fn create(&mut self, _: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>> {
        Ok(Box::new(Nowhere))
    }
}

impl Write for Nowhere {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl ArtifactWriter for Nowhere {
    fn finish(self: Box<Self>) -> io::Result<()> {
        Ok(())
    }
}

fn metrics(azimuths: &str, options: Value) -> Value {
    let model = PreparedModel::new(&ProceduralModel::Dude.build()).unwrap();
    let views: ViewpointList = azimuths.parse().unwrap();
    let views = views.at(Elevation::LEVEL);
    let small = DrawOptions { width_px: 240, height_px: 135, ..DrawOptions::default() };
    let mut drawn = Files::default();
    let mut keep = |file: Artifact| -> Result<(), DrawError> {
        drawn.0.insert(file.name, file.bytes.into());
        Ok(())
    };
    let limits = SheetLimits::default();
    draw_sheet(&model, &views, &small, &limits, &Silent, &mut keep).unwrap();
    let mut document: SheetDocument = serde_json::from_slice(&drawn.0["sheet.json"]).unwrap();
    document.options = Some(options);
    let read = |name: &str| Ok(drawn.0[name].clone());
    let mut files = Files::default();
    produce(&document, &read, &DraftLimits::default(), 2, &Silent, &mut files).unwrap();
    let mut metrics = serde_json::from_slice(&files.0["metrics.json"]).unwrap();
    roughly(&mut metrics);
    metrics
}

/// Two digits of each fraction: what is looked at is which figures there are.
fn roughly(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(roughly),
        Value::Object(entries) => entries.values_mut().for_each(roughly),
        Value::Number(number) if number.is_f64() => {
            *value = json!(format!("{:.1e}", number.as_f64().unwrap()));
        }
        _ => {}
    }
}

#[test]
fn metrics_of_the_default_method() {
    let options = json!({
        "turntable": {"solid": {"resolution": 48, "target_faces": 1000}},
        "evaluation": {"grid_cells": 32, "samples": 2000},
    });
    insta::assert_json_snapshot!(metrics("0,45,90", options), {
        ".version" => "[version]", ".provenance.program.*" => "[program]",
    });
}

#[test]
fn metrics_of_the_dissertation_s_method() {
    let options = json!({
        "method": "uncalibrated",
        "evaluation": {"grid_cells": 32, "samples": 2000},
    });
    insta::assert_json_snapshot!(metrics("0:10:5", options), {
        ".version" => "[version]", ".provenance.program.*" => "[program]",
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn problems() {
    let service = Service::start().await;
    let mut told = Vec::new();
    let forms = [
        Form::new().text("view[0]", "no picture"),
        Form::new().text("view[front]", "x"),
        Form::new().text("options", "{").text("view[0]", "x"),
        Form::new().text("turntable.solid.holes", "some").text("view[0]", "x"),
        Form::new().text("turntable.solid.resolution", "9000").text("view[0]", "x"),
        Form::new().text("turntable.solid.resolutoin", "90").text("view[0]", "x"),
        Form::new(),
    ];
    for form in forms {
        told.push(service.upload(form).await.json::<Value>().await.unwrap());
    }
    insta::assert_json_snapshot!(told, { "[].instance" => "[id]", "[].request_id" => "[id]" });
}

#[test]
fn failure_codes() {
    let told: Vec<_> = FailureCode::ALL
        .iter()
        .map(
            |code| json!({"code": code.name(), "meaning": code.meaning(), "remedy": code.remedy()}),
        )
        .collect();
    insta::assert_json_snapshot!(told);
}
