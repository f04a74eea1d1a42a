//! Which neighbouring views are paired.

use std::fmt;

use serde::Serialize;

use frames::Azimuth;
use sheet::Sheet;

/// Two neighbouring views, by azimuth; `right` is ahead of `left`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PairName {
    /// The view that the pair turns from.
    pub left: Azimuth,
    /// Its neighbour, the next counter-clockwise.
    pub right: Azimuth,
}

/// `40-45`.
impl fmt::Display for PairName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.left, self.right)
    }
}

impl Serialize for PairName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A pair to work on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlannedPair {
    pub name: PairName,
    /// Indices into the sheet's views.
    pub left: usize,
    pub right: usize,
    /// From left to right, degrees in (0, 360).
    pub angle_deg: f64,
}

/// Neighbouring views too far apart to be paired.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SkippedPair {
    /// Azimuths of the two views.
    pub pair: PairName,
    /// From left to right, degrees.
    pub angle_deg: f64,
    /// The widest that is paired, degrees.
    pub max_pair_angle_deg: f64,
}

/// All neighbours around the full turn, the last and first included, parted
/// into those to work on and those wider than `max_pair_angle_deg`.
pub(super) fn plan_pairs(
    sheet: &Sheet,
    max_pair_angle_deg: f64,
) -> (Vec<PlannedPair>, Vec<SkippedPair>) {
    let views = sheet.views();
    let neighbours = (0..views.len()).filter(|_| views.len() > 1).map(|left| {
        let right = (left + 1) % views.len();
        let name = PairName { left: views[left].azimuth, right: views[right].azimuth };
        PlannedPair { name, left, right, angle_deg: name.left.degrees_to(name.right) }
    });
    let (near, wide): (Vec<_>, Vec<_>) =
        neighbours.partition(|pair| pair.angle_deg <= max_pair_angle_deg);
    let skipped = wide
        .iter()
        .map(|wide| SkippedPair { pair: wide.name, angle_deg: wide.angle_deg, max_pair_angle_deg })
        .collect();
    (near, skipped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::GrayImage;
    use sheet::View;

    fn sheet(degrees: &[f64]) -> Sheet {
        let view = |&degrees: &f64| {
            View::level(Azimuth::from_degrees(degrees).unwrap(), GrayImage::new(2, 2), None)
        };
        Sheet::new(degrees.iter().map(view).collect()).unwrap()
    }

    fn names(degrees: &[f64]) -> (Vec<String>, Vec<String>) {
        let (pairs, skipped) = plan_pairs(&sheet(degrees), 30.0);
        (
            pairs.iter().map(|p| p.name.to_string()).collect(),
            skipped.iter().map(|p| p.pair.to_string()).collect(),
        )
    }

    #[test]
    fn neighbours_pair_across_zero() {
        let (pairs, skipped) = names(&[350.0, 0.0, 10.0]);
        assert_eq!(pairs, ["0-10", "350-0"]);
        assert_eq!(skipped, ["10-350"]);
    }

    #[test]
    fn a_quarter_turn_has_no_closing_pair() {
        let (pairs, skipped) = names(&[0.0, 30.0, 60.5]);
        assert_eq!(pairs, ["0-30"]);
        assert_eq!(skipped, ["30-60.5", "60.5-0"]);
    }

    #[test]
    fn one_view_has_no_neighbour() {
        assert_eq!(names(&[7.0]), (vec![], vec![]));
    }
}
