use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::pairs::PairName;
use crate::options::{DetectionOptions, Detector};

/// A random stream of its own for each (seed, pair, purpose): pairs do not
/// share one, so that neither their order nor their number matters.
pub(super) fn pair_seed(seed: u32, pair: PairName, purpose: u64) -> u64 {
    let micro = |degrees: f64| (degrees * 1e6) as u64;
    [u64::from(seed), micro(pair.left.degrees()), micro(pair.right.degrees()), purpose]
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash: u64, &value| {
            (hash ^ value).wrapping_mul(0x0100_0000_01b3).rotate_left(29)
        })
}

/// The detection parameters of try `attempt`; the first, 0, is as given.
///
/// Later tries change what the detector's yield depends on: thresholds by
/// factors of up to four, distances by up to two, within the options' ranges.
pub(super) fn vary_detection(
    given: &DetectionOptions,
    seed: u32,
    pair: PairName,
    attempt: u32,
) -> DetectionOptions {
    let mut varied = given.clone();
    if attempt == 0 {
        return varied;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(pair_seed(seed, pair, u64::from(attempt)));
    let mut factor = |spread: f64| 2.0_f64.powf(rng.random_range(-spread..spread));
    let scaled = |value: i32, factor: f64, low: i32, high: i32| {
        ((f64::from(value) * factor).round() as i32).clamp(low, high)
    };
    match given.detector {
        Detector::Fast => {
            varied.fast.threshold = scaled(given.fast.threshold, factor(2.0), 1, 254);
        }
        Detector::Orb => {
            let orb = &mut varied.orb;
            orb.fast_threshold = scaled(given.orb.fast_threshold, factor(2.0), 1, 254);
            orb.max_features = scaled(given.orb.max_features, factor(1.0), 8, 100_000);
        }
        Detector::Harris => {
            let harris = &mut varied.harris;
            harris.quality = (given.harris.quality * factor(2.0)).clamp(1e-6, 1.0);
            harris.min_distance_px = (given.harris.min_distance_px * factor(1.0)).min(1000.0);
        }
        Detector::ShiTomasi => {
            let corners = &mut varied.shi_tomasi;
            corners.quality = (given.shi_tomasi.quality * factor(2.0)).clamp(1e-6, 1.0);
            corners.min_distance_px = (given.shi_tomasi.min_distance_px * factor(1.0)).min(1000.0);
        }
        Detector::Sift => {
            let sift = &mut varied.sift;
            sift.contrast_threshold = (given.sift.contrast_threshold * factor(2.0)).min(10.0);
            sift.edge_threshold = (given.sift.edge_threshold * factor(1.0)).clamp(1.0, 1000.0);
        }
        Detector::Surf => {
            let surf = &mut varied.surf;
            surf.hessian_threshold = (given.surf.hessian_threshold * factor(2.0)).min(1e6);
        }
    }
    varied
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::Azimuth;

    fn pair(left: f64, right: f64) -> PairName {
        let azimuth = |degrees| Azimuth::from_degrees(degrees).unwrap();
        PairName { left: azimuth(left), right: azimuth(right) }
    }

    #[test]
    fn the_first_try_is_as_given_and_later_ones_repeatable() {
        let given = DetectionOptions::default();
        assert_eq!(vary_detection(&given, 1, pair(0.0, 5.0), 0), given);
        let second = vary_detection(&given, 1, pair(0.0, 5.0), 1);
        assert_ne!(second, given);
        assert_eq!(second, vary_detection(&given, 1, pair(0.0, 5.0), 1));
        assert_ne!(second, vary_detection(&given, 1, pair(5.0, 10.0), 1));
        assert_ne!(second, vary_detection(&given, 2, pair(0.0, 5.0), 1));
        assert_ne!(second, vary_detection(&given, 1, pair(0.0, 5.0), 2));
    }
}
