//! Lines along the rows that part a nearer surface from a farther one.
//!
//! Their own crossings give no depth, so nothing in their row tells which of
//! them are steps and which are only creases. The surfaces above and below
//! tell: each is solved from its own lines, and where they do not meet, the
//! line is a step.

use super::blocks::Blocks;
use super::graph::{NONE, PixelGraph};

/// Depths that differ by more are not of one surface, units.
const STEP: f32 = 12.0;

/// The steps of a view, as in [`PixelGraph::steps`].
pub(super) fn steps(graph: &PixelGraph, blocks: &Blocks, unit_px: f64) -> Vec<bool> {
    let depth = blocks.settled();
    let at = |x: usize, y: usize| match graph.node_of[y * graph.width + x] {
        NONE => f32::NAN,
        node => depth[node as usize],
    };
    let mut steps = vec![false; graph.width * graph.height];
    for x in 0..graph.width {
        let mut y = 1;
        while y + 1 < graph.height {
            let inked = |y: usize| graph.horizontal_ink[y * graph.width + x];
            let rows = (y..graph.height - 1).take_while(|&y| inked(y)).count();
            if rows > 0 {
                let jump = at(x, y + rows) - at(x, y - 1);
                if jump.abs() > STEP * unit_px as f32 {
                    // The line is drawn on the nearer surface.
                    let last = if jump > 0.0 { y + rows - 1 } else { y - 1 };
                    steps[last * graph.width + x] = true;
                }
            }
            y += rows + 1;
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::lines::LineDepths;
    use crate::depth::tests::framed;

    /// The steps at column 60 of two boxes, one above the other, whose edges
    /// are at the given depths; the line between them is in rows 30 and 31.
    fn step_rows(upper_px: f64, lower_px: f64) -> Vec<usize> {
        let (contours, graph) = framed(|x, y| [30, 31].contains(&y) && (10..110).contains(&x));
        let mut lines = LineDepths::unknown(contours.crossings.len());
        for (crossing, depth) in contours.crossings.iter().zip(&mut lines.depth_px) {
            *depth = if crossing.y < 30 { upper_px } else { lower_px };
        }
        let owners = vec![None; contours.crossings.len()];
        let blocks = Blocks::new(&graph, &contours, &lines, &[], &owners);
        let steps = steps(&graph, &blocks, 1.0);
        (0..60).filter(|y| steps[y * 120 + 60]).collect()
    }

    #[test]
    fn a_line_goes_with_the_nearer_of_two_surfaces_that_do_not_meet() {
        assert_eq!(step_rows(40.0, 0.0), [29]);
        assert_eq!(step_rows(0.0, 40.0), [31]);
    }

    #[test]
    fn surfaces_that_meet_are_not_parted() {
        assert!(step_rows(5.0, 0.0).is_empty());
    }
}
