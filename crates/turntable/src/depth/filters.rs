//! One-dimensional filters along chains.

/// Gaussian smoothing where `weights` tell how far each value counts.
///
/// Returns the smoothed value, NaN where the weights around it sum to less
/// than `min_weight`, and that sum. The kernel ends at four sigma.
pub(super) fn weighted_gaussian(
    values: &[f64],
    weights: &[f64],
    sigma: f64,
    min_weight: f64,
) -> (Vec<f64>, Vec<f64>) {
    let kernel = half_kernel(sigma);
    (0..values.len())
        .map(|centre| {
            let first = centre.saturating_sub(kernel.len() - 1);
            let last = (centre + kernel.len()).min(values.len());
            let (mut sum, mut total) = (0.0, 0.0);
            for index in first..last {
                let weight = kernel[index.abs_diff(centre)] * weights[index];
                if weight > 0.0 {
                    sum += weight * values[index];
                    total += weight;
                }
            }
            (if total > min_weight { sum / total } else { f64::NAN }, total)
        })
        .unzip()
}

/// Gaussian smoothing of values that are all there, the ends repeated.
pub(super) fn gaussian(values: &[f64], sigma: f64) -> Vec<f64> {
    let kernel = half_kernel(sigma);
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|centre| {
            (1..kernel.len()).fold(kernel[0] * values[centre], |sum, k| {
                let (below, above) = (centre.saturating_sub(k), (centre + k).min(last));
                sum + kernel[k] * (values[below] + values[above])
            })
        })
        .collect()
}

/// The weights at 0, 1, 2, … of a Gaussian that sums to 1 over both sides.
fn half_kernel(sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).round() as usize;
    let raw: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total = 2.0 * raw.iter().sum::<f64>() - raw[0];
    raw.iter().map(|weight| weight / total).collect()
}

/// The running median over `2 * half + 1` values, fewer at the ends; values
/// that are NaN are left out, and the median of none is NaN.
pub(super) fn running_median(values: &[f64], half: usize) -> Vec<f64> {
    let mut window = Vec::with_capacity(2 * half + 1);
    (0..values.len())
        .map(|centre| {
            let range = centre.saturating_sub(half)..(centre + half + 1).min(values.len());
            window.clear();
            window.extend(values[range].iter().copied().filter(|value| !value.is_nan()));
            median(&mut window)
        })
        .collect()
}

/// The middle value, NaN of none. Reorders `values`.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_constants_and_ramps() {
        assert!(gaussian(&[3.0; 9], 1.5).iter().all(|value| (value - 3.0).abs() < 1e-12));
        let ramp: Vec<f64> = (0..40).map(f64::from).collect();
        assert!((gaussian(&ramp, 2.0)[20] - 20.0).abs() < 1e-9);
    }

    #[test]
    fn weightless_values_do_not_count() {
        let (smooth, _) = weighted_gaussian(&[1.0, f64::NAN, 1.0], &[1.0, 0.0, 1.0], 1.0, 1e-6);
        assert!(smooth.iter().all(|value| (value - 1.0).abs() < 1e-12));
        let (none, total) = weighted_gaussian(&[5.0; 3], &[0.0; 3], 1.0, 1e-6);
        assert!(none[1].is_nan() && total[1] == 0.0);
    }

    #[test]
    fn the_median_ignores_an_outlier_and_gaps() {
        let values = [1.0, 1.0, 90.0, f64::NAN, 1.0, 1.0];
        assert_eq!(running_median(&values, 2), [1.0; 6]);
        assert!(running_median(&[f64::NAN], 1)[0].is_nan());
    }
}
