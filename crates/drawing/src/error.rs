//! Why a model cannot be drawn as asked.

use frames::Viewpoint;
use mesh::raster::Overdrawn;
use options::OptionProblems;
use progress::Cancelled;

/// Why a model cannot be drawn as asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DrawError {
    /// No triangle of the model has an area.
    #[error("the model has no triangle with an area")]
    NoTriangles,
    /// A triangle refers to a vertex that is missing or not finite.
    #[error("triangle {triangle} has an index out of range or a coordinate that is not finite")]
    InvalidModel {
        /// Index of the triangle.
        triangle: usize,
    },
    /// Options that are unknown, out of range or contradict each other.
    #[error(transparent)]
    Options(#[from] OptionProblems),
    /// A view is too large for its supersampling.
    #[error("size and supersampling ask for {found} samples a view; at most {limit} are computed")]
    TooManySamples {
        /// Samples of one view: its pixels times supersampling squared.
        found: u64,
        /// The most that are computed.
        limit: u64,
    },
    /// The sheet is too large as a whole.
    #[error("the views have {found} pixels together; at most {limit} are drawn")]
    TooManyPixels {
        /// Pixels of all views together.
        found: u64,
        /// The most that are drawn.
        limit: u64,
    },
    /// The model reaches the camera plane, so part of it may be behind the camera.
    #[error(
        "the model reaches {radius} units from the turntable axis, beyond the camera at \
         {distance}; scale it, move the camera back, or let it be fitted"
    )]
    CameraInsideModel {
        /// Largest distance of the model from the origin, scene units.
        radius: f64,
        /// From the camera plane to the origin, scene units.
        distance: f64,
    },
    /// Too many layers of triangles cover each other in one view.
    #[error(
        "the model's triangles hide each other too often: over {limit} comparisons in one view"
    )]
    TooComplex {
        /// The most that one view may visit: triangles under lines, or samples.
        limit: u64,
    },
    /// No viewpoint is given.
    #[error("a sheet needs at least one view")]
    NoViews,
    /// More viewpoints are given than a sheet may have.
    #[error("{found} views are asked for; at most {limit} are drawn")]
    TooManyViews {
        /// Views asked for.
        found: usize,
        /// The most that are drawn.
        limit: usize,
    },
    /// Two views look along one direction.
    #[error(
        "the view from azimuth {}, elevation {} is asked for twice (straight from above or below every azimuth is the same)",
        view.azimuth, view.elevation.degrees()
    )]
    DuplicateView {
        /// Where the later one stands.
        view: Viewpoint,
    },
    /// Somebody asked to stop.
    #[error("the drawing was cancelled")]
    Cancelled(#[from] Cancelled),
    /// A file of the sheet could not be encoded.
    #[error("{name} could not be encoded: {reason}")]
    Encoding {
        /// Name of the file.
        name: String,
        /// The encoder's own message.
        reason: String,
    },
}

impl DrawError {
    /// A stable name of the condition.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoTriangles => "no_triangles",
            Self::InvalidModel { .. } => "invalid_model",
            Self::Options(_) => "invalid_options",
            Self::TooManySamples { .. } => "too_many_samples",
            Self::TooManyPixels { .. } => "too_many_pixels",
            Self::CameraInsideModel { .. } => "camera_inside_model",
            Self::TooComplex { .. } => "too_complex",
            Self::NoViews => "no_views",
            Self::TooManyViews { .. } => "too_many_views",
            Self::DuplicateView { .. } => "duplicate_view",
            Self::Cancelled(_) => "cancelled",
            Self::Encoding { .. } => "encoding",
        }
    }
}

impl From<Overdrawn> for DrawError {
    fn from(error: Overdrawn) -> Self {
        Self::TooComplex { limit: error.limit }
    }
}
