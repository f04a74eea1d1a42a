//! A person's corrections laid over the automatic matches.

use nalgebra::{Point2, Vector2};
use serde::Serialize;

use super::correspond::MatchedPoints;
use crate::vision::Correspondence;
use sheet::{MatchEdit, SheetMatch};

/// An automatic match this near to one to be removed, at both ends, is meant.
const SAME_PX: f64 = 0.5;

/// What was done to a pair's automatic matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EditReport {
    /// The given matches were used instead.
    Replaced {
        /// How many.
        given: usize,
    },
    /// Some automatic matches were dropped, others added.
    Changed {
        /// Automatic matches that were dropped.
        removed: usize,
        /// Matches to be removed that are none of the automatic ones.
        not_found: usize,
        /// Matches that came to the rest.
        added: usize,
    },
}

/// `automatic` with `edit` laid over it: what is left, then what is added.
pub(super) fn edited(
    automatic: Vec<MatchedPoints>,
    edit: Option<&MatchEdit>,
) -> (Vec<MatchedPoints>, Option<EditReport>) {
    match edit {
        None => (automatic, None),
        Some(MatchEdit::Replace(given)) => {
            let report = EditReport::Replaced { given: given.len() };
            (given.iter().map(placed).collect(), Some(report))
        }
        Some(MatchEdit::Change { remove, add }) => {
            let remove: Vec<_> = remove.iter().map(placed).collect();
            let before = automatic.len();
            let is_meant = |found: &MatchedPoints| remove.iter().any(|r| same(found, r));
            let not_found =
                remove.iter().filter(|r| !automatic.iter().any(|found| same(found, r))).count();
            let mut matches: Vec<_> =
                automatic.iter().filter(|found| !is_meant(found)).copied().collect();
            let removed = before - matches.len();
            matches.extend(add.iter().map(placed));
            let report = EditReport::Changed { removed, not_found, added: add.len() };
            (matches, Some(report))
        }
    }
}

/// From the sheet frame to OpenCV's pixels.
fn placed(given: &SheetMatch) -> MatchedPoints {
    let moved = |point: Point2<f64>| point - Vector2::new(0.5, 0.5);
    let points = Correspondence { left: moved(given.left), right: moved(given.right) };
    MatchedPoints { points, distance: None }
}

fn same(one: &MatchedPoints, other: &MatchedPoints) -> bool {
    let near = |a: Point2<f64>, b: Point2<f64>| (a - b).norm() <= SAME_PX;
    near(one.points.left, other.points.left) && near(one.points.right, other.points.right)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, right_x: f64) -> SheetMatch {
        SheetMatch { left: Point2::new(x, 5.5), right: Point2::new(right_x, 5.5) }
    }

    fn automatic(x: f64) -> MatchedPoints {
        MatchedPoints { distance: Some(3.0), ..placed(&at(x, x + 10.0)) }
    }

    #[test]
    fn without_corrections_nothing_changes() {
        assert_eq!(edited(vec![automatic(1.0)], None), (vec![automatic(1.0)], None));
    }

    #[test]
    fn given_matches_replace_all_and_move_by_half_a_pixel() {
        let edit = MatchEdit::Replace(vec![at(7.5, 9.0)]);
        let (matches, report) = edited(vec![automatic(1.0)], Some(&edit));
        assert_eq!(report, Some(EditReport::Replaced { given: 1 }));
        assert_eq!(matches[0].points.left, Point2::new(7.0, 5.0));
        assert_eq!(matches[0].points.right, Point2::new(8.5, 5.0));
        assert_eq!(matches[0].distance, None);
    }

    #[test]
    fn removes_what_is_meant_and_adds_at_the_end() {
        let edit = MatchEdit::Change {
            remove: vec![at(2.3, 12.0), at(2.0, 99.0)],
            add: vec![at(4.0, 4.0)],
        };
        let found = vec![automatic(1.0), automatic(2.0), automatic(3.0)];
        let (matches, report) = edited(found, Some(&edit));
        assert_eq!(report, Some(EditReport::Changed { removed: 1, not_found: 1, added: 1 }));
        assert_eq!(matches, [automatic(1.0), automatic(3.0), placed(&at(4.0, 4.0))]);
    }
}
