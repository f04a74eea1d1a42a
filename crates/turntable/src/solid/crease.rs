//! Which corners of the slices are drawn as lines, and hence sharp.
//!
//! A corner of the visual hull that several views would see, but none draws, is
//! an artefact of too few views; one with ink on it wherever it can be seen is
//! a crease of the subject.

use std::f64::consts::{PI, TAU};

use image::{GrayImage, ImageBuffer, Luma};
use imageproc::integral_image::{integral_image, sum_image_pixels};

use super::outline::Outline;
use super::section::{EdgeSource, Section};

/// Corners that turn less are left round, radians.
const MIN_TURNING_RAD: f64 = 0.3;
/// A face is seen while its normal is within this of the camera, radians.
const MAX_FACING_RAD: f64 = 85.0 * PI / 180.0;
/// Ink closer than this to the outline may be the outline's own, px.
const OUTLINE_MARGIN_PX: f64 = 5.0;
/// The share of inked slices that makes a crease.
const SHARP_SHARE: f64 = 0.7;
/// The share of slices in which a corner must be seen to be judged.
const MIN_SEEN_SHARE: f64 = 0.05;
/// Ink is in a crowd where it fills much of what is about it, as far as these shares of the
/// drawing's height, across and down.
const CROWD: (f64, f64) = (0.06, 0.03);
/// What is near a single line is five pixels wide; as far at least, px.
const MIN_CROWD_PX: (f64, f64) = (12.0, 6.0);
/// A corner is judged by drawings whose shares of paper about it sum to more.
const MIN_PAPER: f64 = 0.5;
/// Tracks seen in fewer slices say nothing.
const MIN_SEEN_SLICES: usize = 3;
/// Corners a slice apart and farther from each other are different ones, px a px.
const MAX_TRACK_SLOPE: f64 = 7.0;

/// Ink near a point of one drawing.
pub(super) struct InkEvidence<'a> {
    /// The view's outline; its intervals say what is well inside.
    pub outline: &'a Outline,
    /// Per image pixel, whether there is ink within two columns and one row.
    pub near_ink: &'a [bool],
    pub width: usize,
    pub axis_px: f64,
    /// For a view made by mirroring: column `u` of the outline is column
    /// `sum - u` of the drawing, px from the axis.
    pub mirror_sum_px: Option<f64>,
}

impl InkEvidence<'_> {
    /// Whether ink is drawn at column `u_px` from the axis in row `y`; `None`
    /// near the outline.
    pub(super) fn ink_at(&self, u_px: f64, y: usize) -> Option<bool> {
        let inside = |&(low, high): &(f64, f64)| {
            low + OUTLINE_MARGIN_PX < u_px && u_px < high - OUTLINE_MARGIN_PX
        };
        if !self.outline.row(y).iter().any(inside) {
            return None;
        }
        let column = self.column(u_px);
        let column = (column >= 0.0 && column < self.width as f64).then_some(column as usize)?;
        self.near_ink.get(y * self.width + column).copied()
    }

    /// The drawing's column at `u_px` from the axis.
    fn column(&self, u_px: f64) -> f64 {
        self.mirror_sum_px.map_or(u_px, |sum| sum - u_px) + self.axis_px
    }

    /// The middles of the lines that cross row `y` between two columns, px from
    /// the axis, ascending.
    pub(super) fn lines_between(&self, low_px: f64, high_px: f64, y: usize) -> Vec<f64> {
        let (a, b) = (self.column(low_px), self.column(high_px));
        let row = self.near_ink.get(y * self.width..(y + 1) * self.width).unwrap_or(&[]);
        let first = a.min(b).ceil().max(0.0) as usize;
        let last = (a.max(b).floor().max(0.0) as usize).min(row.len());
        let mut lines = Vec::new();
        let mut start = None;
        let between = row.iter().copied().enumerate().take(last).skip(first);
        for (x, inked) in between.chain([(last, false)]) {
            match (inked, start) {
                (true, None) => start = Some(x),
                (false, Some(from)) => {
                    let column = (from + x) as f64 / 2.0 - self.axis_px;
                    lines.push(self.mirror_sum_px.map_or(column, |sum| sum - column));
                    start = None;
                }
                _ => {}
            }
        }
        lines.sort_by(f64::total_cmp);
        lines
    }
}

/// How much of a drawing is bare, by place: between strokes that fill a face's shadows or a
/// hatched side there is ink wherever one looks, and it draws no crease.
struct Paper<'a> {
    evidence: &'a InkEvidence<'a>,
    /// Of the pixels near ink, an integral image.
    sums: ImageBuffer<Luma<u32>, Vec<u32>>,
}

impl<'a> Paper<'a> {
    fn new(evidence: &'a InkEvidence<'a>) -> Self {
        let InkEvidence { near_ink, width, .. } = *evidence;
        let height = near_ink.len() / width.max(1);
        let inked = GrayImage::from_fn(width as u32, height as u32, |x, y| {
            Luma([u8::from(near_ink[y as usize * width + x as usize])])
        });
        Self { evidence, sums: integral_image(&inked) }
    }

