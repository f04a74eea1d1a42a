//! Why a page gives no views.

use progress::Cancelled;

/// Why a page gives no views.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PageError {
    /// The picture has no pixels.
    #[error("the page is {width}x{height} px: it has no pixels")]
    NoPixels {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Nothing on the page is a figure.
    #[error("no figure was found on the page; {left_out} things on it were taken for none")]
    NoFigure {
        /// What was found and left out.
        left_out: usize,
    },
    /// One of several pictures is to blame.
    #[error("picture {}: {error}", number + 1)]
    InPicture {
        /// Which, from 0.
        number: usize,
        /// Why.
        error: Box<PageError>,
    },
    /// There are more figures than a sheet has views.
    #[error("{found} figures were found on the page, at most {limit} are taken")]
    TooManyFigures {
        /// So many.
        found: usize,
        /// The most.
        limit: usize,
    },
    /// Azimuths were given for another number of figures.
    #[error("{found} figures were found on the page, {given} azimuths were given")]
    WrongNumber {
        /// Figures found.
        found: usize,
        /// Azimuths given.
        given: usize,
    },
    /// Two views would stand at one azimuth.
    #[error("two views have azimuth {0}; give each angle once (360 and 0 are the same)")]
    DuplicateAzimuth(f64),
    /// The caller no longer wants the result.
    #[error("the search of the page was cancelled")]
    Cancelled,
}

impl From<Cancelled> for PageError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}
