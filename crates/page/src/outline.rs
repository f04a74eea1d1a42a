//! The outline of a mask as a polygon of few corners.

use image::GrayImage;
use subject::Point;
use subject::raster::Bits;

/// The outline's corners are within this share of the height.
pub(crate) const TOLERANCE: f64 = 0.004;

/// The eight neighbours clockwise, from the right.
const AROUND: [(i64, i64); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// The outer outline of the largest part of `mask`, its corners no farther
/// than `tolerance` px from the traced pixels; empty if nothing is set.
pub(crate) fn outline(mask: &Bits, tolerance: f64) -> Vec<Point> {
    let parts = mask.components(true);
    let largest =
        (0..parts.parts.len()).max_by_key(|&k| (parts.parts[k].area, std::cmp::Reverse(k)));
    let Some(largest) = largest else { return Vec::new() };
    let part = parts.select(mask.width, |k| k == largest);
    simplified(&traced(&part), tolerance)
}

/// The outer outline of the largest part of a mask (0 outside) as a polygon in
/// its pixels, its corners within a few thousandths of its height; empty if
/// nothing is set.
pub fn outline_of(mask: &GrayImage) -> Vec<Point> {
    let (width, height) = mask.dimensions();
    let mut bits = Bits::filled(width as usize, height as usize, false);
    bits.data.iter_mut().zip(mask.as_raw()).for_each(|(bit, level)| *bit = *level != 0);
    outline(&bits, (TOLERANCE * f64::from(height)).max(0.7))
}

/// The pixels along the outline, by walking round it (Moore neighbours).
fn traced(part: &Bits) -> Vec<Point> {
    let Some(first) = part.data.iter().position(|is| *is) else { return Vec::new() };
    let start = ((first % part.width) as i64, (first / part.width) as i64);
    let point = |(x, y): (i64, i64)| Point { x: x as f64 + 0.5, y: y as f64 + 0.5 };
    let mut points = vec![point(start)];
    let (mut at, mut heading) = (start, 0_usize);
    let mut second = None;
    // A walk visits each pixel from each side at most once.
    for _ in 0..8 * part.data.len() {
        // Looks from the left of where it came from on.
        let found = (0..8).map(|turn| (heading + 6 + turn) % 8).find(|&k| {
            let (dx, dy) = AROUND[k];
            part.at(at.0 + dx, at.1 + dy)
        });
        let Some(k) = found else { break };
        let next = (at.0 + AROUND[k].0, at.1 + AROUND[k].1);
        if at == start && second == Some(next) {
            break;
        }
        second = second.or(Some(next));
        (at, heading) = (next, k);
        points.push(point(at));
    }
    points
}

/// Fewer corners, none of the left out farther than `tolerance` from the line.
///
/// # Source
/// Douglas & Peucker 1973.
fn simplified(points: &[Point], tolerance: f64) -> Vec<Point> {
    if points.len() < 4 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    // A closed walk has no two ends: it is halved where it is farthest.
    let away = |p: &Point| (p.x - points[0].x).hypot(p.y - points[0].y);
    let far = (0..points.len())
        .max_by(|&a, &b| away(&points[a]).total_cmp(&away(&points[b])))
        .unwrap_or(0);
    (keep[0], keep[far]) = (true, true);
    let mut open = vec![(0, far), (far, points.len() - 1)];
    while let Some((from, to)) = open.pop() {
        let worst = (from + 1..to)
            .map(|k| (k, distance(&points[k], &points[from], &points[to])))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, off)) = worst
            && off > tolerance
        {
            keep[k] = true;
            open.extend([(from, k), (k, to)]);
        }
    }
    let kept = points.iter().zip(&keep).filter(|(_, is)| **is);
    kept.map(|(point, _)| *point).collect()
}

/// From a point to the line through two others, or to one if they are the same.
fn distance(p: &Point, a: &Point, b: &Point) -> f64 {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let length = dx.hypot(dy);
    if length == 0.0 {
        return (p.x - a.x).hypot(p.y - a.y);
    }
    ((p.x - a.x) * dy - (p.y - a.y) * dx).abs() / length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_has_four_corners() {
        let mut bits = Bits::filled(60, 40, false);
        for y in 5..35 {
            (10..50).for_each(|x| bits.set(x, y, true));
        }
        bits.set(2, 2, true);
        let corners = outline(&bits, 1.0);
        assert!((4..=5).contains(&corners.len()), "{corners:?}");
        assert!(outline(&Bits::filled(3, 3, false), 1.0).is_empty());
        let mut one = Bits::filled(3, 3, false);
        one.set(1, 1, true);
        assert_eq!(outline(&one, 1.0).len(), 1);
    }
}
