//! A silhouette against the true one: overlap, boundary distance, holes.

use image::GrayImage;
use imageproc::distance_transform::euclidean_squared_distance_transform;
use serde::Serialize;

use super::statistics::share;

/// A silhouette against the true or given one: a consistency check of a
/// reconstruction with its drawings, never its quality.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SilhouetteReport {
    /// Intersection over union, holes filled in both.
    pub iou: f64,
    /// Mean distance between the outer boundaries, there and back, px. Absent
    /// when either silhouette is empty.
    pub mean_boundary_distance_px: Option<f64>,
    /// How the holes through the subject agree.
    pub holes: HoleReport,
}

/// The holes through both silhouettes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoleReport {
    /// Intersection over union; absent when neither has holes.
    pub iou: Option<f64>,
    /// Area of our holes, px.
    pub found_px: usize,
    /// Area of the truth's holes, px.
    pub true_px: usize,
}

/// Why silhouettes cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SilhouetteError {
    /// The two masks are not of one size.
    #[error("the true silhouette is {truth_width}x{truth_height}, ours {width}x{height}")]
    SizeMismatch {
        /// Of ours, px.
        width: u32,
        /// Of ours, px.
        height: u32,
        /// Of the true one, px.
        truth_width: u32,
        /// Of the true one, px.
        truth_height: u32,
    },
}

/// Compares silhouettes, inside above 127.
///
/// A hole is background that does not reach the picture's border over edges of
/// pixels. The outer boundary is made of the pixels of the filled silhouette
/// with background, or the picture's end, across an edge.
///
/// # Errors
/// [`SilhouetteError`] if the sizes differ.
pub fn compare_silhouettes(
    ours: &GrayImage,
    truth: &GrayImage,
) -> Result<SilhouetteReport, SilhouetteError> {
    let ((width, height), (truth_width, truth_height)) = (ours.dimensions(), truth.dimensions());
    if (width, height) != (truth_width, truth_height) {
        return Err(SilhouetteError::SizeMismatch { width, height, truth_width, truth_height });
    }
    let (ours, truth) = (Silhouette::new(ours), Silhouette::new(truth));
    let holes = overlap(&ours.holes, &truth.holes);
    let filled = overlap(&ours.filled, &truth.filled);
    Ok(SilhouetteReport {
        iou: share(filled.both, filled.either),
        mean_boundary_distance_px: ours.mean_boundary_distance_px(&truth),
        holes: HoleReport {
            iou: (holes.either > 0).then(|| share(holes.both, holes.either)),
            found_px: ours.holes.iter().filter(|&&hole| hole).count(),
            true_px: truth.holes.iter().filter(|&&hole| hole).count(),
        },
    })
}

struct Overlap {
    both: usize,
    either: usize,
}

fn overlap(one: &[bool], other: &[bool]) -> Overlap {
    let pairs = || one.iter().zip(other);
    Overlap {
        both: pairs().filter(|&(one, other)| *one && *other).count(),
        either: pairs().filter(|&(one, other)| *one || *other).count(),
    }
}

/// Row by row, as in the picture.
struct Silhouette {
    width: usize,
    height: usize,
    filled: Vec<bool>,
    holes: Vec<bool>,
}

impl Silhouette {
    fn new(mask: &GrayImage) -> Self {
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let inside: Vec<bool> = mask.as_raw().iter().map(|&value| value > 127).collect();
        // Background connected with the picture's border over edges of pixels.
        let background = inside.iter().map(|inside| !inside).collect();
        let outside = picture::flooded(width, background, picture::border(width, height));
        let filled = outside.iter().map(|outside| !outside).collect();
        let holes = outside.iter().zip(&inside).map(|(outside, inside)| !outside && !inside);
        Self { width, height, holes: holes.collect(), filled }
    }

    fn boundary(&self) -> Vec<(usize, usize)> {
        let at = |x: usize, y: usize| self.filled[y * self.width + x];
        let all = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        all.filter(|&(x, y)| at(x, y))
            .filter(|&(x, y)| {
                let ends = x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height;
                ends || !(at(x - 1, y) && at(x + 1, y) && at(x, y - 1) && at(x, y + 1))
            })
            .collect()
    }

    fn mean_boundary_distance_px(&self, other: &Self) -> Option<f64> {
        let (ours, theirs) = (self.boundary(), other.boundary());
        let there = mean_distance_px(&ours, &theirs)?;
        let back = mean_distance_px(&theirs, &ours)?;
        Some((there + back) / 2.0)
    }
}

