//! The sheets of a study: three neighbouring views, the middle one with truth.

use evaluation::ViewTruth;
use frames::Azimuth;
use sheet::View;

/// The middle view that is preferred, degrees: that of table 4.2.
const PREFERRED_MIDDLE_DEG: f64 = 45.0;

/// Spacings are equal within this, degrees.
const SAME_DEG: f64 = 1e-3;

/// One sheet to study: three neighbouring views, and the truth of the middle
/// one.
#[derive(Clone, Debug)]
pub struct StudySheet {
    /// As tables and figures call it.
    pub name: String,
    /// From one view to the next, degrees.
    pub spacing_deg: f64,
    /// By rising azimuth.
    pub views: [View; 3],
    /// True values of the middle view.
    pub truth: ViewTruth,
}

/// Why a sheet has no three views to study.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TripleError {
    /// No view with truth has neighbours at the spacing asked for.
    #[error("the sheet has no view with truth between two neighbours {spacing_deg} degrees apart")]
    NotAtSpacing {
        /// That spacing, degrees.
        spacing_deg: f64,
    },
    /// No view with truth lies half way between two others.
    #[error("the sheet has no view with truth half way between two neighbours")]
    None,
}

/// Chooses three views: one with truth half way between two others, as near to
/// 45 degrees as there is.
///
/// * `views`: azimuths, and whether they have truth.
/// * `spacing_deg`: from view to view; `None` takes the smallest there is.
///
/// Returns indices into `views`: right-hand neighbour, middle, left-hand one.
///
/// # Errors
/// [`TripleError`] if there are none.
pub fn choose_triple(
    views: &[(Azimuth, bool)],
    spacing_deg: Option<f64>,
) -> Result<[usize; 3], TripleError> {
    let at = |degrees: f64| {
        views.iter().position(|(azimuth, _)| {
            let off = (azimuth.degrees() - degrees).rem_euclid(360.0);
            off.min(360.0 - off) < SAME_DEG
        })
    };
    let with_truth = || views.iter().enumerate().filter(|(_, (_, truth))| *truth);
    let mut found: Vec<(f64, f64, [usize; 3])> = Vec::new();
    for (middle, (azimuth, _)) in with_truth() {
        let centre = azimuth.degrees();
        let all = views.iter().map(|(other, _)| azimuth.degrees_to(*other));
        let wanted = |ahead: &f64| match spacing_deg {
            Some(spacing) => (ahead - spacing).abs() < SAME_DEG,
            None => *ahead > SAME_DEG && *ahead < 90.0,
        };
        for spacing in all.filter(wanted) {
            if let (Some(before), Some(after)) = (at(centre - spacing), at(centre + spacing)) {
                let off = (centre - PREFERRED_MIDDLE_DEG).abs();
                found.push((spacing, off, [before, middle, after]));
            }
        }
    }
    let nearest = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    nearest.map(|(.., indices)| indices).ok_or(match spacing_deg {
        Some(spacing_deg) => TripleError::NotAtSpacing { spacing_deg },
        None => TripleError::None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(degrees: &[(f64, bool)]) -> Vec<(Azimuth, bool)> {
        degrees.iter().map(|&(d, truth)| (Azimuth::from_degrees(d).unwrap(), truth)).collect()
    }

    #[test]
    fn the_middle_view_has_truth_and_is_near_the_preferred() {
        let all: Vec<_> = (0..=18).map(|i| (f64::from(i) * 5.0, i != 9)).collect();
        let views = views(&all);
        // 45 has no truth: 40 and 50 are as near, the first wins.
        assert_eq!(choose_triple(&views, Some(5.0)), Ok([7, 8, 9]));
        assert_eq!(choose_triple(&views, Some(15.0)), Ok([5, 8, 11]));
        assert_eq!(choose_triple(&views, None), Ok([7, 8, 9]));
    }

    #[test]
    fn neighbours_may_lie_across_zero() {
        let views = views(&[(350.0, false), (0.0, true), (10.0, false), (90.0, true)]);
        assert_eq!(choose_triple(&views, None), Ok([0, 1, 2]));
        assert_eq!(
            choose_triple(&views, Some(5.0)),
            Err(TripleError::NotAtSpacing { spacing_deg: 5.0 })
        );
    }

    #[test]
    fn without_truth_there_is_none() {
        let views = views(&[(0.0, true), (5.0, false), (10.0, true)]);
        assert_eq!(choose_triple(&views, None), Err(TripleError::None));
    }
}
