//! Disparity maps of several block sizes, fused by local evidence.
//!
//! Large blocks carry disparity into empty regions and round off detail; small
//! ones do the reverse. Per pixel, each map speaks with the weight of what its
//! block could see there.

use image::{GrayImage, Luma};

use super::disparity::{DisparityError, left_disparity, right_disparity};
use crate::options::DisparityOptions;
use picture::FloatImage;

/// What a block without any line in it counts, beside one full of lines.
const EMPTY_WEIGHT: f64 = 0.02;
/// Gradient, grey levels a pixel, at which a pixel counts as all line.
const FULL_GRADIENT: f64 = 64.0;
/// Mean difference of matched blocks, grey levels, that costs a factor of e.
const MISMATCH_SCALE: f64 = 12.0;
/// Maps that differ by no more agree in both directions, px.
const CONSISTENT_PX: f32 = 1.0;
/// What a value counts that the other direction denies, or knows nothing of.
const DENIED_WEIGHT: f64 = 0.25;
const UNKNOWN_WEIGHT: f64 = 0.5;

/// Disparity at the pixels of the left and of the right rectified view, px
/// (`x_left - x_right`); NaN where nothing matched. Of `options.block_sizes`
/// fused, or of `options.block_size` alone if there are none.
///
/// The fused value of a pixel is the weighted median of the maps' values. A
/// value's weight is what there is to see in its block (mean gradient), how well
/// the block agrees with its match (mean grey difference), and whether the map
/// of the other direction confirms it.
///
/// # Errors
/// [`DisparityError`], see [`left_disparity`].
///
/// # Source
/// Arys 2020, ch. 6 (fusion of block sizes); the weights are our own.
pub fn disparity_maps(
    left: &GrayImage,
    right: &GrayImage,
    options: &DisparityOptions,
) -> Result<[FloatImage; 2], DisparityError> {
    let single = |block_size| {
        let options = DisparityOptions { block_size, ..options.clone() };
        Ok([left_disparity(left, right, &options)?, right_disparity(left, right, &options)?])
    };
    if options.block_sizes.is_empty() {
        return single(options.block_size);
    }
    let mut fusion = [Fusion::new(left), Fusion::new(right)];
    for &block_size in &options.block_sizes {
        let [left_map, right_map] = single(block_size)?;
        let from_left = Side { drawing: left, partner: right, towards_partner: -1.0 };
        let from_right = Side { drawing: right, partner: left, towards_partner: 1.0 };
        fusion[0].add(&from_left, &left_map, &right_map, block_size);
        fusion[1].add(&from_right, &right_map, &left_map, block_size);
    }
    Ok(fusion.map(Fusion::medians))
}

/// A view and its partner; a disparity d at x is at `x + towards_partner · d`
/// there.
struct Side<'a> {
    drawing: &'a GrayImage,
    partner: &'a GrayImage,
    towards_partner: f32,
}

impl Side<'_> {
    /// The column of the partner that a value points to.
    fn column(&self, x: u32, disparity: f32) -> Option<u32> {
        let column = (x as f32 + self.towards_partner * disparity).round();
        let inside = column >= 0.0 && column < self.partner.width() as f32;
        inside.then_some(column as u32)
    }

    /// Difference of each pixel from what its disparity says it is in the
    /// partner; paper where that lies outside.
    fn mismatch(&self, map: &FloatImage) -> Vec<f64> {
        let differing = |(x, y, value): (u32, u32, &Luma<f32>)| {
            let mine = f64::from(self.drawing.get_pixel(x, y).0[0]);
            let column = self.column(x, value.0[0]);
            let theirs = column.map_or(255.0, |c| f64::from(self.partner.get_pixel(c, y).0[0]));
            (mine - theirs).abs()
        };
        map.enumerate_pixels().map(differing).collect()
    }

    fn confirmed(&self, x: u32, y: u32, disparity: f32, partner_map: &FloatImage) -> f64 {
        let answer = self.column(x, disparity).map(|column| partner_map.get_pixel(column, y).0[0]);
        match answer {
            Some(answer) if (answer - disparity).abs() <= CONSISTENT_PX => 1.0,
            Some(answer) if !answer.is_nan() => DENIED_WEIGHT,
            _ => UNKNOWN_WEIGHT,
        }
    }
}

