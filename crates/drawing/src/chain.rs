//! Visible pieces of lines joined to strokes.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};

use super::features::{LineKind, Node};

/// A line of the drawing: a polyline in pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// Which feature of the model the line draws.
    pub kind: LineKind,
    /// The polyline's corners in order, px, in the drawing's frame: x right, y down.
    pub points: Vec<Point2<f64>>,
    /// Width at each point in pixels; empty for the drawing's line width.
    pub widths_px: Vec<f64>,
}

impl Stroke {
    /// Length along the polyline, px.
    pub fn length_px(&self) -> f64 {
        self.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }
}

/// A visible piece of a segment.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub kind: LineKind,
    pub ends: [(Node, Point2<f64>); 2],
}

/// Joins pieces of the same kind into strokes where they meet; where more than two meet, the
/// straightest continuations.
pub(super) fn chain(pieces: &[Piece]) -> Vec<Stroke> {
    let partners = partners(pieces);
    let mut used = vec![false; pieces.len()];
    let mut strokes = Vec::new();
    let is_start = |piece: usize| (0..2).find(|&end| partners[piece][end].is_none());
    // Open chains first, from their ends; what is left are loops.
    let starts = (0..pieces.len()).filter_map(|piece| Some((piece, is_start(piece)?)));
    let loops = (0..pieces.len()).map(|piece| (piece, 0));
    for (piece, end) in starts.chain(loops) {
        if !used[piece] {
            strokes.push(follow(pieces, &partners, &mut used, piece, end));
        }
    }
    strokes
}

/// A piece and one of its ends.
type End = (usize, usize);

/// For both ends of every piece the end that it goes on at.
fn partners(pieces: &[Piece]) -> Vec<[Option<End>; 2]> {
    let mut meeting: BTreeMap<(LineKind, Node), Vec<End>> = BTreeMap::new();
    for (index, piece) in pieces.iter().enumerate() {
        for end in 0..2 {
            meeting.entry((piece.kind, piece.ends[end].0)).or_default().push((index, end));
        }
    }
    let mut partners = vec![[None; 2]; pieces.len()];
    for ends in meeting.values() {
        for (a, b) in straightest_pairs(pieces, ends) {
            partners[a.0][a.1] = Some(b);
            partners[b.0][b.1] = Some(a);
        }
    }
    partners
}

fn straightest_pairs(pieces: &[Piece], ends: &[End]) -> Vec<(End, End)> {
    const MEETING_PX: f64 = 0.05;
    let point = |(piece, end): End| pieces[piece].ends[end].1;
    let mut pairs: Vec<(f64, End, End)> = Vec::new();
    for (index, &a) in ends.iter().enumerate() {
        for &b in &ends[..index] {
            if a.0 != b.0 && (point(a) - point(b)).norm() < MEETING_PX {
                pairs.push((direction(pieces, a).dot(&direction(pieces, b)), a, b));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken: Vec<End> = Vec::new();
    let mut chosen = Vec::new();
    for (_, a, b) in pairs {
        if !taken.contains(&a) && !taken.contains(&b) {
            taken.extend([a, b]);
            chosen.push((a, b));
        }
    }
    chosen
}

/// From an end into its piece.
fn direction(pieces: &[Piece], (piece, end): End) -> Vector2<f64> {
    let [from, to] = [pieces[piece].ends[end].1, pieces[piece].ends[1 - end].1];
    (to - from).try_normalize(1e-12).unwrap_or_default()
}

fn follow(
    pieces: &[Piece],
    partners: &[[Option<End>; 2]],
    used: &mut [bool],
    start: usize,
    end: usize,
) -> Stroke {
    let mut points = vec![pieces[start].ends[end].1];
    let mut at = Some((start, end));
    while let Some((piece, end)) = at.filter(|&(piece, _)| !used[piece]) {
        used[piece] = true;
        points.push(pieces[piece].ends[1 - end].1);
        at = partners[piece][1 - end];
    }
    Stroke { kind: pieces[start].kind, points, widths_px: Vec::new() }
}
