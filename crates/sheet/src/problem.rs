//! Why a sheet document, or a picture that it names, cannot be worked with.

use frames::Viewpoint;

/// Why a sheet document, or the pictures it names, cannot be worked with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetProblem {
    /// The method needs more views.
    #[error("the sheet has {found} views, the method takes {required} or more; add views")]
    TooFewViews {
        /// Views of the sheet.
        found: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// Too few of the views are level.
    #[error(
        "the sheet has {found} level views beside {elevated} from above or below, the method takes {required} or more of them; add level views, such as front and side"
    )]
    TooFewLevelViews {
        /// Level views of the sheet.
        found: usize,
        /// Its other views.
        elevated: usize,
        /// The fewest level ones that are taken.
        required: usize,
    },
    /// The method takes level views alone.
    #[error(
        "{place} is at elevation {elevation_deg} degrees, and the method takes level views alone; leave the view out, or use the method turntable"
    )]
    ElevationUnsupported {
        /// Which view, such as `views[2]`.
        place: String,
        /// What it says, degrees.
        elevation_deg: f64,
    },
    /// The sheet has more views than are taken.
    #[error("the sheet has {found} views, over the limit of {limit}; leave some out")]
    TooManyViews {
        /// Views of the sheet.
        found: usize,
        /// The most that are taken.
        limit: usize,
    },
    /// An angle is not finite.
    #[error("{place} is {value}; give a finite angle in degrees")]
    InvalidAngle {
        /// Where in the document, such as `views[2].azimuth_deg`.
        place: String,
        /// What it says, degrees.
        value: f64,
    },
    /// A number is not finite or out of range.
    #[error("{place} is {value}; give {accepted}")]
    InvalidNumber {
        /// Where in the document.
        place: String,
        /// What it says, in the field's own unit.
        value: f64,
        /// What would be accepted, for people.
        accepted: &'static str,
    },
    /// A file's name is empty.
    #[error("{place} is empty; name a file")]
    EmptyName {
        /// Where in the document, such as `views[2].image`.
        place: String,
    },
    /// A view names a true depth and a true disparity picture.
    #[error("{place} has a true depth and a true disparity picture; name one")]
    TwoTruths {
        /// Which view, such as `views[2]`.
        place: String,
    },
    /// A true model is named, but not its scale.
    #[error("the true model needs pixels_per_unit, the sheet's pixels a unit of the model")]
    ModelWithoutScale,
    /// A list or a name is too long.
    #[error("{place} has {found} {unit}, over the limit of {limit}")]
    TooLong {
        /// Where in the document.
        place: &'static str,
        /// Its length, in `unit`.
        found: usize,
        /// What is counted, such as `bytes`.
        unit: &'static str,
        /// The most that is taken, in `unit`.
        limit: usize,
    },
    /// Two views look along one direction.
    #[error(
        "views[{first}] and views[{second}] both look from {}; give each direction once ({})",
        words(*view), sameness(*view)
    )]
    DuplicateView {
        /// Where the earlier one stands.
        view: Viewpoint,
        /// Index of the earlier one in the document.
        first: usize,
        /// Index of the later one.
        second: usize,
    },
    /// The method takes drawings of one size, and these differ.
    #[error(
        "view {view} is {found}, view {first_view} is {expected}; the method takes views of one size, so pad or scale the drawings"
    )]
    DifferingSizes {
        /// The view that differs.
        view: Viewpoint,
        /// Its drawing's size, px.
        found: PictureSize,
        /// The view it differs from.
        first_view: Viewpoint,
        /// That view's size, px.
        expected: PictureSize,
    },
    /// A mask is not of its drawing's size.
    #[error("the mask of view {view} is {found}, its drawing {expected}; make them the same size")]
    MaskSize {
        /// Which view.
        view: Viewpoint,
        /// The mask's size, px.
        found: PictureSize,
        /// The drawing's size, px.
        expected: PictureSize,
    },
    /// A picture of true values is not of its drawing's size.
    #[error(
        "the picture of true values of view {view} is {found}, its drawing {expected}; make them the same size"
    )]
    TruthSize {
        /// Which view.
        view: Viewpoint,
        /// That picture's size, px.
        found: PictureSize,
        /// The drawing's size, px.
        expected: PictureSize,
    },
}

/// A viewpoint for people.
fn words(view: Viewpoint) -> String {
    let (azimuth, elevation) = (view.azimuth, view.elevation.degrees());
    if view.elevation.is_vertical() {
        let side = if elevation > 0.0 { "above" } else { "below" };
        format!("straight {side}")
    } else if view.is_level() {
        format!("azimuth {azimuth}")
    } else {
        format!("azimuth {azimuth}, elevation {elevation}")
    }
}

/// Why views that are written differently may be the same.
fn sameness(view: Viewpoint) -> &'static str {
    if view.elevation.is_vertical() {
        "there the azimuth only turns the picture"
    } else {
        "360 and 0 are the same"
    }
}

/// Width and height of a picture, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl std::fmt::Display for PictureSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}
