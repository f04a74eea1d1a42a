//! What is known to be true of a sheet, held against what was made of it.

use rayon::ThreadPool;
use rayon::prelude::*;

use super::{DraftError, ReadImage};
use crate::failure_code::FailureCode;
use evaluation::EvaluationOptions;
use evaluation::{
    ComparisonOptions, ModelReport, RawTruth, TruthReport, ViewComparison, ViewTruth,
    ViewTruthReport, compare_model, decode_truth, has_values,
};
use frames::{Azimuth, Elevation, Viewpoint};
use mesh::Mesh;
use mesh::read::{self, ModelFormat};
use picture::ImageLimits;
use progress::Observer;
use sheet::{Sheet, SheetDocument, TruthKind};

/// The truth that a document names. Its pictures are decoded when they are
/// needed and not kept: a sheet's would take as much memory as its drawings.
pub(super) struct Truths<'a> {
    document: &'a SheetDocument,
    read: ReadImage<'a>,
    limits: &'a ImageLimits,
    options: ComparisonOptions,
    /// By rising azimuth and elevation.
    views: Vec<NamedTruth<'a>>,
    model: Option<(Mesh, f64)>,
}

#[derive(Clone, Copy)]
struct NamedTruth<'a> {
    viewpoint: Viewpoint,
    kind: TruthKind,
    name: &'a str,
}

impl<'a> Truths<'a> {
    /// Reads and checks all that `document` names.
    ///
    /// * `sheet`: the drawings, unless they were laid on another canvas.
    ///
    /// Returns `None` if it names nothing.
    ///
    /// # Errors
    /// [`DraftError::Input`] for a picture that cannot be decoded, has no value
    /// or another size than its view, and for a model that cannot be read.
    pub(super) fn read(
        document: &'a SheetDocument,
        sheet: Option<&Sheet>,
        (read, limits, options): (ReadImage<'a>, &'a ImageLimits, &EvaluationOptions),
        pool: &ThreadPool,
        observer: &dyn Observer,
    ) -> Result<Option<Self>, DraftError> {
        let views = named_truths(document)?;
        let model = true_model(document, read)?;
        if views.is_empty() && model.is_none() {
            return Ok(None);
        }
        let options = ComparisonOptions::from(options);
        let truths = Self { document, read, limits, options, views, model };
        let checked: Vec<_> = pool.install(|| {
            let views = truths.views.par_iter().with_max_len(1);
            let check = |view: &NamedTruth<'_>| {
                observer.check()?;
                truths.check(view, sheet)
            };
            views.map(check).collect()
        });
        // In order, so that the error told is always the same.
        checked.into_iter().collect::<Result<(), DraftError>>()?;
        Ok(Some(truths))
    }

    fn check(&self, view: &NamedTruth<'_>, sheet: Option<&Sheet>) -> Result<(), DraftError> {
        let (raw, truth) = self.decode(view)?;
        let refuse = |what: String| {
            Err(DraftError::input(
                FailureCode::InvalidTruth,
                format!("picture {} {what}", view.name),
            ))
        };
        let size = raw.values.dimensions();
        let views = sheet.map_or(&[][..], Sheet::views);
        let drawing = views.iter().find(|drawn| drawn.viewpoint() == view.viewpoint);
        if let Some(expected) = drawing.map(|drawn| drawn.image.dimensions())
            && size != expected
        {
            return refuse(format!(
                "is {}x{}, the drawing of view {} {}x{}; make them the same size",
                size.0, size.1, view.viewpoint, expected.0, expected.1
            ));
        }
        if !has_values(&truth) {
            return refuse("has no value; 0 is background in a PNG".to_owned());
        }
        Ok(())
    }

    fn decode(&self, view: &NamedTruth<'_>) -> Result<(RawTruth, ViewTruth), DraftError> {
        let raw = decode_truth(&(self.read)(view.name)?, self.limits).map_err(|error| {
            DraftError::input(FailureCode::InvalidTruth, format!("picture {} {error}", view.name))
        })?;
        let truth = raw.of_sheet(view.kind, self.document);
        Ok((raw, truth))
    }

    /// Holds a reconstruction against the truth.
    ///
    /// * `compare`: measures the view from a viewpoint against its truth.
    /// * `mesh`: turntable frame, px; or why there is none.
    pub(super) fn evaluate(
        &self,
        compare: &(dyn Fn(Viewpoint, &ViewTruth) -> Result<ViewComparison, DraftError> + Sync),
        mesh: Result<&Mesh, String>,
        pool: &ThreadPool,
        observer: &dyn Observer,
    ) -> Result<TruthReport, DraftError> {
        let report = |view: &NamedTruth<'_>| {
            observer.check()?;
            let (raw, truth) = self.decode(view)?;
            Ok(ViewTruthReport {
                azimuth_deg: view.viewpoint.azimuth.degrees(),
                elevation_deg: view.viewpoint.elevation.degrees(),
                kind: view.kind,
                encoding: raw.encoding,
                comparison: compare(view.viewpoint, &truth)?,
            })
        };
        let views: Vec<Result<_, DraftError>> =
            pool.install(|| self.views.par_iter().with_max_len(1).map(report).collect());
        let views = views.into_iter().collect::<Result<Vec<_>, _>>()?;
        observer.check()?;
        let model = self.model.as_ref().map(|(truth, pixels_per_unit)| match mesh {
            Err(failure) => ModelReport::Failed { failure },
            Ok(mesh) => pool.install(|| compare_model(mesh, truth, *pixels_per_unit, self.options)),
        });
        Ok(TruthReport::new(views, model))
    }
}

