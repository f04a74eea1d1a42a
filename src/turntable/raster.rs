//! What stages share that go over drawings pixel by pixel.

/// Drawings of so many rows or fewer have strokes of about 1.5 px.
const REFERENCE_ROWS: f64 = 540.0;

/// How much thicker than in a small drawing strokes, and their noise, are
/// expected in one of `rows` rows; 1 or more.
pub fn stroke_scale(rows: usize) -> f64 {
    (rows as f64 / REFERENCE_ROWS).max(1.0)
}

/// Spreads distances over rows of `width` pixels: `relax` lowers a row to what
/// the row above, if any, and the pixels to the left allow; it is called from
/// the top, then, all turned about, from the bottom.
///
/// # Source
/// Borgefors 1986, Distance transformations in digital images.
pub fn two_passes<T>(distances: &mut [T], width: usize, relax: impl Fn(&mut [T], Option<&[T]>)) {
    for _ in 0..2 {
        for start in (0..distances.len()).step_by(width.max(1)) {
            let (above, from_here) = distances.split_at_mut(start);
            let above = above.len().checked_sub(width).map(|start| &above[start..]);
            relax(&mut from_here[..width], above);
        }
        // The second pass is the first upside down and right to left.
        distances.reverse();
    }
}
