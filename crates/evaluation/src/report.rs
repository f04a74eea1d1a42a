//! Everything measured against a sheet's truth, with means over the views.

use nalgebra::Point3;
use serde::Serialize;

use super::silhouette::SilhouetteReport;
use super::solid::{ComparisonOptions, SolidComparison, SolidTruth};
use super::statistics::mean;
use super::truth::TruthEncoding;
use super::view::ViewReport;
use mesh::Mesh;
use sheet::TruthKind;

/// A reconstruction against everything that is known to be true of its sheet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TruthReport {
    /// The views that have truth, by rising azimuth.
    pub views: Vec<ViewTruthReport>,
    /// Over `views`.
    pub mean: MeanReport,
    /// The mesh against the true model; absent without one.
    pub model: Option<ModelReport>,
}

/// One view's maps against its truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewTruthReport {
    /// The view's azimuth, degrees in [0, 360).
    pub azimuth_deg: f64,
    /// The view's elevation, degrees.
    pub elevation_deg: f64,
    /// What the picture of true values holds, and how.
    pub kind: TruthKind,
    /// The format of the picture of true values.
    pub encoding: TruthEncoding,
    /// What the maps score against it.
    #[serde(flatten)]
    pub comparison: ViewComparison,
}

/// What was compared of a view.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ViewComparison {
    /// Of the disparity map; absent if the method gave none.
    pub disparity: Option<ViewReport>,
    /// Of the depth map, as disparity; absent if the method gave none.
    pub depth: Option<ViewReport>,
    /// Of the method's silhouette against the truth's mask; absent if the
    /// method gave none.
    pub silhouette: Option<SilhouetteReport>,
}

/// Means over views; each over those that have the figure.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeanReport {
    /// Of the disparity maps.
    pub disparity: MeanFigures,
    /// Of the depth maps.
    pub depth: MeanFigures,
    /// Intersection over union with the true silhouettes; absent without any.
    pub silhouette_iou: Option<f64>,
    /// Distance between the outer boundaries, px; absent without any.
    pub silhouette_boundary_distance_px: Option<f64>,
}

/// Means of the figures of [`ViewReport`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeanFigures {
    pub views: usize,
    pub coverage: Option<f64>,
    pub correlation: Option<f64>,
    pub bad2_px: Option<f64>,
    pub bad2_px_best_constant: Option<f64>,
    pub bad2_grey: Option<f64>,
    pub bad2_grey_as_listed: Option<f64>,
    pub bad2_grey_best_constant: Option<f64>,
    pub depth_error_over_range: Option<f64>,
}

/// A mesh against the true model, or why it could not be compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ModelReport {
    /// Both meshes were usable.
    Compared(SolidComparison),
    /// One of them was not.
    Failed {
        /// Why, for people.
        failure: String,
    },
}

impl TruthReport {
    /// The report of `views` and `model`, with the means over the views.
    pub fn new(views: Vec<ViewTruthReport>, model: Option<ModelReport>) -> Self {
        let comparisons: Vec<_> = views.iter().map(|view| &view.comparison).collect();
        Self { mean: MeanReport::of(&comparisons), views, model }
    }
}

impl MeanReport {
    fn of(views: &[&ViewComparison]) -> Self {
        let silhouettes = || views.iter().filter_map(|view| view.silhouette.as_ref());
        let of = |report: fn(&ViewComparison) -> Option<&ViewReport>| {
            MeanFigures::of(views.iter().filter_map(|view| report(view)))
        };
        Self {
            disparity: of(|view| view.disparity.as_ref()),
            depth: of(|view| view.depth.as_ref()),
            silhouette_iou: mean(silhouettes().map(|found| found.iou)),
            silhouette_boundary_distance_px: mean(
                silhouettes().filter_map(|found| found.mean_boundary_distance_px),
            ),
        }
    }
}

