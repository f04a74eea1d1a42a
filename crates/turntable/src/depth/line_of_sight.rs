//! Whether a point that another view drew can be behind a view's surface.

use super::contours::Contours;
use super::graph::{NONE, PixelGraph};

/// Views this close to a view's own direction, or to its side, tell nothing.
const MIN_SINE: f32 = 0.02;
/// How far before the surface a line of sight is surely not behind it, units.
const CLEARLY_BEFORE: f32 = 4.0;
/// Rows around a point's own that must tell the same: where a line along the
/// row ends the surface, the other view may look past it.
const ROWS: [i64; 3] = [0, -3, 3];

/// The lines of sight of other views over a view's pixels.
pub(super) struct Sight<'a> {
    graph: &'a PixelGraph,
    /// Per node: in a stroke, at which the surface may end.
    on_line: Vec<bool>,
    unit_px: f32,
}

impl<'a> Sight<'a> {
    pub(super) fn new(graph: &'a PixelGraph, contours: &Contours, unit_px: f32) -> Self {
        let mut on_line = vec![false; graph.nodes()];
        for crossing in &contours.crossings {
            let row = crossing.y as usize * graph.width;
            for &node in &graph.node_of[row + crossing.start as usize..row + crossing.end as usize]
            {
                if node != NONE {
                    on_line[node as usize] = true;
                }
            }
        }
        Self { graph, on_line, unit_px }
    }

    /// Whether a point that was drawn, hence seen, contradicts a surface
    /// before it: the line of sight to it cuts through the surface, and does
    /// not come past the edge of the silhouette or of a drawn line.
    ///
    /// * `surface_px`: depth per node.
    /// * `drawn_from_rad`: from this view to the one that drew the point.
    pub(super) fn contradicts(
        &self,
        surface_px: &[f32],
        node: usize,
        depth_px: f32,
        drawn_from_rad: f32,
    ) -> bool {
        let (sine, cosine) = drawn_from_rad.sin_cos();
        if cosine < MIN_SINE || sine.abs() < MIN_SINE {
            return false;
        }
        let step = if sine > 0.0 { 1 } else { -1 };
        let nearer_per_column = cosine / sine.abs();
        let (x, y) = self.graph.positions[node];
        let passes_through = |row: u32| {
            let mut along = depth_px;
            for columns in 0.. {
                let beside = self.graph.node_beside(row, x as usize, step * columns);
                let Some(node) = beside.filter(|&node| !self.on_line[node]) else { break };
                if along < surface_px[node] - CLEARLY_BEFORE * self.unit_px {
                    return true;
                }
                along -= nearer_per_column;
            }
            false
        };
        ROWS.iter().all(|rows| {
            let row = u32::try_from(i64::from(y) + rows);
            row.is_ok_and(|row| (row as usize) < self.graph.height && passes_through(row))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::tests::framed;

    /// A frame, with an upright line inside it or none, and the surface in it
    /// at depth 0.
    fn frame(inner: Option<u32>, test: impl Fn(&Sight<'_>, &PixelGraph, &[f32])) {
        let (contours, graph) = framed(|x, y| Some(x) == inner && (10..50).contains(&y));
        let surface = vec![0.0; graph.nodes()];
        test(&Sight::new(&graph, &contours, 1.0), &graph, &surface);
    }

    #[test]
    fn a_point_seen_through_the_surface_contradicts_it() {
        frame(None, |sight, graph, surface| {
            let node = graph.node_beside(30, 60, 0).unwrap();
            let from =
                |degrees: f32, depth| sight.contradicts(surface, node, depth, degrees.to_radians());
            // 20 px behind, seen from 45 degrees: in front after 24 columns of 49.
            assert!(from(45.0, 20.0) && from(-45.0, 20.0));
            // Seen past the frame's edge, from the side and from behind.
            assert!(!from(45.0, 48.0) && !from(80.0, 20.0) && !from(135.0, 20.0));
            // At the frame's upper end another view may see over it.
            let node = graph.node_beside(12, 60, 0).unwrap();
            assert!(!sight.contradicts(surface, node, 20.0, 0.8));
        });
    }

    #[test]
    fn a_surface_may_end_at_a_drawn_line() {
        frame(Some(70), |sight, graph, surface| {
            let node = graph.node_beside(30, 60, 0).unwrap();
            let from = |degrees: f32| sight.contradicts(surface, node, 20.0, degrees.to_radians());
            assert!(!from(45.0) && from(-45.0));
        });
    }
}
