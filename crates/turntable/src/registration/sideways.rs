//! How far each view is off to the side, from the middles of its rows.

use nalgebra::{DMatrix, DVector};

use super::NOISE_PX;
use super::profile::Profile;

/// How much a row's middle waves three times a turn, as shares of the row's
/// width: nothing for sections that look the same from behind. The most likely
/// one is taken.
const THIRD_ORDERS: [f64; 5] = [0.05, 0.025, 0.0125, 0.006, 0.003];
/// How much less it waves five times a turn.
const FIFTH_PER_THIRD: f64 = 0.4;
/// How far the first order reaches, px: anywhere.
const FIRST_ORDER_PX: f64 = 1e3;
/// How well a row's middle is drawn, px.
const ROW_NOISE_PX: f64 = 1.0;
/// Rows nearer to each other err together, share of the subject's height.
const CORRELATION: f64 = 0.05;
/// Degrees of freedom of the rows' errors: some rows fit nothing.
const TAIL: f64 = 3.0;
/// The same of the views' shifts: few are off by much.
const VIEW_TAIL: f64 = 3.0;
/// Where views agree vertically they are off this much to the side, px.
const LEAST_SCATTER_PX: f64 = 0.5;
const MIN_ROWS: usize = 8;
const ROUNDS: usize = 20;
/// Widths are rounded to so many classes.
const WIDTHS: usize = 16;

/// One row in all views: their middles and their mean width.
struct Row {
    middles: DVector<f64>,
    width_px: f64,
}

/// How far each view is off to the right, px; 0 for all if they agree.
///
/// The middle of a convex section's shadow is an odd function of the azimuth:
/// a Gaussian process with waves of order 1 (where the section is), 3 and 5
/// (its form) is fitted in every row together with one shift a view.
///
/// * `profiles`: of one scale and height.
/// * `scatter_px`: how far views are off vertically: the same is expected here.
pub(super) fn shifts(profiles: &[Profile], scatter_px: f64) -> Vec<f64> {
    let count = profiles.len();
    let common = common_rows(profiles);
    if common.len() < MIN_ROWS {
        return vec![0.0; count];
    }
    let rows: Vec<Row> = common.iter().map(|row| Row::new(row)).collect();
    let scatter_px = scatter_px.max(LEAST_SCATTER_PX);
    let fits = THIRD_ORDERS.map(|order| Fit::new(profiles, &rows, order, scatter_px));
    let best = fits.into_iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
    match best.map(|fit| fit.shifts) {
        Some(shifts) if shifts.amax() > NOISE_PX => shifts.as_slice().to_vec(),
        _ => vec![0.0; count],
    }
}

/// The extents of the rows that all views show.
fn common_rows(profiles: &[Profile]) -> Vec<Vec<(f64, f64)>> {
    let height = profiles.iter().map(|profile| profile.rows.len()).min().unwrap_or(0);
    (0..height).filter_map(|y| profiles.iter().map(|profile| profile.rows[y]).collect()).collect()
}

impl Row {
    fn new(extents: &[(f64, f64)]) -> Self {
        let middles = extents.iter().map(|(left, right)| (left + right) / 2.0);
        let widths = extents.iter().map(|(left, right)| right - left);
        Self {
            middles: DVector::from_iterator(extents.len(), middles),
            width_px: widths.sum::<f64>() / extents.len() as f64,
        }
    }
}

/// The inverse covariance of the middles of rows of one width.
struct Model {
    precision: DMatrix<f64>,
    log_determinant: f64,
}

impl Model {
    /// `None` if views are too much alike.
    fn new(profiles: &[Profile], third_px: f64) -> Option<Self> {
        let orders = [(1.0, FIRST_ORDER_PX), (3.0, third_px), (5.0, FIFTH_PER_THIRD * third_px)];
        let covariance = DMatrix::from_fn(profiles.len(), profiles.len(), |i, j| {
            let turned = profiles[i].azimuth.radians() - profiles[j].azimuth.radians();
            let waves = orders.map(|(order, px): (f64, f64)| px * px * (order * turned).cos());
            let noise = if i == j { ROW_NOISE_PX * ROW_NOISE_PX } else { 0.0 };
            waves.iter().sum::<f64>() + noise
        });
        let solver = covariance.cholesky()?;
        let diagonal = solver.l_dirty().diagonal();
        let log_determinant = -2.0 * diagonal.iter().map(|entry| entry.ln()).sum::<f64>();
        Some(Self { precision: solver.inverse(), log_determinant })
    }
}

/// The most likely shifts if sections are as irregular as `order` says.
struct Fit {
    shifts: DVector<f64>,
    log_likelihood: f64,
}

impl Fit {
    /// By iteratively reweighted least squares: rows and views have long tails.
    fn new(profiles: &[Profile], rows: &[Row], order: f64, scatter_px: f64) -> Self {
        let count = profiles.len();
        let mut fit = Self { shifts: DVector::zeros(count), log_likelihood: f64::NEG_INFINITY };
        let widest = rows.iter().map(|row| row.width_px).fold(1.0, f64::max);
        let models: Option<Vec<Model>> = (0..=WIDTHS)
            .map(|class| {
                let width_px = widest * class as f64 / WIDTHS as f64;
                Model::new(profiles, order * width_px)
            })
            .collect();
        let Some(models) = models else { return fit };
        let model = |row: &Row| &models[((row.width_px / widest) * WIDTHS as f64).round() as usize];
        // Rows err together: each is only this much news.
        let news = 1.0 / (CORRELATION * rows.len() as f64).max(1.0);
        let freedom = TAIL + count as f64;
        for _ in 0..ROUNDS {
            let prior = fit.shifts.map(|shift: f64| {
                (VIEW_TAIL + 1.0) / (VIEW_TAIL * scatter_px.powi(2) + shift * shift)
            });
            fit.log_likelihood = prior.iter().map(|precision| precision.ln()).sum::<f64>() / 2.0;
            let mut information = DMatrix::from_diagonal(&prior);
            let mut pull = DVector::zeros(count);
            for row in rows {
                let model = model(row);
                let left = &row.middles - &fit.shifts;
                let misfit = left.dot(&(&model.precision * &left));
                let weight = news * freedom / (TAIL + misfit);
                information += &model.precision * weight;
                pull += &model.precision * &row.middles * weight;
                let tail = freedom * (1.0 + misfit / TAIL).ln();
                fit.log_likelihood += news * (model.log_determinant - tail) / 2.0;
            }
            match information.cholesky() {
                Some(solver) => fit.shifts = solver.solve(&pull),
                None => break,
            }
        }
        fit
    }
}
