use std::ops::ControlFlow;

use serde_json::{Value, json};

use super::tests::{Files, input_error, metrics, run, sheet};
use super::*;
use crate::draw::{DrawOptions, PreparedModel, draw_sheet};
use crate::evaluation::{ViewTruth, disparity_from_depth, disparity_from_pairs, evaluate_view};
use crate::float_image::{FloatImage, decode_pfm, encode_pfm};
use crate::models::ProceduralModel;
use crate::pipeline::Silent;
use crate::sheet::{Azimuth, TruthDocument};

const BOX: &str = "v -70 -45 -85\nv 70 -45 -85\nv 0 60 -85\nv 0 0 80\n\
                   f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

/// Depth in px that rises to the right, with a background.
fn slope() -> FloatImage {
    FloatImage::from_fn(240, 180, |x, y| {
        image::Luma([if y < 20 { f32::NAN } else { 1000.0 + x as f32 }])
    })
}

/// The sheet of the other tests with true depth of one view and a true model.
fn with_truth() -> (SheetDocument, Files) {
    let (mut document, mut files) = sheet(&[0.0, 5.0, 10.0]);
    let options = json!({"evaluation": {"grid_cells": 40, "samples": 2000}});
    crate::options::merge(document.options.get_or_insert_default(), options);
    document.pixels_per_unit = Some(1.0);
    document.views[1].depth = Some("5.pfm".to_owned());
    document.truth = Some(TruthDocument {
        model: Some("box.obj".to_owned()),
        camera_distance: Some(1120.0),
        ..TruthDocument::default()
    });
    files.insert("5.pfm".to_owned(), encode_pfm(&slope()));
    files.insert("box.obj".to_owned(), BOX.into());
    (document, files)
}

fn drawn(model: &str, azimuths: &[f64], options: Value) -> (SheetDocument, Files) {
    let model = ProceduralModel::from_name(model).unwrap().build();
    let azimuths: Vec<_> = azimuths.iter().map(|&a| Azimuth::from_degrees(a).unwrap()).collect();
    let small = DrawOptions { width_px: 192, height_px: 108, ..DrawOptions::default() };
    let prepared = PreparedModel::new(&model).unwrap();
    let drawn = draw_sheet(&prepared, &azimuths, &small, &|_| ControlFlow::Continue(())).unwrap();
    let files: Files = drawn.into_iter().map(|file| (file.name, file.bytes)).collect();
    let mut document: SheetDocument = serde_json::from_slice(&files["sheet.json"]).unwrap();
    document.options = Some(options);
    (document, files)
}

#[test]
fn the_maps_served_are_those_measured() {
    let (document, files) = with_truth();
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let served = |name: &str| {
        let found = artifacts.iter().find(|artifact| artifact.name == name).unwrap();
        decode_pfm(&found.bytes, 1 << 20, 1 << 10).unwrap()
    };
    let depth =
        FloatImage::from_fn(240, 180, |x, y| image::Luma([slope().get_pixel(x, y).0[0] - 1120.0]));
    let truth = ViewTruth::Metric(disparity_from_depth(&depth));
    let disparity = disparity_from_pairs(&served("views/5/disparity.pfm"), &[5.0, -5.0]);
    let expected = evaluate_view(&disparity, &truth).unwrap();
    let of_depth =
        evaluate_view(&disparity_from_depth(&served("views/5/depth.pfm")), &truth).unwrap();
    let found = &metrics(&artifacts)["truth"];
    assert_eq!(found["views"].as_array().unwrap().len(), 1);
    let view = &found["views"][0];
    assert_eq!((&view["azimuth_deg"], &view["kind"]), (&json!(5.0), &json!("depth")));
    assert_eq!(view["encoding"], "pfm");
    assert_eq!(view["disparity"], serde_json::to_value(&expected).unwrap());
    assert_eq!(view["depth"], serde_json::to_value(&of_depth).unwrap());
    assert_eq!(view["disparity"]["truth_pixels"], 240 * 160);
    assert_eq!(found["mean"]["disparity"]["views"], 1);
    assert_eq!(found["mean"]["disparity"]["bad2_px"], view["disparity"]["bad2_px"]["honest"]);
    let iou = found["model"]["iou"].as_f64().unwrap();
    assert!(iou > 0.0 && iou < 1.0, "{iou}");
    assert!(found["model"]["hausdorff"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_drawn_sheet_s_document_works_as_it_is() {
    let options = json!({
        "method": "turntable",
        "turntable": {"solid": {"resolution": 64, "target_faces": 3000}},
        "evaluation": {"grid_cells": 64, "samples": 5000},
    });
    let (document, files) = drawn("cube", &[0.0, 30.0, 60.0], options);
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let truth = &metrics(&artifacts)["truth"];
    assert_eq!(truth["views"].as_array().unwrap().len(), 3);
    for view in truth["views"].as_array().unwrap() {
        assert_eq!(view["disparity"], Value::Null);
        // A line's half is 3 % of the cube's side here.
        assert!(view["silhouette"]["iou"].as_f64().unwrap() > 0.9, "{view}");
        assert!(view["depth"]["coverage"].as_f64().unwrap() > 0.9, "{view}");
        assert!(view["depth"]["bad2_px"]["honest"].as_f64().unwrap() < 0.5, "{view}");
    }
    assert!(truth["model"]["iou"].as_f64().unwrap() > 0.85, "{truth}");
    assert!(truth["model"]["f_score"].is_number() && truth["model"]["chamfer_l1"].is_number());
}

#[test]
fn without_truth_the_metrics_have_none() {
    let (document, files) = sheet(&[0.0, 5.0, 10.0]);
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    assert_eq!(metrics(&artifacts)["truth"], Value::Null);
}

#[test]
fn truth_that_cannot_be_used_is_refused_before_computing() {
    let refused = |change: &dyn Fn(&mut SheetDocument, &mut Files)| {
        let (mut document, mut files) = with_truth();
        change(&mut document, &mut files);
        let (code, detail) = input_error(&document, &files);
        assert_eq!(code, "invalid_truth", "{detail}");
        detail
    };
    let put = |bytes: Vec<u8>| {
        refused(&move |_, files| {
            files.insert("5.pfm".to_owned(), bytes.clone());
        })
    };
    assert!(put(b"Pf\n3 3\n-1\n".to_vec()).contains("5.pfm"));
    let small = FloatImage::from_pixel(240, 179, image::Luma([1.0]));
    assert!(put(encode_pfm(&small)).contains("240x179"));
    let nothing = FloatImage::from_pixel(240, 180, image::Luma([f32::NAN]));
    assert!(put(encode_pfm(&nothing)).contains("no value"));
    refused(&|_, files| {
        files.insert("box.obj".to_owned(), b"v 0 0 0\n".to_vec());
    });
    let detail = refused(&|document, _| document.pixels_per_unit = None);
    assert!(detail.contains("pixels_per_unit"), "{detail}");
    refused(&|document, _| document.views[1].disparity = Some("6.pfm".to_owned()));
    let (document, mut files) = with_truth();
    files.remove("5.pfm");
    assert!(matches!(run(&document, &files, 1, &Silent), Err(DraftError::Io(_))));
}

#[test]
fn figures_do_not_depend_on_the_number_of_threads() {
    let (document, files) = with_truth();
    let of = |threads| metrics(&run(&document, &files, threads, &Silent).unwrap().1);
    assert_eq!(of(1), of(3));
}
