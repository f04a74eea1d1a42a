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
    if widest != inside {
        for radius in 2..=max_gap_px.div_ceil(2) {
            let closed = inside_with_gaps_closed(ink, &barrier, radius);
            let min_depth = radius * MIN_WIDTH_PER_GAP;
            if add_wide_regions(&mut inside, &closed, &barrier, ink.width(), min_depth) {
                closed_gap_px = radius * 2;
            }
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
        for x in 0..width {
            relax(
                &mut distance,
                (width, height),
                (x, y),
                [(-1, 0), (-1, -1), (0, -1), (1, -1)],
            );
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax(
                &mut distance,
                (width, height),
                (x, y),
                [(1, 0), (1, 1), (0, 1), (-1, 1)],
            );
        }
    }
    distance
}

fn relax(
    distance: &mut [u8],
    (width, height): (usize, usize),
    (x, y): (usize, usize),
    offsets: [(isize, isize); 4],
) {
    let index = y * width + x;
    for (dx, dy) in offsets {
        let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else {
            continue;
        };
        if nx < width && ny < height {
            let through = distance[ny * width + nx].saturating_add(1);
            distance[index] = distance[index].min(through);
        }
    }
}

/// Floods paper from the border where the distance to ink exceeds `radius`,
/// then lets the flood creep back to the lines it was held off from.
fn inside_with_gaps_closed(ink: &InkMap, distance: &[u8], radius: u32) -> Vec<bool> {
    let (width, height) = (ink.width(), ink.height());
    let mut outside = flooded(width, height, |index| u32::from(distance[index]) > radius);
    for _ in 0..radius {
        creep(&mut outside, distance, width);
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

/// Grows the outside by one pixel (chessboard), over paper only.
fn creep(outside: &mut Vec<bool>, distance: &[u8], width: usize) {
    let before = outside.clone();
    let at = |index: Option<usize>| index.is_some_and(|i| before.get(i).copied().unwrap_or(false));
    for index in 0..before.len() {
        if before[index] || distance[index] == 0 {
            continue;
        }
        let x = index % width;
        let columns = [x > 0, true, x + 1 < width];
        outside[index] = (0..3).filter(|&column| columns[column]).any(|column| {
            let middle = (index + column).checked_sub(1);
            at(middle)
                || at(middle.and_then(|i| i.checked_sub(width)))
                || at(middle.map(|i| i + width))
        });
    }
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
        if region
            .iter()
            .any(|&index| u32::from(distance[index]) >= min_depth)
        {
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
