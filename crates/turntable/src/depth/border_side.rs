//! Whether a line bounds the surface on its left or on its right, told by
//! releasing it: if without the line, the other lines predict its depth on one
//! side and something farther on the other, it belongs to the first side.

use super::blocks::{Blocks, Window};
use super::contours::Contours;
use super::graph::{Owner, PixelGraph};
use super::lines::LineDepths;
use super::owners::is_straight;

const MAX_ROUNDS: usize = 4;
/// Pieces of undecided chains are at most about this long, crossings.
const PIECE_CROSSINGS: usize = 90;
const MAX_PIECES: usize = 4000;

/// A stretch of an undecided chain, tested on its own.
pub(super) struct Piece {
    pub crossings: Vec<u32>,
    straight: bool,
}

fn pieces(contours: &Contours, undecided: Vec<Vec<u32>>) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for inner in undecided {
        let straight = is_straight(contours, &inner);
        let count = ((inner.len() as f64 / PIECE_CROSSINGS as f64).round() as usize).max(1);
        let length = if straight { inner.len() } else { inner.len().div_ceil(count) };
        for part in inner.chunks(length).filter(|part| part.len() >= 4) {
            pieces.push(Piece { crossings: part.to_vec(), straight });
        }
    }
    pieces.truncate(MAX_PIECES);
    pieces
}

/// How much farther than the line the surface beside it is predicted, px.
#[derive(Clone, Copy)]
pub(super) struct Prediction {
    pub left_px: f64,
    pub right_px: f64,
}

impl Prediction {
    /// By how much one side fits the line better than the other.
    fn clarity(&self) -> f64 {
        self.left_px.max(self.right_px) - self.left_px.min(self.right_px).abs()
    }

    /// One side lies well behind the line, the other near it.
    fn is_decisive(&self, straight: bool, unit_px: f64) -> bool {
        let (far, near) = (self.left_px.max(self.right_px), self.left_px.min(self.right_px));
        let tolerance = if straight { 0.08 } else { 0.25 };
        far > 20.0 * unit_px && near > -0.6 * far && near < tolerance * far + 4.0 * unit_px
    }

    fn owner(&self) -> Owner {
        if self.left_px > self.right_px { Owner::Right } else { Owner::Left }
    }
}

/// Decides the owners of `undecided` stretches of chains where their release
/// is clear, the clearest first. Returns the blocks it was decided on.
pub(super) fn release(
    graph: &PixelGraph,
    contours: &Contours,
    lines: &LineDepths,
    unit_px: f64,
    undecided: Vec<Vec<u32>>,
    owners: &mut [Option<Owner>],
) -> Blocks {
    let mut pieces = pieces(contours, undecided);
    let mut known: Vec<Option<Prediction>> = pieces.iter().map(|_| None).collect();
    let mut stale = vec![true; pieces.len()];
    let mut blocks = Blocks::new(graph, contours, lines, &pieces, owners);
    for _ in 0..MAX_ROUNDS {
        for (number, piece) in pieces.iter().enumerate().filter(|(number, _)| stale[*number]) {
            known[number] = blocks.predict(number, piece, contours, lines, graph);
        }
        let decisive = |number: usize| {
            known[number].filter(|found| found.is_decisive(pieces[number].straight, unit_px))
        };
        let clearest =
            (0..pieces.len()).filter_map(decisive).map(|p| p.clarity()).fold(0.0, f64::max);
        let decided: Vec<(usize, Owner)> = (0..pieces.len())
            .filter_map(|number| Some((number, decisive(number)?)))
            .filter(|(_, found)| found.clarity() >= 0.4 * clearest)
            .map(|(number, found)| (number, found.owner()))
            .collect();
        if decided.is_empty() {
            break;
        }
        let windows: Vec<Window> =
            decided.iter().map(|&(number, _)| Window::around(&pieces[number], contours)).collect();
        for &(number, owner) in &decided {
            for &index in &pieces[number].crossings {
                owners[index as usize] = Some(owner);
            }
        }
        let mut keep = vec![true; pieces.len()];
        decided.iter().for_each(|&(number, _)| keep[number] = false);
        let touched = |piece: &Piece| {
            let own = Window::around(piece, contours);
            windows.iter().any(|window| window.overlaps(&own))
        };
        stale = pieces.iter().map(touched).collect();
        retain(&mut stale, &keep);
        retain(&mut known, &keep);
        retain(&mut pieces, &keep);
        blocks = Blocks::new(graph, contours, lines, &pieces, owners);
    }
    blocks
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_decides_only_if_one_side_fits_and_the_other_is_far() {
        let decides = |left_px: f64, right_px: f64, straight| {
            let found = Prediction { left_px, right_px };
            found.is_decisive(straight, 1.0).then(|| found.owner())
        };
        assert_eq!(decides(2.0, 60.0, true), Some(Owner::Left));
        assert_eq!(decides(60.0, 2.0, false), Some(Owner::Right));
        // Near on both sides, far on both sides, and before the line.
        assert_eq!(decides(3.0, 12.0, false), None);
        assert_eq!(decides(50.0, 60.0, false), None);
        assert_eq!(decides(-50.0, 60.0, false), None);
        // A straight line may be the edge of a slanted side: more is asked of it.
        assert_eq!(decides(14.0, 60.0, false), Some(Owner::Left));
        assert_eq!(decides(14.0, 60.0, true), None);
    }
}
