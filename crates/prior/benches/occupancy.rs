//! The networks on five drawings of three balls.
//!
//! `cargo bench -p prior`; times are of this machine: compare runs in turns.

use divan::Bencher;
use prior::{Prior, PriorInput, PriorView};
use progress::Silent;

const SIDE: usize = 384;
/// Centre and radius, px.
const BALLS: [[f64; 4]; 3] =
    [[0.0, 0.0, 120.0, 56.0], [0.0, 16.0, -32.0, 88.0], [104.0, -24.0, 8.0, 36.0]];

fn main() {
    divan::main();
}

/// The mask and the ink of one view.
fn drawing(azimuth_rad: f64) -> [Vec<f32>; 2] {
    let half = SIDE as f64 / 2.0;
    let outside = |index: usize| {
        let (column, row) = ((index % SIDE) as f64 + 0.5, (index / SIDE) as f64 + 0.5);
        let balls = BALLS.iter().map(|[x, y, z, radius]| {
            let across = column - (x * azimuth_rad.cos() + y * azimuth_rad.sin() + half);
            across.hypot(row - (half - z)) - radius
        });
        balls.fold(f64::INFINITY, f64::min)
    };
    let levels = |level: fn(f64) -> f64| {
        (0..SIDE * SIDE).map(|index| level(outside(index)).clamp(0.0, 1.0) as f32).collect()
    };
    [levels(|outside| 0.5 - outside), levels(|outside| 1.5 - outside.abs())]
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn five_views(bencher: Bencher<'_, '_>) {
    let prior = Prior::load().expect("weights");
    let azimuths = [0.0_f64, 45.0, 90.0, 135.0, 180.0].map(f64::to_radians);
    let drawings = azimuths.map(drawing);
    let views = azimuths.iter().zip(&drawings);
    let views: Vec<PriorView<'_>> =
        views.map(|(&azimuth_rad, [mask, ink])| PriorView { azimuth_rad, mask, ink }).collect();
    let half = SIDE as f64 / 2.0;
    let input = PriorInput {
        views,
        size: (SIDE, SIDE),
        axis_px: half,
        origin_row_px: half,
        half_depth_px: None,
    };
    bencher.bench(|| prior.occupancy(&input, &Silent).expect("logits"));
}
