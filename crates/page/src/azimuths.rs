//! Which order of views fits their silhouettes and what is drawn in them.
//!
//! Row by row, the middle between a silhouette's left and right end changes
//! with the azimuth as `g cos a + f sin a`, and its width about as
//! `w + b cos 2a + c sin 2a`. With normal priors on the coefficients, `g` and
//! `c` being small for subjects whose halves mirror each other, the views'
//! middles and widths are normal with a covariance that each order of views
//! states: the order under which they are likeliest fits best. What stays open,
//! which of two ends is the front and which way the sides face, is told by
//! faces and feet, and by what is drawn inside moving from view to view.
//!
//! None of these is as independent as a sum of their logarithms takes them to
//! be: rows are alike, views of one subject err alike. So each has a weight
//! under which the shares of the orders were likeliest on pages of other
//! subjects whose azimuths are known, beside the layouts' own shares. That
//! makes an order's share what it says: how often it is right.

use nalgebra::{DMatrix, DVector};

use crate::layouts::Layout;
use crate::shape::{PROFILE_ROWS, Shape};

/// Standard deviations of a row's coefficients, in heights.
const SIDE: f64 = 0.03;
const FRONT: f64 = 0.018;
const MIDDLE_NOISE: f64 = 0.014;
const WIDTH: f64 = 0.3;
const WIDTH_TURN: f64 = 0.08;
const WIDTH_SKEW: f64 = 0.02;
const WIDTH_NOISE: f64 = 0.03;
/// Rows are so alike, and so unlike what is assumed of them, that all count as half of one.
const ROWS: f64 = 0.5;
/// Weights of what faces and feet tell.
const FACE: f64 = 0.3;
const FACING: f64 = 0.3;
const FEET: f64 = 0.12;
/// Weights of what is drawn inside being where the turn brings it, by the farthest turn for which
/// each holds, degrees: less is seen of both views over more.
const FOLLOWED: [(f64, f64); 2] = [(61.0, 8.0), (100.0, 4.0)];
/// The weights are for so many views at most; more say no more, for they repeat each other.
const MOST_VIEWS: f64 = 8.0;

/// The best order, how likely each azimuth of it is and all together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Guess {
    pub(crate) azimuths: Vec<f64>,
    pub(crate) confidence: Vec<f64>,
    pub(crate) whole: f64,
}

/// Chooses among `layouts`, of which each has an azimuth for each shape; `None`
/// if there are none.
pub(crate) fn guess(shapes: &[Shape], layouts: &[Layout]) -> Option<Guess> {
    let weight = (MOST_VIEWS / shapes.len().max(1) as f64).min(1.0);
    let score = |layout: &Layout| layout.prior + weight * likelihood(shapes, &layout.azimuths);
    let scores: Vec<f64> = layouts.iter().map(score).collect();
    let best =
        (0..layouts.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a)))?;
    let weights: Vec<f64> = scores.iter().map(|s| (s - scores[best]).exp()).collect();
    let total: f64 = weights.iter().sum();
    let azimuths = layouts[best].azimuths.clone();
    let confidence = (0..shapes.len()).map(|k| {
        let same = layouts.iter().zip(&weights).filter(|(l, _)| l.azimuths[k] == azimuths[k]);
        same.map(|(_, weight)| weight).sum::<f64>() / total
    });
    Some(Guess { confidence: confidence.collect(), whole: 1.0 / total, azimuths })
}

/// Which way a view faces by its face and feet, -1 left to 1 right.
pub(crate) fn facing(shape: &Shape) -> f64 {
    ((FACING * shape.head_side + FEET * shape.feet_side) / (FACING + FEET)).clamp(-1.0, 1.0)
}

fn likelihood(shapes: &[Shape], azimuths: &[f64]) -> f64 {
    let angles: Vec<f64> = azimuths.iter().map(|a| a.to_radians()).collect();
    let middles = covariance(&angles, |a, b| {
        FRONT.powi(2) * a.cos() * b.cos() + SIDE.powi(2) * a.sin() * b.sin()
    });
    let widths = covariance(&angles, |a, b| {
        let (a, b) = (2.0 * a, 2.0 * b);
        WIDTH.powi(2)
            + WIDTH_TURN.powi(2) * a.cos() * b.cos()
            + WIDTH_SKEW.powi(2) * a.sin() * b.sin()
    });
    let middle = |k: usize, y: usize| shapes[k].profile.middle(y) - shapes[k].profile.axis();
    let width = |k: usize, y: usize| shapes[k].profile.width(y);
    normal(&middles, MIDDLE_NOISE, shapes.len(), &middle)
        + normal(&widths, WIDTH_NOISE, shapes.len(), &width)
        + faces(shapes, &angles)
        + turns(shapes, azimuths)
}

/// How much what is drawn in views moves with the turn in views near them, less how much against
/// it, weighted and summed over pairs.
///
/// Silhouettes are the same for a subject whose depth is mirrored and that turns the other way;
/// what is drawn inside lies in front and moves with it.
fn turns(shapes: &[Shape], azimuths: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (j, from) in azimuths.iter().enumerate() {
        for (k, to) in azimuths.iter().enumerate().skip(j + 1) {
            let turn_deg = (to - from + 180.0).rem_euclid(360.0) - 180.0;
            if let Some((_, weight)) = FOLLOWED.iter().find(|(most, _)| turn_deg.abs() <= *most) {
                sum += weight * shapes[j].relief.turned(&shapes[k].relief, turn_deg);
            }
        }
    }
    sum
}

fn covariance(angles: &[f64], of: impl Fn(f64, f64) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(angles.len(), angles.len(), |i, j| of(angles[i], angles[j]))
}

/// The log likelihood of rows of values, one a view.
fn normal(
    covariance: &DMatrix<f64>,
    noise: f64,
    views: usize,
    value: &dyn Fn(usize, usize) -> f64,
) -> f64 {
    let noisy = covariance + DMatrix::identity(views, views) * noise * noise;
    // The noise makes it positive definite.
    let Some(factors) = noisy.cholesky() else { return f64::MIN };
    let half_log_det: f64 = factors.l().diagonal().iter().map(|d| d.ln()).sum();
    let rows = (0..PROFILE_ROWS).map(|y| {
        let values = DVector::from_fn(views, |k, _| value(k, y));
        // A few rows with another outline (a cape, a tail) must not decide all.
        (0.5 * values.dot(&factors.solve(&values))).min(6.0 * views as f64)
    });
    let sum: f64 = rows.map(|row| -row - half_log_det).sum();
    sum * ROWS / PROFILE_ROWS as f64
}

/// More detail in the head is a face: fronts have it, and sides where they face.
fn faces(shapes: &[Shape], angles: &[f64]) -> f64 {
    let detail = |shape: &Shape| (shape.head_detail + 0.3 * shape.body_detail + 0.5).ln();
    let mean = shapes.iter().map(detail).sum::<f64>() / shapes.len().max(1) as f64;
    let of = |(shape, angle): (&Shape, &f64)| {
        let face = (detail(shape) - mean).clamp(-0.6, 0.6) / 0.6;
        let side = FACING * shape.head_side + FEET * shape.feet_side;
        FACE * face * angle.cos() - side * angle.sin()
    };
    shapes.iter().zip(angles).map(of).sum()
}
