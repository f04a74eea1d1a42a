//! One map of a view from the maps of its two pairs.

use picture::FloatImage;

/// The mean of two maps of one view; where one has nothing, the other.
///
/// Both must be of one size; beyond the smaller the first is kept.
///
/// # Source
/// Arys 2020, §3.6.
pub fn mean_map(mut first: FloatImage, second: &FloatImage) -> FloatImage {
    for (mine, &other) in first.iter_mut().zip(second.iter()) {
        *mine = match (mine.is_nan(), other.is_nan()) {
            (_, true) => *mine,
            (true, false) => other,
            (false, false) => (*mine + other) / 2.0,
        };
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_what_there_is() {
        let map = |values: [f32; 4]| FloatImage::from_raw(2, 2, values.to_vec()).unwrap();
        let first = map([1.0, f32::NAN, 5.0, f32::NAN]);
        let second = map([3.0, 4.0, f32::NAN, f32::NAN]);
        let mean = mean_map(first, &second);
        assert_eq!(mean.as_raw()[..3], [2.0, 4.0, 5.0]);
        assert!(mean.as_raw()[3].is_nan());
    }
}
