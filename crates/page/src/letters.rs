//! Lettering: small parts of about one size beside each other, level or turned
//! by a right angle.

use subject::Box2;
use subject::raster::Component;

/// The tallest letter, share of the figures' height.
const TALLEST: f64 = 0.14;
/// The next letter is within so many letter heights.
const PITCH: f64 = 1.5;
/// Letters of a word.
const LEAST_LETTERS: usize = 3;
/// A part longer than so many times its width is a dash.
const DASH: f64 = 3.5;

/// Lettering among parts.
pub(crate) struct Lettering {
    /// Per part whether it is a letter.
    pub(crate) is_letter: Vec<bool>,
    /// The bounds of each word or line.
    pub(crate) words: Vec<Box2>,
}

/// Finds words among `parts`, given the figures' height `size` in px.
pub(crate) fn find(parts: &[Component], size: f64) -> Lettering {
    let mut found = Lettering { is_letter: vec![false; parts.len()], words: Vec::new() };
    let tallest = (TALLEST * size).max(6.0);
    let small: Vec<usize> = (0..parts.len())
        .filter(|&k| {
            let b = parts[k].bounds;
            let side = f64::from(b.height().max(b.width()));
            side <= 1.6 * tallest && f64::from(b.height().min(b.width())) <= tallest && side >= 3.0
        })
        .collect();
    for upright in [false, true] {
        for word in words(&small, parts, upright) {
            if word.iter().any(|&k| found.is_letter[k]) || !is_word(&word, parts, upright) {
                continue;
            }
            word.iter().for_each(|&k| found.is_letter[k] = true);
            let bounds = word.iter().map(|&k| parts[k].bounds).reduce(|a, b| a.joined(&b));
            found.words.extend(bounds);
        }
    }
    // Dots and accents go with the words.
    for &k in &small {
        let own = parts[k].bounds;
        found.is_letter[k] |= found.words.iter().any(|word| {
            let reach = word.height().min(word.width()) / 2 + 1;
            own.left + reach >= word.left
                && own.right <= word.right + reach
                && own.top + reach >= word.top
                && own.bottom <= word.bottom + reach
        });
    }
    found
}

/// A box in the direction of reading: along from and to, across from and to.
fn turned(b: &Box2, upright: bool) -> [f64; 4] {
    let [l, t, r, o] = [b.left, b.top, b.right, b.bottom].map(f64::from);
    if upright { [t, o, l, r] } else { [l, r, t, o] }
}

fn words(small: &[usize], parts: &[Component], upright: bool) -> Vec<Vec<usize>> {
    let place = |k: usize| turned(&parts[k].bounds, upright);
    let mut order = small.to_vec();
    order.sort_by(|&a, &b| place(a)[0].total_cmp(&place(b)[0]).then(a.cmp(&b)));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    // Only words that can still go on are looked at.
    let mut open: Vec<usize> = Vec::new();
    let reach = order.iter().map(|&k| place(k)[3] - place(k)[2]).fold(0.0, f64::max) * PITCH;
    for k in order {
        let own = place(k);
        open.retain(|&g: &usize| {
            groups[g].iter().any(|&before| place(before)[1] + reach >= own[0])
        });
        let follows = |group: &Vec<usize>| {
            group.iter().rev().take(3).any(|&before| {
                let other = place(before);
                let (a, b) = (own[3] - own[2], other[3] - other[2]);
                let (low, tall) = (a.min(b), a.max(b));
                let overlap = own[3].min(other[3]) - own[2].max(other[2]);
                overlap >= 0.5 * low && low >= 0.4 * tall && own[0] - other[1] <= PITCH * tall
            })
        };
        match open.iter().copied().find(|&g| follows(&groups[g])) {
            Some(g) => groups[g].push(k),
            None => {
                open.push(groups.len());
                groups.push(vec![k]);
            }
        }
    }
    groups
}

fn is_word(word: &[usize], parts: &[Component], upright: bool) -> bool {
    if word.len() < LEAST_LETTERS {
        return false;
    }
    let sides = |k: usize| {
        let [a, b, c, d] = turned(&parts[k].bounds, upright);
        (b - a, d - c)
    };
    let tall = word.iter().map(|&k| sides(k).1).fold(0.0, f64::max);
    // Most letters are of one height, and few are mere dashes along the line.
    let even = word.iter().filter(|&&k| sides(k).1 >= 0.6 * tall).count();
    let dashes = word.iter().filter(|&&k| sides(k).0 > DASH * sides(k).1).count();
    let round = word.iter().filter(|&&k| sides(k).0 <= 1.6 * tall).count();
    even * 3 >= word.len() * 2 && dashes * 3 < word.len() && round * 4 >= word.len() * 3
}