/// The mean distance of `from` to the nearest of `to`, in the box of both.
fn mean_distance_px(from: &[(usize, usize)], to: &[(usize, usize)]) -> Option<f64> {
    if from.is_empty() || to.is_empty() {
        return None;
    }
    let all = || from.iter().chain(to);
    let (left, right) = (all().map(|p| p.0).min()?, all().map(|p| p.0).max()?);
    let (top, bottom) = (all().map(|p| p.1).min()?, all().map(|p| p.1).max()?);
    let local = |&(x, y): &(usize, usize)| ((x - left) as u32, (y - top) as u32);
    let mut seeds = GrayImage::new((right - left + 1) as u32, (bottom - top + 1) as u32);
    for (x, y) in to.iter().map(local) {
        seeds.put_pixel(x, y, image::Luma([255]));
    }
    let squares = euclidean_squared_distance_transform(&seeds);
    let sum: f64 = from.iter().map(local).map(|(x, y)| squares.get_pixel(x, y).0[0].sqrt()).sum();
    Some(sum / from.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> GrayImage {
        let pixel = |x: u32, y: u32| rows[y as usize].as_bytes()[x as usize] == b'#';
        GrayImage::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| {
            image::Luma([if pixel(x, y) { 255 } else { 0 }])
        })
    }

    fn square(left: u32, top: u32, side: u32) -> GrayImage {
        GrayImage::from_fn(40, 40, |x, y| {
            let within = |v: u32, low: u32| v >= low && v < low + side;
            image::Luma([if within(x, left) && within(y, top) { 255 } else { 0 }])
        })
    }

    #[test]
    fn equal_silhouettes_agree() {
        let found = compare_silhouettes(&square(5, 5, 20), &square(5, 5, 20)).unwrap();
        assert_eq!((found.iou, found.mean_boundary_distance_px), (1.0, Some(0.0)));
        assert_eq!(found.holes, HoleReport { iou: None, found_px: 0, true_px: 0 });
    }

    /// Squares of 3 and 5 about one middle: each pixel of the inner rim (8) is
    /// 1 from the outer one (16), whose corners (4) are √2 away.
    #[test]
    fn concentric_squares_by_hand() {
        let found = compare_silhouettes(&square(11, 11, 3), &square(10, 10, 5)).unwrap();
        assert!((found.iou - 9.0 / 25.0).abs() < 1e-12);
        let back = (12.0 + 4.0 * 2.0_f64.sqrt()) / 16.0;
        let distance = found.mean_boundary_distance_px.unwrap();
        assert!((distance - (1.0 + back) / 2.0).abs() < 1e-12, "{distance}");
    }

    #[test]
    fn holes_are_counted_apart() {
        let ring = mask(&[".......", ".#####.", ".#..##.", ".#####.", "......."]);
        let disc = mask(&[".......", ".#####.", ".#####.", ".#####.", "......."]);
        let other = mask(&[".......", ".#####.", ".##..#.", ".#####.", "......."]);
        let found = compare_silhouettes(&ring, &disc).unwrap();
        assert_eq!((found.iou, found.mean_boundary_distance_px), (1.0, Some(0.0)));
        assert_eq!(found.holes, HoleReport { iou: Some(0.0), found_px: 2, true_px: 0 });
        let found = compare_silhouettes(&ring, &other).unwrap();
        assert!((found.holes.iou.unwrap() - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_gap_over_a_corner_only_is_no_way_out() {
        let diagonal = mask(&["##.", "#.#", "###"]);
        let full = mask(&["##.", "###", "###"]);
        let found = compare_silhouettes(&diagonal, &full).unwrap();
        assert_eq!((found.iou, found.holes.found_px), (1.0, 1));
    }

    #[test]
    fn empty_and_unequal_pictures() {
        let found = compare_silhouettes(&GrayImage::new(40, 40), &square(1, 1, 2)).unwrap();
        assert_eq!((found.iou, found.mean_boundary_distance_px), (0.0, None));
        let found = compare_silhouettes(&GrayImage::new(0, 0), &GrayImage::new(0, 0)).unwrap();
        assert_eq!(found.mean_boundary_distance_px, None);
        let error = compare_silhouettes(&GrayImage::new(3, 4), &square(1, 1, 2)).unwrap_err();
        assert!(matches!(error, SilhouetteError::SizeMismatch { width: 3, .. }));
    }
}
