use image::GrayImage;

use super::super::ink::{INK_THRESHOLD, InkMap};
use super::SilhouetteSource;

/// A region that opens once its gaps are closed counts as inside if it is
/// this many times wider than the gap.
const MIN_WIDTH_PER_GAP: u32 = 5;
const INSIDE: u8 = 255;

/// 255 where `mask` is 128 or more.
pub fn binarised(mask: &GrayImage) -> GrayImage {
    let mut inside = mask.clone();
    for level in inside.iter_mut() {
        *level = if *level >= 128 { INSIDE } else { 0 };
    }
    inside
}

/// What paper connected to the border does not reach.
///
/// Gaps of one pixel are always closed. A wider gap, up to `max_gap_px`, is
/// closed where it shuts in a region much wider than itself: a slit between
/// two legs stays open, a body whose outline has a hole does not run out.
pub fn filled_outline(ink: &InkMap, max_gap_px: u32) -> (GrayImage, SilhouetteSource) {
    let barrier = distance_to_ink(ink);
    let mut inside = inside_with_gaps_closed(ink, &barrier, u32::from(max_gap_px > 0));
    let mut closed_gap_px = 0;
    let widest = inside_with_gaps_closed(ink, &barrier, max_gap_px.div_ceil(2));
    let shuts_in_more = add_wide_regions(&mut inside.clone(), &widest, &barrier, ink.width(), 10);
    for radius in (2..=max_gap_px.div_ceil(2)).filter(|_| shuts_in_more) {
        let closed = inside_with_gaps_closed(ink, &barrier, radius);
        let min_depth = radius * MIN_WIDTH_PER_GAP;
        if add_wide_regions(&mut inside, &closed, &barrier, ink.width(), min_depth) {
            closed_gap_px = radius * 2;
        }
    }
    let mask = image_of(ink, &inside);
    (mask, SilhouetteSource::Filled { closed_gap_px })
}

fn image_of(ink: &InkMap, inside: &[bool]) -> GrayImage {
    let levels = inside.iter().map(|&is| if is { INSIDE } else { 0 });
    let (width, height) = (ink.width() as u32, ink.height() as u32);
    GrayImage::from_raw(width, height, levels.collect()).unwrap_or_default()
}

/// Chessboard distance of every pixel to the nearest inked one, up to 255.
fn distance_to_ink(ink: &InkMap) -> Vec<u8> {
    let (width, height) = (ink.width(), ink.height());
    let mut distance: Vec<u8> = ink
        .as_slice()
        .iter()
        .map(|&share| if share > INK_THRESHOLD { 0 } else { u8::MAX })
        .collect();
    for y in 0..height {
        let (above, from_here) = distance.split_at_mut(y * width);
        let row = &mut from_here[..width];
        relax(row, above.len().checked_sub(width).map(|start| &above[start..]));
    }
    distance.reverse();
    for y in 0..height {
        let (above, from_here) = distance.split_at_mut(y * width);
        let row = &mut from_here[..width];
        relax(row, above.len().checked_sub(width).map(|start| &above[start..]));
    }
    distance.reverse();
    distance
}

/// Lowers a row to one more than what is before it and above it.
fn relax(row: &mut [u8], above: Option<&[u8]>) {
    if let Some(above) = above.filter(|above| !above.is_empty()) {
        let last = row.len() - 1;
        let lower = |value: &mut u8, from: u8| *value = (*value).min(from.saturating_add(1));
        row.iter_mut().zip(above).for_each(|(value, &from)| lower(value, from));
        row[1..].iter_mut().zip(above).for_each(|(value, &from)| lower(value, from));
        row[..last].iter_mut().zip(&above[1..]).for_each(|(value, &from)| lower(value, from));
    }
    let mut before = u8::MAX;
    for value in row {
        before = (*value).min(before.saturating_add(1));
        *value = before;
    }
}

/// Floods paper from the border where the distance to ink exceeds `radius`,
/// then lets the flood creep back to the lines it was held off from.
fn inside_with_gaps_closed(ink: &InkMap, distance: &[u8], radius: u32) -> Vec<bool> {
    let (width, height) = (ink.width(), ink.height());
    let mut outside = flooded(width, height, |index| u32::from(distance[index]) > radius);
    let mut held_off: Vec<usize> = (0..outside.len())
        .filter(|&index| (1..=radius).contains(&u32::from(distance[index])))
        .collect();
    for _ in 0..radius {
        creep(&mut outside, &mut held_off, width);
    }
    outside.iter_mut().for_each(|is| *is = !*is);
    outside
}

/// The pixels that satisfy `open` and connect to the border through such pixels.
fn flooded(width: usize, height: usize, open: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut reached = vec![false; width * height];
    let mut stack = Vec::new();
    let visit = |index: usize, reached: &mut Vec<bool>, stack: &mut Vec<usize>| {
        if !reached[index] && open(index) {
            reached[index] = true;
            stack.push(index);
        }
    };
    for x in 0..width {
        visit(x, &mut reached, &mut stack);
        visit((height - 1) * width + x, &mut reached, &mut stack);
    }
    for y in 0..height {
        visit(y * width, &mut reached, &mut stack);
        visit(y * width + width - 1, &mut reached, &mut stack);
    }
    while let Some(index) = stack.pop() {
        let x = index % width;
        if x > 0 {
            visit(index - 1, &mut reached, &mut stack);
        }
        if x + 1 < width {
            visit(index + 1, &mut reached, &mut stack);
        }
        if index >= width {
            visit(index - width, &mut reached, &mut stack);
        }
        if index + width < reached.len() {
            visit(index + width, &mut reached, &mut stack);
        }
    }
    reached
}

/// Grows the outside by one pixel (chessboard) over the paper that was held off.
fn creep(outside: &mut [bool], held_off: &mut Vec<usize>, width: usize) {
    let touches = |index: usize| {
        let x = index % width;
        let columns = [x.checked_sub(1), Some(x), Some(x + 1).filter(|&x| x < width)];
        let row = index - x;
        columns.into_iter().flatten().any(|column| {
            let at = |row: usize| outside.get(row + column).copied().unwrap_or(false);
            at(row) || at(row + width) || row.checked_sub(width).is_some_and(at)
        })
    };
    let (reached, left): (Vec<usize>, Vec<usize>) =
        held_off.iter().partition(|&&index| touches(index));
    reached.into_iter().for_each(|index| outside[index] = true);
    *held_off = left;
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
