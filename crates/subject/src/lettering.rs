//! Captions: small parts of about one size in a row, outside the figure.

use crate::raster::{Bits, Component, Components};
use crate::report::Box2;

/// What letters are taken for a word.
struct Limits {
    /// The tallest letter, share of the drawn height.
    tallest: f64,
    /// Parts longer than this share of the drawn height may be the figure.
    large: f64,
    /// Paper around a word, of its height.
    clear: f64,
    /// Letters of a word.
    least_letters: usize,
    /// Whether they are of one height and wholly above or below what is largest.
    apart: bool,
}

const WORDS: Limits =
    Limits { tallest: 0.1, large: 0.12, clear: 0.3, least_letters: 2, apart: false };
/// Titles of small figures.
const TITLES: Limits =
    Limits { tallest: 0.22, large: 0.26, clear: 0.15, least_letters: 4, apart: true };
/// Letters of a title are of one height to this share.
const EVEN: f64 = 0.75;
/// The shortest letter, share of the drawn height.
const SHORTEST: f64 = 0.008;
/// The next letter is within so many letter heights.
const PITCH: f64 = 1.6;

/// No letter but an I or a 1 is so many times as long as wide.
const LONG: f64 = 3.0;

/// Lettering in a raster of ink.
pub(crate) struct Lettering {
    /// The pixels of all letters.
    pub(crate) pixels: Bits,
    /// The bounds of each word or line.
    pub(crate) lines: Vec<Box2>,
}

/// Finds rows of small parts that nothing large surrounds and nothing else is
/// close to.
///
/// * `stroke_px`: the width of the drawing's strokes.
pub(crate) fn find(ink: &Bits, stroke_px: f64) -> Lettering {
    let mut words = found(ink, stroke_px, &WORDS);
    let rest = ink.clone().and_not(&words.pixels);
    let titles = found(&rest, stroke_px, &TITLES);
    words.pixels = words.pixels.or(&titles.pixels);
    words.lines.extend(titles.lines);
    words
}

fn found(ink: &Bits, stroke_px: f64, limits: &Limits) -> Lettering {
    let parts = ink.components(true);
    let drawn = ink.bounds().unwrap_or_default();
    let height = f64::from(drawn.height().max(drawn.width()));
    let large = |part: &Component| {
        f64::from(part.bounds.height().max(part.bounds.width())) >= limits.large * height
    };
    let surround = Surround::of(ink, &parts, large);
    let small: Vec<usize> = (0..parts.parts.len())
        .filter(|&k| {
            let part = &parts.parts[k];
            let tall = f64::from(part.bounds.height());
            !large(part)
                && tall <= limits.tallest * height
                && f64::from(part.bounds.width()) <= 2.0 * limits.tallest * height
                && tall.max(f64::from(part.bounds.width())) >= (SHORTEST * height).max(3.0)
                && !surround.holds(&part.bounds)
        })
        .collect();
    let groups = words(&small, &parts);
    let figure = parts
        .parts
        .iter()
        .map(|part| part.bounds)
        .max_by_key(|b| u64::from(b.width()) * u64::from(b.height()));
    let figure = figure.unwrap_or_default();
    let mut letter = vec![false; parts.parts.len()];
    let mut lines = Vec::new();
    for group in groups {
        let bounds = group.iter().map(|&k| parts.parts[k].bounds).reduce(|a, b| a.joined(&b));
        let Some(bounds) = bounds else { continue };
        // Two marks above each other are no word.
        if group.len() < limits.least_letters || bounds.width() * 4 < bounds.height() * 5 {
            continue;
        }
        let tall = group.iter().map(|&k| parts.parts[k].bounds.height()).max().unwrap_or(0);
        let tallest = group.iter().filter(|&&k| parts.parts[k].bounds.height() * 2 > tall).count();
        if tallest < limits.least_letters {
            continue;
        }
        if limits.apart {
            let even = group
                .iter()
                .filter(|&&k| f64::from(parts.parts[k].bounds.height()) >= EVEN * f64::from(tall))
                .count();
            let beside = bounds.bottom <= figure.top || bounds.top >= figure.bottom;
            if even < limits.least_letters || !beside {
                continue;
            }
        }
        let dashes = group.iter().filter(|&&k| is_dash(&parts.parts[k], stroke_px)).count();
        if dashes * 2 > group.len()
            || is_crowded(ink, &parts, &group, &bounds, f64::from(tall) * limits.clear)
        {
            continue;
        }
        group.iter().for_each(|&k| letter[k] = true);
        lines.push(bounds);
    }
    // Dots and accents go with the words.
    for &k in &small {
        let own = parts.parts[k].bounds;
        let near = lines.iter().any(|line| {
            let reach = line.height() / 2 + 1;
            own.left + reach >= line.left
                && own.right <= line.right + reach
                && own.top + reach >= line.top
                && own.bottom <= line.bottom + reach
        });
        letter[k] |= near;
    }
    Lettering { pixels: parts.select(ink.width, |k| letter[k]), lines }
}

