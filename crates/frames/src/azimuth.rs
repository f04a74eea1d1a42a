//! Azimuths: angles about the turntable axis.

use std::cmp::Ordering;
use std::fmt;

/// A view's angle about the turntable axis, degrees in [0, 360).
///
/// The camera moves counter-clockwise seen from above: 0 is the front, 90
/// shows the subject's left side.
///
/// ```
/// use frames::Azimuth;
///
/// let side = Azimuth::from_degrees(-270.0).unwrap();
/// assert_eq!(side.degrees(), 90.0);
/// assert_eq!(Azimuth::from_degrees(22.5).unwrap().padded(), "022.5");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Azimuth(f64);

/// The angle is infinite or not a number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} is not a finite angle in degrees")]
pub struct NotFinite(pub f64);

impl Azimuth {
    /// The shortest decimal with three digits before the point, as file names
    /// have it: `045`, `022.5`.
    pub fn padded(self) -> String {
        let text = self.to_string();
        let digits = text.find('.').unwrap_or(text.len());
        format!("{}{text}", "0".repeat(3_usize.saturating_sub(digits)))
    }

    /// Normalises `degrees` to [0, 360), rounded to a millionth of a degree so
    /// that angles written differently but meant alike compare equal.
    ///
    /// # Errors
    /// [`NotFinite`] for infinities and NaN.
    pub fn from_degrees(degrees: f64) -> Result<Self, NotFinite> {
        if !degrees.is_finite() {
            return Err(NotFinite(degrees));
        }
        let micro = (degrees.rem_euclid(360.0) * 1e6).round() / 1e6;
        Ok(Self(if micro >= 360.0 { 0.0 } else { micro + 0.0 }))
    }

    /// Degrees in [0, 360).
    pub fn degrees(self) -> f64 {
        self.0
    }

    /// Radians in [0, 2π).
    pub fn radians(self) -> f64 {
        self.0.to_radians()
    }

    /// How far `next` is ahead of `self`, counter-clockwise, degrees in [0, 360).
    pub fn degrees_to(self, next: Self) -> f64 {
        (next.0 - self.0).rem_euclid(360.0)
    }
}

impl Eq for Azimuth {}

impl Ord for Azimuth {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Azimuth {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The shortest decimal: `45`, `22.5`.
impl fmt::Display for Azimuth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn azimuth(degrees: f64) -> Azimuth {
        Azimuth::from_degrees(degrees).unwrap()
    }

    #[test]
    fn angles_a_turn_apart_are_the_same_view() {
        assert_eq!(azimuth(360.0), azimuth(0.0));
        assert_eq!(azimuth(-45.0), azimuth(315.0));
        assert_eq!(azimuth(-1e-9), azimuth(0.0));
        assert_eq!(azimuth(-0.0).to_string(), "0");
    }

    #[test]
    fn writes_the_shortest_decimal() {
        assert_eq!(azimuth(405.0).to_string(), "45");
        assert_eq!(azimuth(22.5).to_string(), "22.5");
    }

    #[test]
    fn refuses_what_is_not_finite() {
        assert!(Azimuth::from_degrees(f64::NAN).is_err());
        assert!(Azimuth::from_degrees(f64::INFINITY).is_err());
    }

    #[test]
    fn measures_ahead_across_zero() {
        assert_eq!(azimuth(315.0).degrees_to(azimuth(0.0)), 45.0);
    }
}
