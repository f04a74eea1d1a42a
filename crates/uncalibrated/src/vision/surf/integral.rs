//! Sums of grey over boxes by an integral image.

use image::GrayImage;

/// Sums of grey levels above and left of every pixel corner.
///
/// Sums wrap at 32 bits; a box's sum is right as long as it fits itself.
pub(super) struct IntegralImage {
    width: i64,
    height: i64,
    /// `(height + 1) × (width + 1)` values, row by row.
    sums: Vec<u32>,
}

impl IntegralImage {
    pub(super) fn new(image: &GrayImage) -> Self {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let stride = width + 1;
        let mut sums = vec![0_u32; stride * (height + 1)];
        for y in 0..height {
            let mut row_sum = 0_u32;
            for x in 0..width {
                row_sum += u32::from(image.as_raw()[y * width + x]);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1].wrapping_add(row_sum);
            }
        }
        Self { width: width as i64, height: height as i64, sums }
    }

    pub(super) fn width(&self) -> i64 {
        self.width
    }

    pub(super) fn height(&self) -> i64 {
        self.height
    }

    /// The mean grey of pixels `left..right` × `top..bottom`, which must lie
    /// within the picture and not be empty.
    pub(super) fn mean(&self, left: i64, top: i64, right: i64, bottom: i64) -> f32 {
        let at = |x: i64, y: i64| self.sums[(y * (self.width + 1) + x) as usize];
        let sum = at(right, bottom)
            .wrapping_sub(at(left, bottom))
            .wrapping_sub(at(right, top))
            .wrapping_add(at(left, top));
        sum as f32 / ((right - left) * (bottom - top)) as f32
    }

    /// The mean over the part of the box that lies within the picture.
    pub(super) fn mean_within(&self, left: i64, top: i64, right: i64, bottom: i64) -> Option<f32> {
        let (left, right) = (left.clamp(0, self.width), right.clamp(0, self.width));
        let (top, bottom) = (top.clamp(0, self.height), bottom.clamp(0, self.height));
        (left < right && top < bottom).then(|| self.mean(left, top, right, bottom))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_boxes() {
        let image = GrayImage::from_raw(3, 2, vec![1, 2, 3, 4, 5, 6]).unwrap();
        let integral = IntegralImage::new(&image);
        assert_eq!(integral.mean(0, 0, 3, 2), 3.5);
        assert_eq!(integral.mean(1, 1, 3, 2), 5.5);
        assert_eq!(integral.mean_within(-5, -5, 1, 1), Some(1.0));
        assert_eq!(integral.mean_within(3, 0, 9, 9), None);
    }
}