/// Whether a part is one straight stroke, as dashes of an outline are; those along
/// a row may bend.
fn is_dash(part: &Component, stroke_px: f64) -> bool {
    let (w, h) = (f64::from(part.bounds.width()), f64::from(part.bounds.height()));
    let length = w.hypot(h);
    let long = w.max(h) > LONG * w.min(h);
    w.max(h) > 1.5 * stroke_px && (long || (part.area as f64) < 1.45 * length * stroke_px)
}

/// Whether anything else is drawn closer to a word than `reach_px`.
fn is_crowded(
    ink: &Bits,
    parts: &Components,
    group: &[usize],
    bounds: &Box2,
    reach_px: f64,
) -> bool {
    let reach = (reach_px.ceil() as u32).max(2);
    let tall = group.iter().map(|&k| parts.parts[k].bounds.height()).max().unwrap_or(0);
    let (left, top) = (bounds.left.saturating_sub(reach), bounds.top.saturating_sub(reach));
    let right = (bounds.right + reach).min(ink.width as u32);
    let bottom = (bounds.bottom + reach).min(ink.height as u32);
    let own = |label: u32| label == 0 || group.contains(&(label as usize - 1));
    let mut others: std::collections::BTreeSet<u32> = Default::default();
    for y in top..bottom {
        let row = &parts.labels[y as usize * ink.width..];
        others.extend(row[left as usize..right as usize].iter().filter(|label| !own(**label)));
    }
    // Dots and accents are allowed.
    others.iter().any(|&label| {
        let part = &parts.parts[label as usize - 1];
        part.bounds.height().max(part.bounds.width()) * 2 > tall
    })
}

/// Small parts beside each other, of about one height and level.
fn words(small: &[usize], parts: &Components) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = small.to_vec();
    order.sort_by_key(|&k| (parts.parts[k].bounds.left, k));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for k in order {
        let own = parts.parts[k].bounds;
        let follows = |group: &Vec<usize>| {
            group.iter().rev().take(3).any(|&before| {
                let other = parts.parts[before].bounds;
                let tall = f64::from(own.height().max(other.height()));
                let low = f64::from(own.height().min(other.height()));
                let overlap =
                    i64::from(own.bottom.min(other.bottom)) - i64::from(own.top.max(other.top));
                let apart = i64::from(own.left) - i64::from(other.right);
                overlap as f64 >= 0.4 * low && low >= 0.3 * tall && apart as f64 <= PITCH * tall
            })
        };
        match groups.iter_mut().find(|group| follows(group)) {
            Some(group) => group.push(k),
            None => groups.push(vec![k]),
        }
    }
    groups
}

/// The outermost ink of large parts in every row and column.
struct Surround {
    rows: Vec<Option<(u32, u32)>>,
    columns: Vec<Option<(u32, u32)>>,
}

impl Surround {
    fn of(ink: &Bits, parts: &Components, large: impl Fn(&Component) -> bool) -> Self {
        let is_large: Vec<bool> = parts.parts.iter().map(large).collect();
        let mut rows = vec![None; ink.height];
        let mut columns = vec![None; ink.width];
        let widen = |span: &mut Option<(u32, u32)>, at: u32| {
            *span = Some(span.map_or((at, at), |(a, b)| (a.min(at), b.max(at))));
        };
        for (index, &label) in parts.labels.iter().enumerate() {
            if label != 0 && is_large[label as usize - 1] {
                let (x, y) = (index % ink.width, index / ink.width);
                widen(&mut rows[y], x as u32);
                widen(&mut columns[x], y as u32);
            }
        }
        Self { rows, columns }
    }

    /// Whether the middle of a box has large parts on all four sides.
    fn holds(&self, place: &Box2) -> bool {
        let (x, y) = ((place.left + place.right) / 2, (place.top + place.bottom) / 2);
        let between =
            |span: &Option<(u32, u32)>, at: u32| span.is_some_and(|(a, b)| a < at && at < b);
        between(&self.rows[y as usize], x) && between(&self.columns[x as usize], y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(letters: u32, inside: bool) -> Bits {
        let mut ink = Bits::filled(240, 260, false);
        for y in 20..200 {
            for x in 60..180 {
                if (x - 60_i64).min(179 - x).min(y - 20).min(199 - y) < 2 {
                    ink.set(x, y, true);
                }
            }
        }
        for k in 0..letters {
            let (left, top) = (90 + 14 * i64::from(k), if inside { 90 } else { 225 });
            for y in 0..12 {
                ink.set(left, top + y, true);
                ink.set(left + 8, top + y, true);
            }
            (0..9).for_each(|x| ink.set(left + x, top + 6, true));
        }
        ink
    }

    #[test]
    fn a_caption_is_found_and_what_is_inside_is_not() {
        let found = find(&page(4, false), 1.0);
        assert_eq!(found.lines.len(), 1);
        assert_eq!(found.lines[0].width(), 51);
        assert!(find(&page(4, true), 1.0).lines.is_empty());
        assert!(find(&page(1, false), 1.0).lines.is_empty());
    }
}