impl MeanFigures {
    /// Means over `reports`.
    pub fn of<'a>(reports: impl IntoIterator<Item = &'a ViewReport>) -> Self {
        let reports: Vec<_> = reports.into_iter().collect();
        let of = |figure: &dyn Fn(&ViewReport) -> Option<f64>| {
            mean(reports.iter().filter_map(|report| figure(report)))
        };
        Self {
            views: reports.len(),
            coverage: of(&|report| Some(report.coverage)),
            correlation: of(&|report| report.correlation),
            bad2_px: of(&|report| report.bad2_px.map(|bad| bad.honest)),
            bad2_px_best_constant: of(&|report| report.bad2_px.map(|bad| bad.best_constant)),
            bad2_grey: of(&|report| Some(report.bad2_grey.honest)),
            bad2_grey_as_listed: of(&|report| Some(report.bad2_grey.as_listed)),
            bad2_grey_best_constant: of(&|report| Some(report.bad2_grey.best_constant)),
            depth_error_over_range: of(&|report| report.depth_error_over_range),
        }
    }
}

/// Compares a mesh with the true model, nothing aligned.
///
/// * `mesh`: turntable frame, sheet pixels.
/// * `truth`: the model, Z up, front towards -Y, its origin on the turntable
///   axis at the pictures' middle row, its own unit.
/// * `pixels_per_unit`: sheet pixels a unit of the model.
pub fn compare_model(
    mesh: &Mesh,
    truth: &Mesh,
    pixels_per_unit: f64,
    options: ComparisonOptions,
) -> ModelReport {
    let positions = mesh.positions.iter().map(|p| Point3::from(p.coords / pixels_per_unit));
    let mesh = Mesh { positions: positions.collect(), triangles: mesh.triangles.clone() };
    let failed = |whose: &str, error: &dyn std::error::Error| ModelReport::Failed {
        failure: format!("{whose}: {error}"),
    };
    let truth = match SolidTruth::new(truth, options) {
        Ok(truth) => truth,
        Err(error) => return failed("the true model", &error),
    };
    match truth.evaluate(&mesh) {
        Ok(report) => ModelReport::Compared(report),
        Err(error) => failed("the reconstruction", &error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::shapes::cuboid;
    use crate::view::{ViewTruth, evaluate_view};
    use picture::FloatImage;

    fn report(ours: &[f32], truth: &[f32]) -> ViewReport {
        let map =
            |values: &[f32]| FloatImage::from_raw(values.len() as u32, 1, values.to_vec()).unwrap();
        evaluate_view(&map(ours), &ViewTruth::Metric(map(truth))).unwrap()
    }

    fn view(disparity: Option<ViewReport>) -> ViewTruthReport {
        ViewTruthReport {
            azimuth_deg: 0.0,
            elevation_deg: 0.0,
            kind: TruthKind::Depth,
            encoding: TruthEncoding::Png16,
            comparison: ViewComparison { disparity, ..ViewComparison::default() },
        }
    }

    #[test]
    fn means_are_over_views_that_have_the_figure() {
        let all_good = report(&[1.0, 2.0], &[1.0, 2.0]);
        let half_bad = report(&[1.0, 9.0], &[1.0, 2.0]);
        // A flat truth has no correlation and no range.
        let flat = report(&[9.0, 9.0], &[1.0, 1.0]);
        let views = [Some(all_good), Some(half_bad), Some(flat), None].map(view);
        let found = TruthReport::new(views.into(), None);
        assert_eq!(found.mean.disparity.views, 3);
        assert_eq!(found.mean.disparity.bad2_px, Some(0.5));
        assert!((found.mean.disparity.correlation.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(found.mean.disparity.depth_error_over_range, Some((0.0 + 3.5) / 2.0));
        assert_eq!(found.mean.depth, MeanFigures::default());
    }

    #[test]
    fn a_mesh_in_pixels_meets_its_model_in_units() {
        let options =
            ComparisonOptions { grid_cells: 44, samples: 2000, ..ComparisonOptions::default() };
        let truth = cuboid([-1.0; 3], [1.0; 3]);
        let found = compare_model(&cuboid([-50.0; 3], [50.0; 3]), &truth, 50.0, options);
        assert!(matches!(found, ModelReport::Compared(report) if report.iou == 1.0), "{found:?}");
        let nothing = compare_model(&Mesh::default(), &truth, 50.0, options);
        assert!(matches!(nothing, ModelReport::Failed { .. }));
        let json = serde_json::to_value(&found).unwrap();
        assert_eq!((&json["iou"], &json["hausdorff"].is_number()), (&1.0.into(), &true));
    }
}
