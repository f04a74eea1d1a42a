use options::OptionProblems;
use progress::Cancelled;

/// Why a model cannot be drawn as asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DrawError {
    #[error("the model has no triangle with an area")]
    NoTriangles,
    #[error("triangle {triangle} has an index out of range or a coordinate that is not finite")]
    InvalidModel { triangle: usize },
    #[error(transparent)]
    Options(#[from] OptionProblems),
    #[error("size and supersampling ask for {found} samples a view; at most {limit} are computed")]
    TooManySamples { found: u64, limit: u64 },
    #[error("the views have {found} pixels together; at most {limit} are drawn")]
    TooManyPixels { found: u64, limit: u64 },
    #[error(
        "the model reaches {radius} units from the turntable axis, beyond the camera at \
         {distance}; scale it, move the camera back, or let it be fitted"
    )]
    CameraInsideModel { radius: f64, distance: f64 },
    #[error(
        "the model's triangles hide each other too often: over {limit} comparisons in one view"
    )]
    TooComplex { limit: u64 },
    #[error("a sheet needs at least one view")]
    NoViews,
    #[error("{found} views are asked for; at most {limit} are drawn")]
    TooManyViews { found: usize, limit: usize },
    #[error("the view at {azimuth_deg} degrees is asked for twice")]
    DuplicateView { azimuth_deg: f64 },
    #[error("the drawing was cancelled")]
    Cancelled(#[from] Cancelled),
    #[error("{name} could not be encoded: {reason}")]
    Encoding { name: String, reason: String },
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
