//! Strokes as SVG.

use std::fmt::Write as _;

use nalgebra::Point2;

use super::options::Ink;
use super::{DrawOptions, LineKind, Stroke};

/// Writes strokes as an SVG of the drawing's size, one group for each kind of line; lines and paper
/// only, no colours of the model.
pub fn svg(strokes: &[Stroke], options: &DrawOptions) -> String {
    const KINDS: [LineKind; 5] = [
        LineKind::Silhouette,
        LineKind::Contour,
        LineKind::Border,
        LineKind::Crease,
        LineKind::Material,
    ];
    let (width, height) = (options.width_px, options.height_px);
    let dark = options.ink == Ink::Lines && options.background.contrasting() == 255;
    let pen = if dark { "white" } else { "black" };
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" fill=\"none\" stroke=\"{pen}\" stroke-width=\"{}\" \
         stroke-linecap=\"round\" stroke-linejoin=\"round\">\n",
        options.line_width_px
    );
    if let Some([r, g, b]) = options.background.paper() {
        let fill = match [r, g, b] {
            [255, 255, 255] => "white".to_owned(),
            _ => format!("#{r:02x}{g:02x}{b:02x}"),
        };
        let _ = writeln!(
            text,
            "<rect width=\"100%\" height=\"100%\" fill=\"{fill}\" stroke=\"none\"/>"
        );
    }
    for kind in KINDS {
        let of_kind: Vec<_> = strokes.iter().filter(|stroke| stroke.kind == kind).collect();
        if of_kind.is_empty() {
            continue;
        }
        // Writing to a string cannot fail.
        let _ = writeln!(text, "<g id=\"{}\">", id(kind));
        of_kind.into_iter().for_each(|stroke| push_path(&mut text, stroke));
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

fn id(kind: LineKind) -> &'static str {
    match kind {
        LineKind::Silhouette => "silhouette",
        LineKind::Contour => "contour",
        LineKind::Border => "border",
        LineKind::Crease => "crease",
        LineKind::Material => "material",
    }
}

fn push_path(text: &mut String, stroke: &Stroke) {
    let points = simplified(&stroke.points);
    let closed = points.len() > 3 && points.first() == points.last();
    let drawn = &points[..points.len() - usize::from(closed)];
    text.push_str("<path d=\"");
    for (index, p) in drawn.iter().enumerate() {
        let command = if index == 0 { 'M' } else { 'L' };
        let _ = write!(text, "{command}{} {}", rounded(p.x), rounded(p.y));
    }
    text.push_str(if closed { "Z\"" } else { "\"" });
    if !stroke.widths_px.is_empty() {
        let mean = stroke.widths_px.iter().sum::<f64>() / stroke.widths_px.len() as f64;
        let _ = write!(text, " stroke-width=\"{}\"", rounded(mean));
    }
    text.push_str("/>\n");
}

fn rounded(value: f64) -> f64 {
    // Adding 0 turns -0 into 0.
    (value * 100.0).round() / 100.0 + 0.0
}

/// Leaves out points that lie on the line between their neighbours, to a fiftieth of a pixel
/// (Ramer 1972; Douglas and Peucker 1973).
fn simplified(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    const TOLERANCE_PX: f64 = 0.02;
    let mut kept = vec![false; points.len()];
    let Some(last) = points.len().checked_sub(1) else {
        return Vec::new();
    };
    (kept[0], kept[last]) = (true, true);
    let mut pending = vec![[0, last]];
    while let Some([from, to]) = pending.pop() {
        let farthest = (from + 1..to)
            .map(|index| (distance(points[index], points[from], points[to]), index))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, index)) = farthest.filter(|f| f.0 > TOLERANCE_PX) {
            debug_assert!(distance.is_finite());
            kept[index] = true;
            pending.extend([[from, index], [index, to]]);
        }
    }
    let points = points.iter().zip(kept);
    points.filter_map(|(&point, kept)| kept.then_some(point)).collect()
}

/// Of a point from the segment a-b.
fn distance(p: Point2<f64>, a: Point2<f64>, b: Point2<f64>) -> f64 {
    let along = b - a;
    let length_squared = along.norm_squared();
    let t = if length_squared > 0.0 { (p - a).dot(&along) / length_squared } else { 0.0 };
    (p - (a + along * t.clamp(0.0, 1.0))).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Background;

    fn stroke(points: &[[f64; 2]]) -> Stroke {
        Stroke {
            kind: LineKind::Silhouette,
            points: points.iter().map(|&p| Point2::from(p)).collect(),
            widths_px: Vec::new(),
        }
    }

    #[test]
    fn keeps_corners_and_drops_points_on_straight_lines() {
        let square =
            stroke(&[[0.0, 0.0], [4.0, 0.001], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0], [0.0, 0.0]]);
        let text = svg(&[square], &DrawOptions::default());
        assert!(text.contains("<path d=\"M0 0L8 0L8 8L0 8Z\"/>"), "{text}");
        assert!(text.contains("<g id=\"silhouette\">") && !text.contains("contour"));
    }

    #[test]
    fn transparent_drawings_have_no_paper() {
        let options = DrawOptions { background: Background::Transparent, ..DrawOptions::default() };
        assert!(!svg(&[], &options).contains("<rect"));
        assert!(svg(&[], &DrawOptions::default()).contains("<rect"));
    }
}