/// Values and weights of one view's pixels, as maps come in.
struct Fusion {
    width: u32,
    height: u32,
    /// How much line each pixel is, 0 to 1.
    line: BoxMeans,
    /// Per map: value and weight of each pixel.
    layers: Vec<Vec<(f32, f32)>>,
}

impl Fusion {
    fn new(drawing: &GrayImage) -> Self {
        let (width, height) = drawing.dimensions();
        let grey = |x: u32, y: u32| f64::from(drawing.get_pixel(x, y).0[0]);
        let line = drawing.enumerate_pixels().map(|(x, y, _)| {
            let (before, after) = (x.saturating_sub(1), (x + 1).min(width - 1));
            ((grey(after, y) - grey(before, y)).abs() / (2.0 * FULL_GRADIENT)).min(1.0)
        });
        let line = BoxMeans::new(line, width, height);
        Self { width, height, line, layers: Vec::new() }
    }

    fn add(&mut self, side: &Side<'_>, map: &FloatImage, partner_map: &FloatImage, block: i32) {
        let reach = (block.max(1) as u32 - 1) / 2;
        let mismatch = BoxMeans::new(side.mismatch(map).into_iter(), self.width, self.height);
        let layer = map.enumerate_pixels().map(|(x, y, value)| {
            let disparity = value.0[0];
            if disparity.is_nan() {
                return (disparity, 0.0);
            }
            let seen = EMPTY_WEIGHT + self.line.mean(x, y, reach);
            let agreeing = (-mismatch.mean(x, y, reach) / MISMATCH_SCALE).exp();
            let weight = seen * agreeing * side.confirmed(x, y, disparity, partner_map);
            (disparity, weight as f32)
        });
        self.layers.push(layer.collect());
    }

    fn medians(self) -> FloatImage {
        let width = self.width as usize;
        let mut candidates = Vec::with_capacity(self.layers.len());
        FloatImage::from_fn(self.width, self.height, |x, y| {
            let at = y as usize * width + x as usize;
            candidates.clear();
            candidates.extend(self.layers.iter().map(|layer| layer[at]).filter(|c| !c.0.is_nan()));
            Luma([weighted_median(&mut candidates)])
        })
    }
}

/// The value at which half of all weight is reached; NaN of nothing.
fn weighted_median(candidates: &mut [(f32, f32)]) -> f32 {
    candidates.sort_by(|one, other| one.0.total_cmp(&other.0));
    let half = candidates.iter().map(|(_, weight)| weight).sum::<f32>() / 2.0;
    let mut sum = 0.0;
    for (value, weight) in candidates.iter() {
        sum += weight;
        if sum >= half {
            return *value;
        }
    }
    candidates.last().map_or(f32::NAN, |(value, _)| *value)
}

/// Means over square windows, by a table of sums.
struct BoxMeans {
    width: usize,
    height: usize,
    sums: Vec<f64>,
}

impl BoxMeans {
    fn new(values: impl Iterator<Item = f64>, width: u32, height: u32) -> Self {
        let (width, height) = (width as usize, height as usize);
        let stride = width + 1;
        let mut sums = vec![0.0; stride * (height + 1)];
        let mut row_sum = 0.0;
        for (index, value) in values.take(width * height).enumerate() {
            let (x, y) = (index % width, index / width);
            row_sum = if x == 0 { value } else { row_sum + value };
            sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row_sum;
        }
        Self { width, height, sums }
    }

