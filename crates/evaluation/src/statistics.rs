//! Statistics over matching values of two maps.

/// Pearson's correlation coefficient of `(x, y)` pairs, in [-1, 1].
///
/// `None` with fewer than two pairs or where either side is constant.
pub fn pearson_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean_x = pairs.iter().map(|pair| pair.0).sum::<f64>() / count;
    let mean_y = pairs.iter().map(|pair| pair.1).sum::<f64>() / count;
    let (xx, yy, xy) = pairs.iter().fold((0.0, 0.0, 0.0), |(xx, yy, xy), (x, y)| {
        let (dx, dy) = (x - mean_x, y - mean_y);
        (xx + dx * dx, yy + dy * dy, xy + dx * dy)
    });
    // A constant's mean may differ from it by rounding, so look at the values.
    let varies = |of: fn(&(f64, f64)) -> f64| pairs.iter().any(|pair| of(pair) != of(&pairs[0]));
    (varies(|pair| pair.0) && varies(|pair| pair.1))
        .then(|| (xy / (xx.sqrt() * yy.sqrt())).clamp(-1.0, 1.0))
}

/// The share of `values` further than `tolerance` from the constant that
/// suits most of them: what a map without any content scores.
///
/// `values` are sorted in place; 0 without values.
pub(super) fn best_constant_bad_share(values: &mut [f64], tolerance: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let mut first = 0;
    let mut most = 0;
    for (last, value) in values.iter().enumerate() {
        while value - values[first] > 2.0 * tolerance {
            first += 1;
        }
        most = most.max(last + 1 - first);
    }
    share(values.len() - most, values.len())
}

/// The mean; `None` of nothing.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// `part` of `whole`; 0 of nothing.
pub(super) fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// The smallest and largest of finite values.
pub(super) fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((f64::min(low, value), f64::max(high, value))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_small_arrays() {
        let line = [(1.0, 2.0), (2.0, 4.0), (3.0, 6.0)];
        assert!((pearson_correlation(&line).unwrap() - 1.0).abs() < 1e-15);
        // Deviations (-1.5, -.5, .5, 1.5) and (.5, -1.5, 1.5, -.5): 1 over 5.
        let loose = [(1.0, 3.0), (2.0, 1.0), (3.0, 4.0), (4.0, 2.0)];
        assert!((pearson_correlation(&loose).unwrap() - 0.0).abs() < 1e-15);
        // Deviations (-1, 0, 1) and (-1, 1, 0): 1 over √2·√2.
        let half = [(0.0, 0.0), (1.0, 2.0), (2.0, 1.0)];
        assert!((pearson_correlation(&half).unwrap() - 0.5).abs() < 1e-15);
        let inverted = [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)];
        assert!((pearson_correlation(&inverted).unwrap() + 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_constant_or_nothing_has_no_correlation() {
        assert_eq!(pearson_correlation(&[(0.1, 1.0), (0.1, 2.0), (0.1, 7.0)]), None);
        assert_eq!(pearson_correlation(&[(1.0, 0.3), (2.0, 0.3), (9.0, 0.3)]), None);
        assert_eq!(pearson_correlation(&[]), None);
        assert_eq!(pearson_correlation(&[(1.0, 1.0)]), None);
    }

    #[test]
    fn the_best_constant_takes_the_densest_window() {
        // A window of 4: {10, 12, 14} beats {0, 1}; its ends count as good.
        let share = best_constant_bad_share(&mut [0.0, 14.0, 1.0, 10.0, 12.0], 2.0);
        assert!((share - 0.4).abs() < 1e-15);
        assert_eq!(best_constant_bad_share(&mut [5.0; 3], 2.0), 0.0);
        assert_eq!(best_constant_bad_share(&mut [], 2.0), 0.0);
    }
}