    /// The share of what is about column `u_px` from the axis in row `y` that is not near ink.
    fn share(&self, u_px: f64, y: usize) -> f64 {
        // One more than the drawing's.
        let [width, height] = [self.sums.width(), self.sums.height()].map(|side| side - 1);
        let across = (CROWD.0 * height as f64).max(MIN_CROWD_PX.0);
        let down = (CROWD.1 * height as f64).max(MIN_CROWD_PX.1) as u32;
        let (column, y) = (self.evidence.column(u_px), (y as u32).min(height));
        let end = |at: f64| (at.max(0.0) as u32).min(width);
        let (left, right) = (end(column - across), end(column + across + 1.0));
        let (top, bottom) = (y.saturating_sub(down), (y + down + 1).min(height));
        if left >= right || top >= bottom {
            return 1.0;
        }
        let [inked] = sum_image_pixels(&self.sums, left, top, right - 1, bottom - 1);
        1.0 - f64::from(inked) / f64::from((right - left) * (bottom - top))
    }
}

/// The sections of one slice and the image row that it was cut in.
pub(super) struct Slice {
    pub row: usize,
    pub sections: Vec<Section>,
}

#[derive(Clone, Copy)]
struct Corner {
    evidence: Option<f64>,
    track: usize,
    sharp: Option<bool>,
}

/// Judges every corner of every section: `true` is a crease.
///
/// * `slices`: bottom to top, `pitch_px` apart.
/// * `drawings`: what may show ink; parallel views count each for itself.
/// * `window_px`: the height over which ink along a corner's track is averaged.
///
/// Corners that no view sees copy the corner across, else the majority of
/// their section; without any evidence they are `boxy`.
pub(super) fn sharp_corners(
    slices: &[Slice],
    drawings: &[InkEvidence],
    pitch_px: f64,
    window_px: f64,
    boxy: bool,
) -> Vec<Vec<Vec<bool>>> {
    use rayon::prelude::*;
    let papers: Vec<Paper<'_>> = drawings.par_iter().map(Paper::new).collect();
    let mut corners = gather(slices, &papers);
    let tracks = link(slices, &mut corners, pitch_px);
    let window = (window_px / pitch_px / 2.0).ceil() as usize;
    for track in &tracks {
        judge(track, &mut corners, window);
    }
    slices
        .iter()
        .zip(&corners)
        .map(|(slice, states)| {
            let judged = slice.sections.iter().zip(states);
            judged.map(|(section, states)| complete(section, states, boxy)).collect()
        })
        .collect()
}

type Corners = Vec<Vec<Vec<Corner>>>;
type Place = (usize, usize, usize);

fn gather(slices: &[Slice], drawings: &[Paper]) -> Corners {
    use rayon::prelude::*;
    let of_section = |slice: &Slice, index: usize| -> Vec<Corner> {
        (0..slice.sections[index].len())
            .map(|corner| Corner {
                evidence: evidence(slice, index, corner, drawings),
                track: usize::MAX,
                sharp: None,
            })
            .collect()
    };
    slices
        .par_iter()
        .map(|slice| (0..slice.sections.len()).map(|index| of_section(slice, index)).collect())
        .collect()
}

/// The share of the views that see the corner and have ink on it, each as much as there is paper
/// about it.
fn evidence(slice: &Slice, index: usize, corner: usize, drawings: &[Paper]) -> Option<f64> {
    let section = &slice.sections[index];
    if section.turning_rad(corner) < MIN_TURNING_RAD {
        return None;
    }
    let point = section.corners[corner];
    let before = (corner + section.len() - 1) % section.len();
    let faces = [section.normals_rad[before], section.normals_rad[corner]];
    let (mut seen, mut inked) = (0.0, 0.0);
    for paper in drawings {
        let drawing = paper.evidence;
        let camera_rad = drawing.outline.azimuth_rad - PI / 2.0;
        if faces.iter().any(|&normal| angle_between(normal, camera_rad) > MAX_FACING_RAD) {
            continue;
        }
        let column = drawing.outline.column(&point);
        if is_hidden(slice, index, drawing.outline, column, &point) {
            continue;
        }
        if let Some(ink) = drawing.ink_at(column, slice.row) {
            let share = paper.share(column, slice.row);
            seen += share;
            inked += if ink { share } else { 0.0 };
        }
    }
    (seen > MIN_PAPER).then(|| inked / seen)
}

/// Whether another section of the slice stands before the point.
fn is_hidden(
    slice: &Slice,
    index: usize,
    outline: &Outline,
    column: f64,
    point: &nalgebra::Point2<f64>,
) -> bool {
    let toward = outline.toward_camera();
    let nearness = toward.dot(&point.coords);
    slice.sections.iter().enumerate().any(|(other, section)| {
        let (low, high) = section.extent_along(&outline.right());
        other != index
            && low < column
            && column < high
            && toward.dot(&section.centre().coords) > nearness
    })
}

