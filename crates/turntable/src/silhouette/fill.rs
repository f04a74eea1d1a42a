//! Fills an outline: what paper connected to the picture's border does not reach.

use image::GrayImage;
use picture::{border, flooded};

use super::SilhouetteSource;
use super::bridges::Bridge;
use crate::ink::{INK_THRESHOLD, InkMap};
use crate::raster::two_passes;

/// A region that opens once its gaps are closed counts as inside if it is
/// this many times wider than the gap.
const MIN_WIDTH_PER_GAP: u32 = 5;
const INSIDE: u8 = 255;

/// 255 where `mask` is 128 or more.
pub(super) fn binarised(mask: &GrayImage) -> GrayImage {
    let mut inside = mask.clone();
    for level in inside.iter_mut() {
        *level = if *level >= 128 { INSIDE } else { 0 };
    }
    inside
}

/// What paper connected to the border does not reach.
///
/// `bridges` hold paper off as ink does. Gaps of one pixel are
/// always closed. A wider gap, up to `max_gap_px`, is
/// closed where it shuts in a region much wider than itself: a slit between
/// two legs stays open, a body whose outline has a hole does not run out.
pub(super) fn filled_outline(
    ink: &InkMap,
    bridges: &[Bridge],
    max_gap_px: u32,
) -> (GrayImage, SilhouetteSource) {
    let barrier = distance_to_ink(ink, bridges);
    let mut inside = inside_with_gaps_closed(ink, &barrier, u32::from(max_gap_px > 0));
    let mut closed_gap_px = widest_on_border(bridges, &inside, ink.width());
    let widest = inside_with_gaps_closed(ink, &barrier, max_gap_px.div_ceil(2));
    let shuts_in_more = add_wide_regions(&mut inside.clone(), &widest, &barrier, ink.width(), 10);
    for radius in (2..=max_gap_px.div_ceil(2)).filter(|_| shuts_in_more) {
        let closed = inside_with_gaps_closed(ink, &barrier, radius);
        let min_depth = radius * MIN_WIDTH_PER_GAP;
        if add_wide_regions(&mut inside, &closed, &barrier, ink.width(), min_depth) {
            closed_gap_px = closed_gap_px.max(radius * 2);
        }
    }
    let mask = image_of(ink, &inside);
    (mask, SilhouetteSource::Filled { closed_gap_px })
}

/// The longest bridge that holds off the outside, px.
fn widest_on_border(bridges: &[Bridge], inside: &[bool], width: usize) -> u32 {
    let is_outside = |index: usize| !inside.get(index).copied().unwrap_or(true);
    let on_border = |&index: &usize| {
        let across = index % width;
        (across > 0 && is_outside(index - 1))
            || (across + 1 < width && is_outside(index + 1))
            || index.checked_sub(width).is_some_and(is_outside)
            || is_outside(index + width)
    };
    let holding = bridges.iter().filter(|bridge| bridge.iter().any(on_border));
    holding.map(|bridge| bridge.len() as u32).max().unwrap_or(0)
}

fn image_of(ink: &InkMap, inside: &[bool]) -> GrayImage {
    let levels = inside.iter().map(|&is| if is { INSIDE } else { 0 });
    let (width, height) = (ink.width() as u32, ink.height() as u32);
    GrayImage::from_raw(width, height, levels.collect()).unwrap_or_default()
}

/// Chessboard distance of every pixel to the nearest inked or bridging one, up to 255.
fn distance_to_ink(ink: &InkMap, bridges: &[Bridge]) -> Vec<u8> {
    let mut distance: Vec<u8> = ink
        .as_slice()
        .iter()
        .map(|&share| if share > INK_THRESHOLD { 0 } else { u8::MAX })
        .collect();
    bridges.iter().flatten().for_each(|&index| distance[index] = 0);
    two_passes(&mut distance, ink.width(), relax);
    distance
}

/// Lowers a row to one more than what is before it and above it.
fn relax(row: &mut [u8], above: Option<&[u8]>) {
    if let Some(above) = above {
        lower(row, above);
        lower(&mut row[1..], above);
        lower(row, &above[1..]);
    }
    let mut before = u8::MAX;
    for value in row {
        *value = (*value).min(before.saturating_add(1));
        before = *value;
    }
}

fn lower(row: &mut [u8], above: &[u8]) {
    for (value, above) in row.iter_mut().zip(above) {
        *value = (*value).min(above.saturating_add(1));
    }
}

/// Floods paper from the border where the distance to ink exceeds `radius`,
/// then lets the flood creep back to the lines it was held off from.
fn inside_with_gaps_closed(ink: &InkMap, distance: &[u8], radius: u32) -> Vec<bool> {
    let (width, height) = (ink.width(), ink.height());
    let open = distance.iter().map(|&distance| u32::from(distance) > radius).collect();
    let mut outside = flooded(width, open, border(width, height));
    let is_held_off = |index: usize| (1..=radius).contains(&u32::from(distance[index]));
    let mut front: Vec<usize> = (0..outside.len())
        .filter(|&index| is_held_off(index) && !outside[index])
        .filter(|&index| around(index, width, outside.len()).any(|near| outside[near]))
        .collect();
    front.iter().for_each(|&index| outside[index] = true);
    for _ in 1..radius {
        let mut next = Vec::new();
        for index in front {
            for near in around(index, width, outside.len()) {
                if !outside[near] && is_held_off(near) {
                    outside[near] = true;
                    next.push(near);
                }
            }
        }
        front = next;
    }
    outside.iter_mut().for_each(|is| *is = !*is);
    outside
}

/// The up to eight pixels around `index` in an image of `count` pixels.
fn around(index: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let x = index % width;
    let row = index - x;
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    let rows = [row.checked_sub(width), Some(row), Some(row + width).filter(|&row| row < count)];
    let rows = rows.into_iter().flatten();
    let all = rows.flat_map(move |row| columns.clone().map(move |column| row + column));
    all.filter(move |&near| near != index)
}

/// Adds to `inside` the connected regions of `closed` outside it that hold a
/// pixel at least `min_depth` from any ink. True if there was one.
fn add_wide_regions(
    inside: &mut [bool],
    closed: &[bool],
    distance: &[u8],
    width: usize,
    min_depth: u32,
) -> bool {
    let mut seen = inside.to_vec();
    let mut added = false;
    for start in 0..closed.len() {
        if seen[start] || !closed[start] {
            continue;
        }
        let region = region_from(start, closed, &mut seen, width);
        if region.iter().any(|&index| u32::from(distance[index]) >= min_depth) {
            region.iter().for_each(|&index| inside[index] = true);
            added = true;
        }
    }
    added
}

fn region_from(start: usize, closed: &[bool], seen: &mut [bool], width: usize) -> Vec<usize> {
    let mut region = vec![start];
    seen[start] = true;
    let mut next = 0;
    while next < region.len() {
        let index = region[next];
        next += 1;
        let x = index % width;
        let neighbours = [
            (x > 0).then(|| index - 1),
            (x + 1 < width).then_some(index + 1),
            index.checked_sub(width),
            Some(index + width),
        ];
        for neighbour in neighbours.into_iter().flatten() {
            if neighbour < closed.len() && closed[neighbour] && !seen[neighbour] {
                seen[neighbour] = true;
                region.push(neighbour);
            }
        }
    }
    region
}
