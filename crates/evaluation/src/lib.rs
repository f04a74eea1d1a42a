//! How good a result is, measured against what is known to be true.
//!
//! The one place that defines the quality metrics: the service, the command
//! line and the study report what these functions return. Pure functions of
//! decoded data; nothing is fitted or aligned to the truth.

mod boundary;
mod cap_blocks;
mod grey;
mod occupancy;
mod options;
mod report;
mod silhouette;
mod solid;
mod statistics;
mod surface;
mod truth;
mod view;
mod winding;

pub use grey::GreyBad2;
pub use options::EvaluationOptions;
pub use report::{
    MeanReport, ModelReport, TruthReport, ViewComparison, ViewTruthReport, compare_model,
};
pub use silhouette::{HoleReport, SilhouetteError, SilhouetteReport, compare_silhouettes};
pub use solid::{ComparisonOptions, SolidComparison, SolidError, SolidTruth, lay_on};
pub use statistics::{mean, pearson_correlation};
pub use surface::SurfaceReport;
pub use truth::{DepthScale, RawTruth, TruthEncoding, TruthError, decode_truth};
pub use view::{
    PxBad2, REFERENCE_PAIR_DEG, ViewEvaluationError, ViewReport, ViewTruth, disparity_from_depth,
    disparity_from_pairs, evaluate_view, has_values, true_mask,
};
pub use winding::WindingField;
