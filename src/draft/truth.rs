//! What is known to be true of a sheet, held against what was made of it.

use rayon::ThreadPool;
use rayon::prelude::*;

use super::{DraftError, ReadImage};
use crate::evaluation::{
    ModelReport, RawTruth, SolidOptions, TruthReport, ViewComparison, ViewTruth, ViewTruthReport,
    compare_model, decode_truth, has_values,
};
use crate::geometry::Mesh;
use crate::model_io::{self, ModelFormat};
use crate::options::EvaluationOptions;
use crate::pipeline::Observer;
use crate::sheet::{Azimuth, ImageLimits, Sheet, SheetDocument, TruthKind};

/// The truth that a document names. Its pictures are decoded when they are
/// needed and not kept: a sheet's would take as much memory as its drawings.
pub(super) struct Truths<'a> {
    document: &'a SheetDocument,
    read: ReadImage<'a>,
    limits: &'a ImageLimits,
    options: SolidOptions,
    /// By rising azimuth.
    views: Vec<NamedTruth<'a>>,
    model: Option<(Mesh, f64)>,
}

#[derive(Clone, Copy)]
struct NamedTruth<'a> {
    azimuth: Azimuth,
    kind: TruthKind,
    name: &'a str,
}

impl<'a> Truths<'a> {
    /// Reads and checks all that `document` names.
    ///
    /// Returns `None` if it names nothing.
    ///
    /// # Errors
    /// [`DraftError::Input`] for a picture that cannot be decoded, has no value
    /// or another size than its view, and for a model that cannot be read.
    pub fn read(
        document: &'a SheetDocument,
        sheet: &Sheet,
        (read, limits, options): (ReadImage<'a>, &'a ImageLimits, &EvaluationOptions),
        pool: &ThreadPool,
        observer: &dyn Observer,
    ) -> Result<Option<Self>, DraftError> {
        let views = named_truths(document)?;
        let model = true_model(document, read)?;
        if views.is_empty() && model.is_none() {
            return Ok(None);
        }
        let options = SolidOptions {
            grid_cells: options.grid_cells as usize,
            samples: options.samples as usize,
            ..SolidOptions::default()
        };
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

    fn check(&self, view: &NamedTruth<'_>, sheet: &Sheet) -> Result<(), DraftError> {
        let (raw, truth) = self.decode(view)?;
        let refuse = |what: String| {
            Err(DraftError::input("invalid_truth", format!("picture {} {what}", view.name)))
        };
        let size = raw.values.dimensions();
        let drawing = sheet.views().iter().find(|drawn| drawn.azimuth == view.azimuth);
        if let Some(expected) = drawing.map(|drawn| drawn.image.dimensions())
            && size != expected
        {
            return refuse(format!(
                "is {}x{}, the drawing of view {} {}x{}; make them the same size",
                size.0, size.1, view.azimuth, expected.0, expected.1
            ));
        }
        if !has_values(&truth) {
            return refuse("has no value; 0 is background in a PNG".to_owned());
        }
        Ok(())
    }

    fn decode(&self, view: &NamedTruth<'_>) -> Result<(RawTruth, ViewTruth), DraftError> {
        let raw = decode_truth(&(self.read)(view.name)?, self.limits).map_err(|error| {
            DraftError::input("invalid_truth", format!("picture {} {error}", view.name))
        })?;
        let truth = raw.of_sheet(view.kind, self.document);
        Ok((raw, truth))
    }

    /// Holds a reconstruction against the truth.
    ///
    /// * `compare`: measures the view at an azimuth against its truth.
    /// * `mesh`: turntable frame, px; or why there is none.
    pub fn evaluate(
        &self,
        compare: &(dyn Fn(Azimuth, &ViewTruth) -> Result<ViewComparison, DraftError> + Sync),
        mesh: Result<&Mesh, String>,
        pool: &ThreadPool,
        observer: &dyn Observer,
    ) -> Result<TruthReport, DraftError> {
        let report = |view: &NamedTruth<'_>| {
            observer.check()?;
            let (raw, truth) = self.decode(view)?;
            Ok(ViewTruthReport {
                azimuth_deg: view.azimuth.degrees(),
                kind: view.kind,
                encoding: raw.encoding,
                comparison: compare(view.azimuth, &truth)?,
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
            .map_err(|error| DraftError::input("invalid_azimuth", error))?;
        if view.depth.is_some() && view.disparity.is_some() {
            let detail = format!("view {azimuth} has a true depth and a true disparity; name one");
            return Err(DraftError::input("invalid_truth", detail));
        }
        views.push(NamedTruth { azimuth, kind, name });
    }
    views.sort_by_key(|view| view.azimuth);
    Ok(views)
}

/// The true model and the sheet pixels a unit of it.
fn true_model(
    document: &SheetDocument,
    read: ReadImage<'_>,
) -> Result<Option<(Mesh, f64)>, DraftError> {
    let truth = document.truth.as_ref();
    let Some(name) = truth.and_then(|truth| truth.model.as_deref()) else { return Ok(None) };
    let refuse = |what: &dyn std::fmt::Display| {
        DraftError::input("invalid_truth", format!("model {name}: {what}"))
    };
    let format = ModelFormat::from_file_name(name)
        .ok_or_else(|| refuse(&"the name's ending is none of glb, gltf, obj, ply, stl"))?;
    let pixels_per_unit = document
        .pixels_per_unit
        .filter(|pixels| pixels.is_finite() && *pixels > 0.0)
        .ok_or_else(|| refuse(&"the sheet gives no pixels_per_unit"))?;
    let up_axis = truth.and_then(|truth| truth.model_up_axis);
    let model = model_io::load(&read(name)?, format, up_axis, &model_io::Limits::default())
        .map_err(|error| refuse(&error))?;
    Ok(Some((model.mesh, pixels_per_unit)))
}
