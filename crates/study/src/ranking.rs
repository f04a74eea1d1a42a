//! Whether the dissertation's order of detectors is ours.

use super::protocol::is_gradient;
use super::published::PublishedFeatures;
use super::sparse::{Metric, median_of_sorted};
use uncalibrated::options::Detector;

/// How far Harris and Shi-Tomasi are ahead by one metric.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ranking {
    /// Median over the gradient detectors' combinations.
    pub gradient: Option<f64>,
    /// Median over the others'.
    pub others: Option<f64>,
    /// Gradient combinations among the best, as many as there are of them.
    pub among_best: usize,
    pub gradient_rows: usize,
    pub rows: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The median is better and more than half of the best are gradient rows.
    Holds,
    /// One of both.
    Partly,
    DoesNotHold,
}

impl Verdict {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Partly => "holds in part",
            Self::DoesNotHold => "does not hold",
        }
    }
}

impl Ranking {
    /// Of combinations and their figures, lower being better; those without a
    /// figure rank last.
    pub(crate) fn of(rows: &[(Detector, Option<f64>)]) -> Self {
        let median = |gradient: bool| {
            let of = rows.iter().filter(|(detector, _)| is_gradient(*detector) == gradient);
            let mut values: Vec<f64> = of.filter_map(|(_, value)| *value).collect();
            values.sort_by(f64::total_cmp);
            median_of_sorted(&values)
        };
        let gradient_rows = rows.iter().filter(|(detector, _)| is_gradient(*detector)).count();
        let mut ranked: Vec<_> = rows.iter().collect();
        // Stable: equals keep the table's order.
        ranked.sort_by(|(_, a), (_, b)| {
            a.unwrap_or(f64::INFINITY).total_cmp(&b.unwrap_or(f64::INFINITY))
        });
        let best = ranked.iter().take(gradient_rows);
        let among_best =
            best.filter(|(detector, value)| is_gradient(*detector) && value.is_some()).count();
        let (gradient, others) = (median(true), median(false));
        Self { gradient, others, among_best, gradient_rows, rows: rows.len() }
    }

    pub(crate) fn verdict(&self) -> Verdict {
        let ahead = match (self.gradient, self.others) {
            (Some(gradient), Some(others)) => gradient < others,
            (gradient, _) => gradient.is_some(),
        };
        let leads = 2 * self.among_best > self.gradient_rows;
        match (ahead, leads) {
            (true, true) => Verdict::Holds,
            (false, false) => Verdict::DoesNotHold,
            _ => Verdict::Partly,
        }
    }
}

/// A published row's figure; outliers as a ratio, deviations as shares.
pub(super) fn published(row: &PublishedFeatures, metric: Metric) -> f64 {
    match metric {
        Metric::SampsonAll | Metric::SampsonInliers => row.msd,
        Metric::Eigenvalue => row.sev,
        Metric::Outliers => row.outliers.0 / row.outliers.1,
        Metric::Orthogonality => row.eo_percent / 100.0,
        Metric::AspectRatio => row.ea_percent / 100.0,
    }
}

/// Spearman's rank correlation of pairs; `None` with fewer than two or where
/// all of one side are equal.
pub(super) fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let of = |side: fn(&(f64, f64)) -> f64| ranks(&pairs.iter().map(side).collect::<Vec<_>>());
    let ranked: Vec<_> = of(|pair| pair.0).into_iter().zip(of(|pair| pair.1)).collect();
    evaluation::pearson_correlation(&ranked)
}

/// Ranks from 1; equals share their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let below = |value: f64| values.iter().filter(|other| other.total_cmp(&value).is_lt()).count();
    let equal = |value: f64| values.iter().filter(|other| other.total_cmp(&value).is_eq()).count();
    values.iter().map(|&v| below(v) as f64 + (equal(v) as f64 + 1.0) / 2.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::published::TABLE_4_2;

    fn published_ranking(metric: Metric) -> Ranking {
        let rows = TABLE_4_2.iter().map(|row| (row.detector, Some(published(row, metric))));
        Ranking::of(&rows.collect::<Vec<_>>())
    }

    #[test]
    fn the_published_table_has_gradient_detectors_ahead() {
        let found = published_ranking(Metric::SampsonAll);
        // 0.1, 0.3, 0.3, 0.4, 26.3, 434.6: the mean of the middle two.
        assert!((found.gradient.unwrap() - 0.35).abs() < 1e-12);
        assert_eq!((found.among_best, found.gradient_rows, found.rows), (4, 6, 17));
        assert_eq!(found.verdict(), Verdict::Holds);
        assert_eq!(published_ranking(Metric::Outliers).among_best, 6);
    }

    #[test]
    fn verdicts_go_by_median_and_places() {
        use Detector::{Fast, Harris, Orb, ShiTomasi};
        let of = |values: [f64; 4]| {
            let rows = [Harris, ShiTomasi, Fast, Orb].into_iter().zip(values.map(Some));
            Ranking::of(&rows.collect::<Vec<_>>()).verdict()
        };
        assert_eq!(of([1.0, 2.0, 3.0, 4.0]), Verdict::Holds);
        assert_eq!(of([4.0, 3.0, 2.0, 1.0]), Verdict::DoesNotHold);
        // 2.5 against 3, but one of the best two only.
        assert_eq!(of([1.0, 4.0, 2.0, 4.5]), Verdict::Partly);
        let failed = [(Harris, None), (Fast, Some(1.0))];
        assert_eq!(Ranking::of(&failed).verdict(), Verdict::DoesNotHold);
    }

    #[test]
    fn rank_correlation_of_small_lists() {
        let same = [(1.0, 10.0), (2.0, 100.0), (3.0, 1000.0)];
        assert!((rank_correlation(&same).unwrap() - 1.0).abs() < 1e-12);
        // Ranks 1, 2.5, 2.5 against 3, 2, 1: -1.5 over √1.5·√2.
        let tied = [(0.0, 9.0), (1.0, 8.0), (1.0, 7.0)];
        let expected = -1.5 / 3.0_f64.sqrt();
        assert!((rank_correlation(&tied).unwrap() - expected).abs() < 1e-12);
        assert_eq!(rank_correlation(&[(1.0, 2.0)]), None);
    }
}