fn angle_between(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}

/// Follows corners between the same two edges from slice to slice.
fn link(slices: &[Slice], corners: &mut Corners, pitch_px: f64) -> Vec<Vec<Place>> {
    let mut tracks: Vec<Vec<Place>> = Vec::new();
    let mut previous: Vec<(Place, [EdgeSource; 2])> = Vec::new();
    for (k, slice) in slices.iter().enumerate() {
        let mut current = Vec::new();
        for (s, section) in slice.sections.iter().enumerate() {
            for c in 0..section.len() {
                if section.turning_rad(c) < MIN_TURNING_RAD {
                    continue;
                }
                let before = (c + section.len() - 1) % section.len();
                let label = [section.sources[before], section.sources[c]];
                let distance = |place: &Place| {
                    let other = slices[place.0].sections[place.1].corners[place.2];
                    (other - section.corners[c]).norm()
                };
                let nearest = previous
                    .iter()
                    .filter(|(_, other)| *other == label)
                    .map(|(place, _)| (distance(place), *place))
                    .filter(|(distance, _)| *distance < MAX_TRACK_SLOPE * pitch_px)
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                let track = match nearest {
                    Some((_, (pk, ps, pc))) => corners[pk][ps][pc].track,
                    None => {
                        tracks.push(Vec::new());
                        tracks.len() - 1
                    }
                };
                corners[k][s][c].track = track;
                tracks[track].push((k, s, c));
                current.push(((k, s, c), label));
            }
        }
        previous = current;
    }
    tracks
}

/// Averages the evidence along a track over `window` places to each side.
fn judge(track: &[Place], corners: &mut Corners, window: usize) {
    let evidence: Vec<Option<f64>> =
        track.iter().map(|&(k, s, c)| corners[k][s][c].evidence).collect();
    if evidence.iter().flatten().count() < MIN_SEEN_SLICES {
        return;
    }
    for (i, &(k, s, c)) in track.iter().enumerate() {
        let near = &evidence[i.saturating_sub(window)..(i + window + 1).min(evidence.len())];
        let seen = near.iter().flatten().count();
        let sum: f64 = near.iter().flatten().sum();
        if seen as f64 > MIN_SEEN_SHARE * near.len() as f64 {
            corners[k][s][c].sharp = Some(sum / seen as f64 > SHARP_SHARE);
        }
    }
}

/// Decides for the corners that no view sees.
fn complete(section: &Section, corners: &[Corner], boxy: bool) -> Vec<bool> {
    let n = section.len();
    let known = || corners.iter().filter_map(|corner| corner.sharp);
    let majority = match known().count() {
        0 => boxy,
        count => known().filter(|&sharp| sharp).count() * 2 > count,
    };
    (0..n)
        .map(|c| {
            if let Some(sharp) = corners[c].sharp {
                return sharp;
            }
            if section.turning_rad(c) < MIN_TURNING_RAD {
                return false;
            }
            let across = (0..n).filter(|&other| is_across(section, c, other));
            let votes: Vec<bool> = across.filter_map(|other| corners[other].sharp).collect();
            match votes.len() {
                0 => majority,
                count => votes.iter().filter(|&&sharp| sharp).count() * 2 > count,
            }
        })
        .collect()
}

/// Whether the faces at `other` look the opposite way to those at `corner`.
fn is_across(section: &Section, corner: usize, other: usize) -> bool {
    let n = section.len();
    let before = |c: usize| (c + n - 1) % n;
    let opposed = |a: usize, b: usize| {
        angle_between(section.normals_rad[a], section.normals_rad[b] + PI) < 0.9
    };
    other != corner && opposed(before(other), before(corner)) && opposed(other, corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_told_from_a_crowd_of_strokes() {
        let (width, height) = (120, 100);
        let inked = |x: usize, y: usize| x == 30 || (x > 60 && !(x + y).is_multiple_of(3));
        let near_ink: Vec<bool> =
            (0..width * height).map(|index| inked(index % width, index / width)).collect();
        let outline = Outline { azimuth_rad: 0.0, rows: vec![vec![(-60.0, 60.0)]; height] };
        let evidence = InkEvidence {
            outline: &outline,
            near_ink: &near_ink,
            width,
            axis_px: 60.0,
            mirror_sum_px: None,
        };
        let paper = Paper::new(&evidence);
        assert!((paper.share(-30.0, 50) - 24.0 / 25.0).abs() < 0.02, "{}", paper.share(-30.0, 50));
        assert!((paper.share(35.0, 50) - 1.0 / 3.0).abs() < 0.02, "{}", paper.share(35.0, 50));
        assert_eq!(paper.share(-59.0, 0), 1.0);
        assert_eq!(paper.share(500.0, 500), 1.0);
    }
}
