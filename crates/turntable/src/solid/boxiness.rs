//! Whether the outlines are those of something made of flat walls.

use image::GrayImage;

/// Straight means at least so long, share of the figure's longer side; a circle
/// has a few such stretches, where it touches its bounds.
const STRAIGHT: f64 = 0.05;

/// The share of the outlines' length in all `masks` that runs straight up or
/// across: 1 for a box, .1 for a ball.
pub(super) fn straight_share(masks: &[&GrayImage]) -> f64 {
    let (mut straight, mut all) = (0_usize, 0_usize);
    for mask in masks {
        let (w, h) = (mask.width() as usize, mask.height() as usize);
        let data = mask.as_raw();
        let inside = |x: usize, y: usize| data[y * w + x] >= 128;
        let rows = (0..h).filter(|&y| (0..w).any(|x| inside(x, y)));
        let columns = (0..w).filter(|&x| (0..h).any(|y| inside(x, y)));
        let longer = rows.count().max(columns.count());
        let least = ((STRAIGHT * longer as f64).ceil() as usize).max(2);
        // Sides of pixels that part the figure from paper, and which side is in.
        let mut count = |sides: &mut dyn Iterator<Item = Option<bool>>| {
            let mut run = (None, 0);
            for side in sides.chain([None]) {
                if side == run.0 {
                    run.1 += 1;
                    continue;
                }
                if run.0.is_some() {
                    all += run.1;
                    straight += if run.1 >= least { run.1 } else { 0 };
                }
                run = (side, 1);
            }
        };
        let parted = |a: bool, b: bool| (a != b).then_some(a);
        for y in 1..h {
            count(&mut (0..w).map(|x| parted(inside(x, y - 1), inside(x, y))));
        }
        for x in 1..w {
            count(&mut (0..h).map(|y| parted(inside(x - 1, y), inside(x, y))));
        }
    }
    straight as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    #[test]
    fn a_box_is_straight_a_ball_and_a_slope_are_not() {
        let of = |is: &dyn Fn(f64, f64) -> bool| {
            let mask = GrayImage::from_fn(200, 160, |x, y| {
                Luma([if is(f64::from(x) - 100.0, f64::from(y) - 80.0) { 255 } else { 0 }])
            });
            straight_share(&[&mask])
        };
        assert_eq!(of(&|x, y| x.abs() < 40.0 && y.abs() < 60.0), 1.0);
        assert!(of(&|x, y| x.hypot(y) < 60.0) < 0.2);
        assert!(of(&|x, y| (x + 0.4 * y).abs() < 30.0 && (y - 0.4 * x).abs() < 50.0) < 0.1);
    }
}
