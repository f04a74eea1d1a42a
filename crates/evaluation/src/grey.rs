//! Bad 2.0 counted in 8-bit grey levels, as the dissertation lists it.

use serde::Serialize;

use super::statistics::{best_constant_bad_share, range, share};
use super::view::BAD_OVER;

/// bad2.0 in 8-bit grey levels, both maps stretched to 0..255 over the mask.
///
/// The dissertation does not say in which unit it counts; this is the reading
/// its listing suggests. Stretching fits scale and offset to each map, so it
/// is no substitute for px.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GreyBad2 {
    /// Off by more than 2 levels either way; a missing value is bad.
    pub honest: f64,
    /// As listed: an 8-bit subtraction of ours from the truth that saturates at
    /// zero, then a threshold at 1.99. Only what is too dark (too far, or
    /// missing and so black) counts, from 2 levels up.
    pub as_listed: f64,
    /// The best constant grey's, counted as `honest`.
    pub best_constant: f64,
}

/// Source: Arys 2020, §3.2 (the ramp) and listing 4.2.
pub(super) fn grey_bad2(samples: &[(Option<f64>, f64)]) -> GreyBad2 {
    let ours = range(samples.iter().filter_map(|sample| sample.0));
    let truth = range(samples.iter().map(|sample| sample.1));
    let level = |range: Option<(f64, f64)>, value: f64| range.map_or(0, |r| stretch(r, value));
    let (mut honest, mut listed) = (0, 0);
    let mut truths = Vec::with_capacity(samples.len());
    for &(value, true_value) in samples {
        let expected = level(truth, true_value);
        let found = value.map(|value| level(ours, value));
        let off = found.map(|found| f64::from(found.abs_diff(expected)));
        honest += usize::from(off.is_none_or(|off| off > BAD_OVER));
        listed += usize::from(f64::from(expected.saturating_sub(found.unwrap_or(0))) > 1.99);
        truths.push(f64::from(expected));
    }
    GreyBad2 {
        honest: share(honest, samples.len()),
        as_listed: share(listed, samples.len()),
        best_constant: best_constant_bad_share(&mut truths, BAD_OVER),
    }
}

/// A flat map has no ramp: it is black.
fn stretch((low, high): (f64, f64), value: f64) -> u8 {
    if high > low { (255.0 * (value - low) / (high - low)).round() as u8 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(ours: &[f64], truth: &[f64]) -> Vec<(Option<f64>, f64)> {
        ours.iter().zip(truth).map(|(o, t)| (o.is_finite().then_some(*o), *t)).collect()
    }

    /// Both ramps span 0..255 already, so levels are the values.
    #[test]
    fn levels_off_either_way_are_bad_but_listed_on_one_side_only() {
        let truth = [0.0, 255.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0];
        let ours = [0.0, 255.0, 102.0, 103.0, 98.0, 97.0, 200.0, f64::NAN];
        let found = grey_bad2(&samples(&ours, &truth));
        // Honest: 103, 97, 200 and the missing one.
        assert!((found.honest - 0.5).abs() < 1e-12);
        // Listed: 98, 97 and the missing one; nothing that is too bright.
        assert!((found.as_listed - 3.0 / 8.0).abs() < 1e-12);
        assert!((found.best_constant - 0.25).abs() < 1e-12);
    }

    #[test]
    fn scale_and_offset_do_not_count() {
        let found = grey_bad2(&samples(&[7.0, 9.0, 11.0], &[-1.0, 0.0, 1.0]));
        assert_eq!((found.honest, found.as_listed), (0.0, 0.0));
    }

    #[test]
    fn a_flat_map_is_black() {
        let found = grey_bad2(&samples(&[5.0, 5.0], &[0.0, 1.0]));
        assert_eq!((found.honest, found.as_listed), (0.5, 0.5));
        let nothing = grey_bad2(&samples(&[f64::NAN, f64::NAN], &[0.0, 1.0]));
        assert_eq!((nothing.honest, nothing.as_listed), (1.0, 0.5));
    }
}
