use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use progress::{Progress, Silent};

const SIDE: usize = 96;
/// Three balls: centre and radius, px.
const BALLS: [[f64; 4]; 3] =
    [[0.0, 0.0, 30.0, 14.0], [0.0, 4.0, -8.0, 22.0], [26.0, -6.0, 2.0, 9.0]];
/// Few voxels, for tests are built without optimisation.
const FEW_VOXELS: f64 = 24.0 * 24.0 * 24.0;

struct Drawing {
    azimuth_rad: f64,
    mask: Vec<f32>,
    ink: Vec<f32>,
}

fn drawing(degrees: f64) -> Drawing {
    let azimuth_rad = degrees.to_radians();
    let (mut mask, mut ink) = (vec![0.0_f32; SIDE * SIDE], vec![0.0_f32; SIDE * SIDE]);
    let half = SIDE as f64 / 2.0;
    for index in 0..SIDE * SIDE {
        let (column, row) = ((index % SIDE) as f64 + 0.5, (index / SIDE) as f64 + 0.5);
        for [x, y, z, radius] in BALLS {
            let across = column - (x * azimuth_rad.cos() + y * azimuth_rad.sin() + half);
            let outside = across.hypot(row - (half - z)) - radius;
            mask[index] = mask[index].max((0.5 - outside).clamp(0.0, 1.0) as f32);
            ink[index] = ink[index].max((1.5 - outside.abs()).clamp(0.0, 1.0) as f32);
        }
    }
    Drawing { azimuth_rad, mask, ink }
}

fn input<'a>(drawings: &'a [Drawing]) -> PriorInput<'a> {
    let view = |drawing: &'a Drawing| PriorView {
        azimuth_rad: drawing.azimuth_rad,
        mask: &drawing.mask,
        ink: &drawing.ink,
    };
    let half = SIDE as f64 / 2.0;
    PriorInput {
        views: drawings.iter().map(view).collect(),
        size: (SIDE, SIDE),
        axis_px: half,
        origin_row_px: half,
        half_depth_px: None,
    }
}

fn small(drawings: &[Drawing]) -> LogitField {
    Prior::load().unwrap().within(&input(drawings), FEW_VOXELS, &Silent).unwrap()
}

#[test]
fn agrees_with_the_network_it_was_exported_from() {
    let field = small(&[0.0, 45.0, 90.0].map(drawing));
    // From PyTorch with f32 arithmetic on the same drawings and grid: training/reference.py.
    let expected = [
        ([0.0, 0.0, 30.0], 10.215816),
        ([0.0, 0.0, 0.0], 10.287264),
        ([26.0, -6.0, 2.0], 4.191635),
        ([20.0, 20.0, 0.0], -6.329867),
        ([0.0, 4.0, -30.0], 0.341035),
        ([-15.0, -15.0, -8.0], -5.424821),
        ([10.0, -14.0, 2.5], -1.426635),
        ([18.0, -6.0, 2.0], 0.666803),
    ];
    for (point, logit) in expected {
        let found = field.sample(point);
        assert!(
            (found - logit).abs() < 0.005,
            "{point:?}: {found} for {logit} on {:?}",
            field.grid()
        );
    }
}

#[test]
fn balls_are_inside_and_corners_of_the_hull_are_not() {
    let field = small(&[0.0, 90.0].map(drawing));
    assert!(field.sample([0.0, 0.0, 0.0]) > 0.0);
    assert!(field.sample([-19.0, 22.0, -8.0]) < 0.0);
    assert_eq!(field.sample([500.0, 0.0, 0.0]), field::OUTSIDE);
}

#[test]
fn threads_do_not_change_a_bit() {
    let drawings = [0.0, 60.0, 130.0].map(drawing);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| small(&drawings))
    };
    let (one, four) = (with(1), with(4));
    assert_eq!(one.values(), four.values());
}

#[test]
fn more_views_than_it_takes_are_thinned() {
    let many: Vec<Drawing> = (0..10).map(|i| drawing(f64::from(i) * 10.0)).collect();
    let chosen: Vec<f64> = many.iter().map(|drawing| drawing.azimuth_rad).collect();
    assert_eq!(choice::best_spread(&chosen, MAX_VIEWS).len(), MAX_VIEWS);
}

#[test]
fn what_bounds_nothing_is_refused() {
    let prior = Prior::load().unwrap();
    let one = [drawing(0.0)];
    let found = prior.occupancy(&input(&one), &Silent);
    assert!(matches!(found, Err(PriorError::TooFewViews { found: 1 })));
    let mut two = [0.0, 90.0].map(drawing);
    two[1].mask.fill(0.0);
    let found = prior.occupancy(&input(&two), &Silent);
    assert!(matches!(found, Err(PriorError::EmptyHull)));
    two[1].mask.pop();
    let found = prior.occupancy(&input(&two), &Silent);
    assert!(matches!(found, Err(PriorError::SizeDiffers { .. })));
}

#[test]
fn stops_when_asked_to() {
    /// Wants to stop after some questions.
    struct Impatient(AtomicUsize);
    impl Observer for Impatient {
        fn progress(&self, _: Progress) {}

        fn is_cancelled(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed) > 0
        }
    }
    let drawings = [0.0, 90.0].map(drawing);
    let observer = Impatient(AtomicUsize::new(0));
    let found = Prior::load().unwrap().within(&input(&drawings), FEW_VOXELS, &observer);
    assert!(matches!(found, Err(PriorError::Cancelled(_))));
}
