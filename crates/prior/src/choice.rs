//! Which views to take of many.

use std::f64::consts::TAU;

/// Indices of at most `count` azimuths, spread best, ascending: beginning with
/// the first, always the one farthest from those taken.
pub(crate) fn best_spread(azimuths_rad: &[f64], count: usize) -> Vec<usize> {
    if azimuths_rad.len() <= count {
        return (0..azimuths_rad.len()).collect();
    }
    let apart = |a: usize, b: usize| {
        let angle = (azimuths_rad[a] - azimuths_rad[b]).rem_euclid(TAU);
        angle.min(TAU - angle)
    };
    let mut taken = vec![0];
    while taken.len() < count {
        let distance = |index: usize| {
            taken.iter().map(|&other| apart(index, other)).fold(f64::INFINITY, f64::min)
        };
        let left = (0..azimuths_rad.len()).filter(|index| !taken.contains(index));
        // The first of equals, so that the order of views decides.
        let best = left.fold(None, |best: Option<(f64, usize)>, index| {
            let own = distance(index);
            if best.is_none_or(|(best, _)| own > best + 1e-9) { Some((own, index)) } else { best }
        });
        taken.extend(best.map(|(_, index)| index));
    }
    taken.sort_unstable();
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_views_are_all_taken() {
        assert_eq!(best_spread(&[0.0, 1.0, 2.0], 8), [0, 1, 2]);
    }

    #[test]
    fn many_views_are_thinned_evenly() {
        let dense: Vec<f64> = (0..36).map(|i| f64::from(i) * TAU / 36.0).collect();
        let kept = best_spread(&dense, 4);
        assert_eq!(kept, [0, 9, 18, 27]);
    }
}
