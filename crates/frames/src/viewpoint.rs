//! Where a view's camera stands: its azimuth, and how far above the ground it looks from.

use std::fmt;

use super::Azimuth;

/// A camera's elevation, degrees in [-90, 90], up positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elevation(f64);

/// No elevation: not finite, or beyond straight down or up.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} is no elevation from -90 to 90 degrees")]
pub struct NoElevation(pub f64);

impl Elevation {
    /// A level camera's.
    pub const LEVEL: Self = Self(0.0);

    /// Rounds `degrees` to a millionth, as azimuths are.
    ///
    /// # Errors
    /// [`NoElevation`] for what is not within 90 degrees of level.
    pub fn from_degrees(degrees: f64) -> Result<Self, NoElevation> {
        let micro = (degrees * 1e6).round() / 1e6;
        // Adding zero turns -0 into 0. NaN is in no range.
        if (-90.0..=90.0).contains(&micro) {
            Ok(Self(micro + 0.0))
        } else {
            Err(NoElevation(degrees))
        }
    }

    /// Degrees in [-90, 90].
    pub fn degrees(self) -> f64 {
        self.0
    }

    /// Sine and cosine; straight up and down they are exact.
    pub fn sin_cos(self) -> (f64, f64) {
        if self.is_vertical() { (self.0.signum(), 0.0) } else { self.0.to_radians().sin_cos() }
    }

    /// Whether the camera looks straight down or up.
    pub fn is_vertical(self) -> bool {
        self.0.abs() == 90.0
    }
}

impl Eq for Elevation {}

impl Ord for Elevation {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Elevation {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Where a view's camera stands; it looks at the turntable's origin.
///
/// Straight down or up, at an elevation of 90 or -90, the azimuth only turns the picture in its
/// own plane. It is as if the camera had been raised there from that azimuth: from above with
/// azimuth 0 the subject's front is at the picture's bottom edge and its left at the right one,
/// from below the front is at the top edge.
///
/// ```
/// use frames::{Azimuth, Elevation, Viewpoint};
///
/// let front = Azimuth::from_degrees(0.0).unwrap();
/// let top = Viewpoint { azimuth: front, elevation: Elevation::from_degrees(90.0).unwrap() };
/// assert_eq!(top.to_string(), "0_e90");
/// assert_eq!(Viewpoint::from(front).to_string(), "0");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Viewpoint {
    /// About the turntable axis.
    pub azimuth: Azimuth,
    /// Above the ground.
    pub elevation: Elevation,
}

impl Viewpoint {
    /// Whether the camera is level.
    pub fn is_level(self) -> bool {
        self.elevation == Elevation::LEVEL
    }

    /// Whether both look along one direction, perhaps with the picture turned.
    pub fn looks_like(self, other: Self) -> bool {
        self == other || (self.elevation == other.elevation && self.elevation.is_vertical())
    }

    /// As file names have it: `045`, `022.5_e-30`.
    pub fn padded(self) -> String {
        self.with_elevation(self.azimuth.padded())
    }

    fn with_elevation(self, azimuth: String) -> String {
        if self.is_level() { azimuth } else { format!("{azimuth}_e{}", self.elevation.0) }
    }
}

/// A level camera's.
impl From<Azimuth> for Viewpoint {
    fn from(azimuth: Azimuth) -> Self {
        Self { azimuth, elevation: Elevation::LEVEL }
    }
}

/// The shortest decimals: `45` for a level view, `22.5_e-30` for others.
impl fmt::Display for Viewpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.with_elevation(self.azimuth.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn viewpoint(azimuth: f64, elevation: f64) -> Viewpoint {
        Viewpoint {
            azimuth: Azimuth::from_degrees(azimuth).unwrap(),
            elevation: Elevation::from_degrees(elevation).unwrap(),
        }
    }

    #[test]
    fn level_views_keep_their_names() {
        assert_eq!(viewpoint(22.5, 0.0).to_string(), "22.5");
        assert_eq!(viewpoint(22.5, -0.0).padded(), "022.5");
        assert_eq!(viewpoint(0.0, 90.0).to_string(), "0_e90");
        assert_eq!(viewpoint(315.0, -30.5).padded(), "315_e-30.5");
    }

    #[test]
    fn elevations_end_at_the_vertical() {
        for degrees in [90.1, -91.0, f64::NAN, f64::INFINITY] {
            assert!(Elevation::from_degrees(degrees).is_err(), "{degrees}");
        }
        let down = Elevation::from_degrees(90.0 + 1e-9).unwrap();
        assert_eq!(down.sin_cos(), (1.0, 0.0));
        assert_eq!(viewpoint(0.0, -90.0).elevation.sin_cos(), (-1.0, 0.0));
    }

    #[test]
    fn at_the_vertical_azimuths_are_one_direction() {
        assert!(viewpoint(0.0, 90.0).looks_like(viewpoint(45.0, 90.0)));
        assert!(!viewpoint(0.0, 90.0).looks_like(viewpoint(0.0, -90.0)));
        assert!(!viewpoint(0.0, 30.0).looks_like(viewpoint(45.0, 30.0)));
    }
}
