//! Where the turning axis is in each view, from the middles of its rows.

use super::profile::Rows;
use crate::linear;

/// How much a row's middle waves three times a turn, shares of its width; the
/// most likely is taken.
const THIRD_ORDERS: [f64; 4] = [0.05, 0.02, 0.008, 0.003];
const FIFTH_PER_THIRD: f64 = 0.4;
/// The first order reaches anywhere, px.
const FIRST_ORDER_PX: f64 = 1e4;
/// How well a row's middle is known, px.
const ROW_NOISE_PX: f64 = 0.8;
/// Degrees of freedom of the rows' errors: limbs that move fit nothing.
const TAIL: f64 = 2.0;
const VIEW_TAIL: f64 = 3.0;
const ROUNDS: usize = 12;
const WIDTHS: usize = 10;
const LEAST_ROWS: usize = 8;

/// How far each view's axis is right of where it was assumed, px.
///
/// The middle of a convex section's shadow is an odd function of the azimuth:
/// waves of order 1 (where the section is), 3 and 5 (its form). They and one
/// shift a view are fitted together, by repeatedly weighted least squares.
///
/// * `usual_px`: how far off axes usually are.
pub(crate) fn shifts(azimuths_deg: &[f64], views: &[Rows], usual_px: f64) -> Vec<f64> {
    fitted(azimuths_deg, views, usual_px).0
}

/// The shifts and the log-likelihood of all rows.
pub(crate) fn fitted(azimuths_deg: &[f64], views: &[Rows], usual_px: f64) -> (Vec<f64>, f64) {
    let rows = common(views);
    if rows.len() < LEAST_ROWS || views.len() < 2 {
        return (vec![0.0; views.len()], 0.0);
    }
    let fits = THIRD_ORDERS.map(|third| fit(azimuths_deg, &rows, third, usual_px));
    let best = fits.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    best.unwrap_or((vec![0.0; views.len()], 0.0))
}

/// The middles and the mean width of rows that all views show.
fn common(views: &[Rows]) -> Vec<(Vec<f64>, f64)> {
    let count = views.iter().map(Vec::len).min().unwrap_or(0);
    let row = |y: usize| {
        let extents: Vec<(f64, f64)> = views.iter().map(|rows| rows[y]).collect::<Option<_>>()?;
        let middles = extents.iter().map(|(a, b)| (a + b) / 2.0).collect();
        let width = extents.iter().map(|(a, b)| b - a).sum::<f64>() / extents.len() as f64;
        Some((middles, width))
    };
    (0..count).filter_map(row).collect()
}

type Matrix = Vec<Vec<f64>>;

/// The inverse covariance of a row's middles, and the covariance's logarithmic
/// determinant, for rows of one width.
fn precision(azimuths_deg: &[f64], third_px: f64) -> (Matrix, f64) {
    let n = azimuths_deg.len();
    let wave = |order: f64, a: usize, b: usize| {
        (order * (azimuths_deg[a] - azimuths_deg[b]).to_radians()).cos()
    };
    let fifth_px = FIFTH_PER_THIRD * third_px;
    let mut rows: Matrix = (0..n)
        .map(|a| {
            let covariance = |b: usize| {
                let noise = if a == b { ROW_NOISE_PX.powi(2) } else { 0.0 };
                noise
                    + FIRST_ORDER_PX.powi(2) * wave(1.0, a, b)
                    + third_px.powi(2) * wave(3.0, a, b)
                    + fifth_px.powi(2) * wave(5.0, a, b)
            };
            let unit = (0..n).map(|b| f64::from(u8::from(a == b)));
            (0..n).map(covariance).chain(unit).collect()
        })
        .collect();
    let determinant = log_determinant(&rows, n);
    linear::solve(&mut rows, n);
    (rows.into_iter().map(|row| row[n..].to_vec()).collect(), determinant)
}

fn log_determinant(rows: &Matrix, n: usize) -> f64 {
    let mut work: Matrix = rows.iter().map(|row| row[..n].to_vec()).collect();
    let mut sum = 0.0;
    for k in 0..n {
        let pivot = work[k][k].max(1e-9);
        sum += pivot.ln();
        let own = work[k].clone();
        for row in &mut work[k + 1..] {
            let factor = row[k] / pivot;
            row.iter_mut().zip(&own).for_each(|(a, b)| *a -= factor * b);
        }
    }
    sum
}

fn fit(
    azimuths_deg: &[f64],
    rows: &[(Vec<f64>, f64)],
    third: f64,
    usual_px: f64,
) -> (Vec<f64>, f64) {
    let n = azimuths_deg.len();
    let widest = rows.iter().map(|row| row.1).fold(1.0, f64::max);
    let class = |width: f64| ((width / widest * WIDTHS as f64) as usize).min(WIDTHS - 1);
    let width = |class: usize| (class as f64 + 0.5) / WIDTHS as f64 * widest;
    let precisions: Vec<(Matrix, f64)> =
        (0..WIDTHS).map(|k| precision(azimuths_deg, third * width(k))).collect();
    let mut shifts = vec![0.0; n];
    let misfit = |shifts: &[f64], row: &(Vec<f64>, f64)| {
        let (inverse, _) = &precisions[class(row.1)];
        let off: Vec<f64> = row.0.iter().zip(shifts).map(|(m, s)| m - s).collect();
        let product = |a: usize| (0..n).map(|b| inverse[a][b] * off[b]).sum::<f64>();
        (0..n).map(|a| off[a] * product(a)).sum::<f64>().max(0.0)
    };
    for _ in 0..ROUNDS {
        let mut normal: Matrix = vec![vec![0.0; n + 1]; n];
        for row in rows {
            let weight = (TAIL + n as f64) / (TAIL + misfit(&shifts, row));
            let (inverse, _) = &precisions[class(row.1)];
            for a in 0..n {
                for b in 0..n {
                    normal[a][b] += weight * inverse[a][b];
                    normal[a][n] += weight * inverse[a][b] * row.0[b];
                }
            }
        }
        for a in 0..n {
            let own: f64 = shifts[a] / usual_px;
            let weight = (VIEW_TAIL + 1.0) / (VIEW_TAIL + own * own);
            normal[a][a] += weight / usual_px.powi(2);
        }
        linear::solve(&mut normal, 1);
        shifts = normal.iter().map(|row| row[n]).collect();
    }
    let of_rows: f64 = rows
        .iter()
        .map(|row| {
            let tail = (TAIL + n as f64) * (1.0 + misfit(&shifts, row) / TAIL).ln();
            -0.5 * precisions[class(row.1)].1 - 0.5 * tail
        })
        .sum();
    let of_views: f64 = shifts
        .iter()
        .map(|s| -0.5 * (VIEW_TAIL + 1.0) * (1.0 + (s / usual_px).powi(2) / VIEW_TAIL).ln())
        .sum();
    (shifts, of_rows + of_views)
}
