//! How the parameters of repeated tries vary, and their random streams.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::pairs::PairName;
use crate::Options;
use crate::options::{DetectionOptions, Detector, Feedback};

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

/// What tries vary.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameters {
    pub detection: DetectionOptions,
    /// Inlier threshold, px.
    pub max_error_px: f64,
}

impl Parameters {
    pub(crate) fn of(options: &Options) -> Self {
        Self { detection: options.detection.clone(), max_error_px: options.epipolar.max_error_px }
    }
}

/// The parameters of try `attempt`, varied from `from`; the first, 0, is as
/// given.
///
/// Later tries change what the detector's yield depends on: thresholds by
/// factors of up to four, distances by up to two, within the options' ranges;
/// where all five metrics are optimised the inlier threshold too, by up to two.
pub(super) fn vary(
    from: &Parameters,
    options: &Options,
    pair: PairName,
    attempt: u32,
) -> Parameters {
    if attempt == 0 {
        return from.clone();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(pair_seed(options.seed, pair, u64::from(attempt)));
    let detection = vary_detection(&from.detection, &mut rng);
    let max_error_px = match options.epipolar.feedback {
        Feedback::MeanSampson => from.max_error_px,
        Feedback::FiveMetrics => {
            (from.max_error_px * 2.0_f64.powf(rng.random_range(-1.0..1.0))).clamp(0.01, 100.0)
        }
    };
    Parameters { detection, max_error_px }
}

fn vary_detection(given: &DetectionOptions, rng: &mut ChaCha8Rng) -> DetectionOptions {
    let mut varied = given.clone();
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
    use frames::Azimuth;

    fn pair(left: f64, right: f64) -> PairName {
        let azimuth = |degrees| Azimuth::from_degrees(degrees).unwrap();
        PairName { left: azimuth(left), right: azimuth(right) }
    }

    #[test]
    fn the_first_try_is_as_given_and_later_ones_repeatable() {
        let options = |seed| Options { seed, ..Options::default() };
        let given = Parameters::of(&options(1));
        let varied = |seed, pair, attempt| vary(&given, &options(seed), pair, attempt);
        assert_eq!(varied(1, pair(0.0, 5.0), 0), given);
        let second = varied(1, pair(0.0, 5.0), 1);
        assert_ne!(second.detection, given.detection);
        assert_eq!(second.max_error_px, given.max_error_px);
        assert_eq!(second, varied(1, pair(0.0, 5.0), 1));
        assert_ne!(second, varied(1, pair(5.0, 10.0), 1));
        assert_ne!(second, varied(2, pair(0.0, 5.0), 1));
        assert_ne!(second, varied(1, pair(0.0, 5.0), 2));
    }

    #[test]
    fn the_threshold_varies_only_where_all_metrics_count() {
        let mut options = Options::default();
        options.epipolar.feedback = Feedback::FiveMetrics;
        let given = Parameters::of(&options);
        let errors: Vec<_> = (1..20)
            .map(|attempt| vary(&given, &options, pair(0.0, 5.0), attempt).max_error_px)
            .collect();
        assert!(errors.iter().all(|px| (1.0..=4.0).contains(px)), "{errors:?}");
        assert!(errors.iter().any(|px| *px > 2.2) && errors.iter().any(|px| *px < 1.8));
    }

    /// Whatever the detector, the varied parameters stay within their ranges.
    #[test]
    fn varied_options_are_valid_options() {
        use Detector::{Fast, Harris, Orb, ShiTomasi, Sift, Surf};
        let mut options = Options::default();
        for detector in [Fast, Orb, Harris, ShiTomasi, Sift, Surf] {
            options.detection.detector = detector;
            options.detection.descriptor = crate::options::Descriptor::Surf;
            let given = Parameters::of(&options);
            let mut used = given.clone();
            let mut changed = 0;
            for attempt in 1..40 {
                let once = vary(&given, &options, pair(0.0, 5.0), attempt);
                changed += i32::from(once.detection != given.detection);
                used = vary(&used, &options, pair(0.0, 5.0), attempt);
                let all = Options { detection: used.detection.clone(), ..options.clone() };
                ::options::check_set(&all).unwrap();
            }
            assert!(changed >= 35, "{detector:?}: {changed} of 39");
        }
    }
}
