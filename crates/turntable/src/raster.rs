//! What stages share that go over drawings pixel by pixel.

/// Drawings of so many rows or fewer have strokes of about 1.5 px.
const REFERENCE_ROWS: f64 = 540.0;

/// How much thicker than in a small drawing strokes, and their noise, are
/// expected in one of `rows` rows; 1 or more.
pub(crate) fn stroke_scale(rows: usize) -> f64 {
    (rows as f64 / REFERENCE_ROWS).max(1.0)
}

/// Spreads distances over rows of `width` pixels: `relax` lowers a row to what
/// the row above, if any, and the pixels to the left allow; it is called from
/// the top, then, all turned about, from the bottom.
///
/// # Source
/// Borgefors 1986, Distance transformations in digital images.
pub(crate) fn two_passes<T>(
    distances: &mut [T],
    width: usize,
    relax: impl Fn(&mut [T], Option<&[T]>),
) {
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

/// Half-open ranges of columns that are not 0, left to right.
pub(crate) fn runs(row: &[u8]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut next = 0;
    std::iter::from_fn(move || {
        let start = next + zeros(&row[next..]);
        if start == row.len() {
            return None;
        }
        let length = row[start..].iter().position(|&level| level == 0);
        next = length.map_or(row.len(), |length| start + length);
        Some((start, next))
    })
}

/// How many zeros a row starts with.
fn zeros(row: &[u8]) -> usize {
    const AT_ONCE: usize = 32;
    let (chunks, _) = row.as_chunks::<AT_ONCE>();
    let skipped = chunks.iter().take_while(|chunk| **chunk == [0; AT_ONCE]).count() * AT_ONCE;
    skipped + row[skipped..].iter().take_while(|&&level| level == 0).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_whatever_their_place() {
        let mut row = [0; 100];
        assert_eq!(runs(&row).count(), 0);
        row[0] = 255;
        row[40..70].fill(255);
        row[97..].fill(1);
        assert_eq!(runs(&row).collect::<Vec<_>>(), [(0, 1), (40, 70), (97, 100)]);
    }
}
