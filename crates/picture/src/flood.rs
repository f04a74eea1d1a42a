//! Flood fill of pixels that are open.

/// The `open` pixels connected (by sides) to `pending`, run by run.
///
/// * `width`: pixels a row; `open` has whole rows.
/// * `pending`: indices to begin at; those that are not open begin nothing.
///
/// ```
/// // A wall in the second column keeps the flood in the first.
/// let open = [true, false, true, true, false, true].to_vec();
/// assert_eq!(picture::flooded(3, open, vec![0]), [true, false, false, true, false, false]);
/// ```
pub fn flooded(width: usize, mut open: Vec<bool>, mut pending: Vec<usize>) -> Vec<bool> {
    let mut reached = vec![false; open.len()];
    while let Some(index) = pending.pop() {
        if !open[index] {
            continue;
        }
        let row = index - index % width;
        let before = open[row..index].iter().rev().take_while(|open| **open).count();
        let after = open[index..row + width].iter().take_while(|open| **open).count();
        let (from, to) = (index - before, index + after);
        // What is reached need not be gone to again.
        open[from..to].fill(false);
        reached[from..to].fill(true);
        let above = row.checked_sub(width).map(|_| from - width..to - width);
        let below = (to + width <= reached.len()).then_some(from + width..to + width);
        for beside in above.into_iter().chain(below) {
            let mut in_run = false;
            for (next, &starts) in beside.clone().zip(&open[beside]) {
                if starts && !in_run {
                    pending.push(next);
                }
                in_run = starts;
            }
        }
    }
    reached
}

/// The indices of a picture's border pixels; none if it has no pixels.
pub fn border(width: usize, height: usize) -> Vec<usize> {
    if width == 0 || height == 0 {
        return Vec::new();
    }
    let ends = (0..height).flat_map(|y| [y * width, y * width + width - 1]);
    (0..width).chain((height - 1) * width..height * width).chain(ends).collect()
}