fn named_truths(document: &SheetDocument) -> Result<Vec<NamedTruth<'_>>, DraftError> {
    let mut views = Vec::new();
    for view in &document.views {
        let Some((kind, name)) = view.truth() else { continue };
        let azimuth = Azimuth::from_degrees(view.azimuth_deg)
            .map_err(|error| DraftError::input(FailureCode::InvalidAzimuth, error))?;
        let elevation_deg = view.elevation_deg.unwrap_or(document.elevation_deg);
        let elevation = Elevation::from_degrees(elevation_deg)
            .map_err(|error| DraftError::input(FailureCode::InvalidAzimuth, error))?;
        let viewpoint = Viewpoint { azimuth, elevation };
        if view.depth.is_some() && view.disparity.is_some() {
            let detail =
                format!("view {viewpoint} has a true depth and a true disparity; name one");
            return Err(DraftError::input(FailureCode::InvalidTruth, detail));
        }
        views.push(NamedTruth { viewpoint, kind, name });
    }
    views.sort_by_key(|view| view.viewpoint);
    Ok(views)
}

/// The true model that a document names, in its own unit, and the sheet pixels
/// a unit of it.
///
/// # Errors
/// [`DraftError::Input`] for a model that cannot be read or has no scale.
pub fn true_model(
    document: &SheetDocument,
    read: ReadImage<'_>,
) -> Result<Option<(Mesh, f64)>, DraftError> {
    let truth = document.truth.as_ref();
    let Some(name) = truth.and_then(|truth| truth.model.as_deref()) else { return Ok(None) };
    let refuse = |what: &dyn std::fmt::Display| {
        DraftError::input(FailureCode::InvalidTruth, format!("model {name}: {what}"))
    };
    let format = ModelFormat::from_file_name(name)
        .ok_or_else(|| refuse(&"the name's ending is none of glb, gltf, obj, ply, stl"))?;
    let pixels_per_unit = document
        .pixels_per_unit
        .filter(|pixels| pixels.is_finite() && *pixels > 0.0)
        .ok_or_else(|| refuse(&"the sheet gives no pixels_per_unit"))?;
    let up_axis = truth.and_then(|truth| truth.model_up_axis);
    let model = read::load(&read(name)?, format, up_axis, &read::Limits::default())
        .map_err(|error| refuse(&error))?;
    Ok(Some((model.mesh, pixels_per_unit)))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::draft::tests::{Files, input_error, metrics, run, sheet};
    use artifacts::Artifact;
    use drawing::{DrawError, DrawOptions, PreparedModel, SheetLimits, draw_sheet};
    use evaluation::{ViewTruth, disparity_from_depth, disparity_from_pairs, evaluate_view};
    use frames::Azimuth;
    use mesh::builtin::ProceduralModel;
    use picture::{FloatImage, decode_pfm, encode_pfm};
    use progress::Silent;
    use sheet::TruthDocument;

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
        options::merge(document.options.get_or_insert_default(), options);
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
        let azimuths: Vec<_> =
            azimuths.iter().map(|&a| Azimuth::from_degrees(a).unwrap().into()).collect();
        let small = DrawOptions { width_px: 192, height_px: 108, ..DrawOptions::default() };
        let prepared = PreparedModel::new(&model).unwrap();
        let mut files = Files::new();
        let mut keep = |file: Artifact| -> Result<(), DrawError> {
            files.insert(file.name, file.bytes.into());
            Ok(())
        };
        let limits = SheetLimits::default();
        draw_sheet(&prepared, &azimuths, &small, &limits, &Silent, &mut keep).unwrap();
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
        let depth = FloatImage::from_fn(240, 180, |x, y| {
            image::Luma([slope().get_pixel(x, y).0[0] - 1120.0])
        });
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
}