    /// Over the part of the window of `2 · reach + 1` px about a pixel that lies
    /// within the picture.
    fn mean(&self, x: u32, y: u32, reach: u32) -> f64 {
        let (x, y, reach) = (x as usize, y as usize, reach as usize);
        let (left, right) = (x.saturating_sub(reach), (x + reach + 1).min(self.width));
        let (top, bottom) = (y.saturating_sub(reach), (y + reach + 1).min(self.height));
        let at = |x: usize, y: usize| self.sums[y * (self.width + 1) + x];
        let sum = at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top);
        sum / ((right - left) * (bottom - top)) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Repeatable texture without structure.
    fn texture(x: i64, y: i64) -> u8 {
        let mut hash = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64) << 32;
        hash = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (hash >> 40) as u8
    }

    /// A plane at 6 px with a narrow bar at 14 px before it.
    fn bar() -> [GrayImage; 2] {
        let near = |x: i64| (90..98).contains(&x);
        let grey = |x: i64, y: i64| texture(if near(x) { x + 5000 } else { x }, y);
        let left = GrayImage::from_fn(200, 80, |x, y| Luma([grey(i64::from(x), i64::from(y))]));
        let right = GrayImage::from_fn(200, 80, |x, y| {
            let (x, y) = (i64::from(x), i64::from(y));
            Luma([if near(x + 14) { grey(x + 14, y) } else { texture(x + 6, y) }])
        });
        [left, right]
    }

    fn options(block_sizes: &[i32]) -> DisparityOptions {
        DisparityOptions {
            block_sizes: block_sizes.to_vec(),
            block_size: 5,
            p1: 100,
            p2: 400,
            speckle_window_px: 0,
            max_left_right_difference_px: -1,
            ..DisparityOptions::default()
        }
    }

    fn share(map: &FloatImage, columns: std::ops::Range<u32>, expected: f32) -> f64 {
        let inside = |x: u32, y: u32| columns.contains(&x) && (20..60).contains(&y);
        let all: Vec<_> = map.enumerate_pixels().filter(|(x, y, _)| inside(*x, *y)).collect();
        let good = all.iter().filter(|(.., v)| (v.0[0] - expected).abs() <= 0.5).count();
        good as f64 / all.len() as f64
    }

    #[test]
    fn no_list_is_the_single_block() {
        let [left, right] = bar();
        let [map, other] = disparity_maps(&left, &right, &options(&[])).unwrap();
        let bits = |map: &FloatImage| map.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let alone = left_disparity(&left, &right, &options(&[])).unwrap();
        assert!(bits(&map) == bits(&alone));
        let [fused, fused_other] = disparity_maps(&left, &right, &options(&[5])).unwrap();
        assert!(bits(&fused) == bits(&map) && bits(&fused_other) == bits(&other));
    }

    #[test]
    fn detail_of_small_blocks_survives_large_ones() {
        let [left, right] = bar();
        let [large, _] = disparity_maps(&left, &right, &options(&[41])).unwrap();
        let [fused, fused_right] = disparity_maps(&left, &right, &options(&[5, 41])).unwrap();
        let (alone, together) = (share(&large, 91..97, 14.0), share(&fused, 91..97, 14.0));
        assert!(alone < 0.5 && together > 0.9, "{alone} alone, {together} fused");
        assert!(share(&fused, 120..170, 6.0) > 0.95);
        assert!(share(&fused_right, 77..83, 14.0) > 0.9);
    }

    #[test]
    fn medians_by_hand() {
        assert_eq!(weighted_median(&mut [(5.0, 1.0), (1.0, 1.0), (9.0, 1.0)]), 5.0);
        assert_eq!(weighted_median(&mut [(5.0, 1.0), (1.0, 5.0), (9.0, 1.0)]), 1.0);
        assert_eq!(weighted_median(&mut [(7.0, 0.0)]), 7.0);
        assert!(weighted_median(&mut []).is_nan());
    }

    #[test]
    fn windows_are_cut_at_the_border() {
        let means = BoxMeans::new([1.0, 2.0, 3.0, 4.0, 5.0, 6.0].into_iter(), 3, 2);
        assert_eq!(means.mean(0, 0, 0), 1.0);
        assert_eq!(means.mean(0, 0, 1), 3.0);
        assert_eq!(means.mean(2, 1, 9), 3.5);
    }
}
