//! Which drawings are views of one subject, and what the others are.

use subject::raster::Raster;
use subject::{Box2, median};

use crate::blobs::{Blob, Blobs};
use crate::proposal::{LeftOut, LeftOutKind};
use crate::shape::{PROFILE_ROWS, Profile};

/// Drawings smaller than this are no views, share of the tallest.
const LEAST: f64 = 0.2;
/// Heights of views of one subject, as shares of their usual one.
const HEIGHTS: (f64, f64) = (0.7, 1.4);
/// Drawings of other heights that agree less are not views of one subject.
const ALIKE: f64 = 0.3;
/// Of so nearly the same height any drawings are: a chair from its side and
/// from its front have hardly a row in common.
const SAME_HEIGHT: (f64, f64) = (0.84, 1.19);
/// Drawings at least this tall are compared as views that differ in pose.
const POSE: f64 = 0.62;
/// A page with more is one of poses and details: its largest row is the turn.
const MOST: usize = 8;
/// Drawings of that row that agree less with its tallest are no views.
const ROW_ALIKE: f64 = 0.7;
/// What lies with so much of its width or height along the border is no figure.
const ON_BORDER: f64 = 0.6;
/// Every colour of a swatch is about the same, levels.
const ONE_COLOUR: f64 = 14.0;
/// A swatch fills this share of its bounds.
const FULL: f64 = 0.7;

/// Which drawings are views, and their usual height, px.
pub(crate) struct Selected {
    pub(crate) views: Vec<usize>,
    pub(crate) height: f64,
}

/// How alike two row profiles are as those of one turning subject, 0 to 1: the
/// ratio of their widths changes little from row to row.
pub(crate) fn agreement(a: &Profile, b: &Profile) -> f64 {
    let ratio = |y: usize| ((a.width(y) + 0.03) / (b.width(y) + 0.03)).ln();
    let mut ratios: Vec<f64> = (0..PROFILE_ROWS).map(ratio).collect();
    let middle = PROFILE_ROWS / 2;
    let usual = *ratios.select_nth_unstable_by(middle, f64::total_cmp).1;
    let spread = ratios.iter().map(|r| (r - usual).abs()).sum::<f64>() / PROFILE_ROWS as f64;
    (1.0 - spread).max(0.0)
}

/// Chooses the drawings that are views: the largest set of about one height
/// and with row profiles that agree.
pub(crate) fn select(blobs: &Blobs) -> Selected {
    let tallest = blobs.list.iter().map(|b| b.bounds.height()).max().unwrap_or(0);
    let height = |k: usize| f64::from(blobs.list[k].bounds.height());
    let size = (blobs.owners.width as u32, blobs.owners.height as u32);
    let large: Vec<usize> = (0..blobs.list.len())
        .filter(|&k| height(k) >= LEAST * f64::from(tallest) && !is_flat(&blobs.list[k]))
        .filter(|&k| !is_backdrop(blobs, k, size))
        .take(400)
        .collect();
    let profiles: Vec<Option<Profile>> =
        large.iter().map(|&k| Profile::of(&blobs.pixels(k, 0))).collect();
    let alike = |a: usize, b: usize| match (&profiles[a], &profiles[b]) {
        (Some(p), Some(q)) => agreement(p, q),
        _ => 0.0,
    };
    let members = |reference: usize, usual: f64| -> Vec<usize> {
        (0..large.len())
            .filter(|&k| {
                let ratio = height(large[k]) / usual;
                let same = (SAME_HEIGHT.0..=SAME_HEIGHT.1).contains(&ratio);
                let near = (HEIGHTS.0..=HEIGHTS.1).contains(&ratio);
                same || (near && alike(reference, k) >= ALIKE)
            })
            .collect()
    };
    let weight = |set: &[usize], reference: usize| -> f64 {
        set.iter().map(|&k| height(large[k]).powf(1.5) * (0.5 + alike(reference, k))).sum()
    };
    let best = (0..large.len())
        .map(|k| (k, members(k, height(large[k]))))
        .max_by(|a, b| weight(&a.1, a.0).total_cmp(&weight(&b.1, b.0)).then(b.0.cmp(&a.0)));
    let Some((reference, set)) = best else {
        return Selected { views: Vec::new(), height: 0.0 };
    };
    // Once more about the set's own middle.
    let usual = median(&set.iter().map(|&k| height(large[k])).collect::<Vec<_>>());
    let mut set = members(reference, usual);
    if set.len() > MOST {
        let boxes: Vec<Box2> = set.iter().map(|&k| blobs.list[large[k]].bounds).collect();
        let row = largest_row(&boxes);
        let lead = row.iter().copied().max_by_key(|&k| boxes[k].height()).unwrap_or(0);
        let lead = set[lead];
        let row: Vec<usize> = row.into_iter().map(|k| set[k]).collect();
        let agree: Vec<usize> =
            row.iter().copied().filter(|&k| alike(lead, k) >= ROW_ALIKE).collect();
        set = if agree.len() > 1 { agree } else { row };
    }
    let usual = median(&set.iter().map(|&k| height(large[k])).collect::<Vec<_>>());
    Selected { views: set.iter().map(|&k| large[k]).collect(), height: usual }
}

/// The boxes that stand about level with one of them, of those with the largest
/// median height.
fn largest_row(boxes: &[Box2]) -> Vec<usize> {
    let row = |of: &Box2| -> Vec<usize> {
        let shares = |b: &Box2| {
            let shared = f64::from(b.bottom.min(of.bottom)) - f64::from(b.top.max(of.top));
            let level = f64::from(b.bottom.abs_diff(of.bottom)) <= 0.13 * f64::from(of.height());
            level && shared >= 0.7 * f64::from(b.height().min(of.height()))
        };
        (0..boxes.len()).filter(|&k| shares(&boxes[k])).collect()
    };
    let weight = |row: &Vec<usize>| {
        let height = median(&row.iter().map(|&k| f64::from(boxes[k].height())).collect::<Vec<_>>());
        height * (row.len().min(MOST) as f64).sqrt()
    };
    let rows = boxes.iter().map(row);
    rows.max_by(|a, b| weight(a).total_cmp(&weight(b))).unwrap_or_default()
}

/// Whether most of a drawing's width or height lies along the page's border:
/// a shadow or a backdrop.
fn is_backdrop(blobs: &Blobs, k: usize, (width, height): (u32, u32)) -> bool {
    let b = blobs.list[k].bounds;
    let own = |x: u32, y: u32| {
        blobs.owners.data[y as usize * width as usize + x as usize] == k as u16 + 1
    };
    let along = |y: u32| (b.left..b.right).filter(|&x| own(x, y)).count() as f64;
    let down = |x: u32| (b.top..b.bottom).filter(|&y| own(x, y)).count() as f64;
    let (w, h) = (f64::from(b.width()), f64::from(b.height()));
    (b.top == 0 && along(0) >= ON_BORDER * w)
        || (b.bottom == height && along(height - 1) >= ON_BORDER * w)
        || (b.left == 0 && down(0) >= ON_BORDER * h)
        || (b.right == width && down(width - 1) >= ON_BORDER * h)
}

/// Whether a drawing is a mere line or a line of lettering.
fn is_flat(blob: &Blob) -> bool {
    let (w, h) = (blob.bounds.width(), blob.bounds.height());
    w >= 14 * h || h >= 30 * w
}

/// What each drawing that is no view is; boxes are in working px.
///
/// * `inner`: drawings that are of a view, each with the view's place.
pub(crate) fn left_out(
    blobs: &Blobs,
    selected: &Selected,
    inner: &[(usize, usize)],
    colours: &Raster<[u8; 3]>,
) -> Vec<LeftOut> {
    let profiles: Vec<Profile> =
        selected.views.iter().filter_map(|&k| Profile::of(&blobs.pixels(k, 0))).collect();
    let caption = |place: &Box2| LeftOut {
        kind: LeftOutKind::Caption,
        place: *place,
        why: "small marks of one height in a row",
    };
    let mut left: Vec<LeftOut> = blobs.words.iter().map(caption).collect();
    for (k, blob) in blobs.list.iter().enumerate() {
        if selected.views.contains(&k) || inner.iter().any(|(own, _)| *own == k) {
            continue;
        }
        let tall = f64::from(blob.bounds.height());
        let wide = f64::from(blob.bounds.width());
        let share = tall / selected.height.max(1.0);
        let (kind, why) = if share < 0.14 && wide > 1.6 * tall {
            (LeftOutKind::Caption, "low and wide, apart from the figures")
        } else if wide.min(tall) * 25.0 < wide.max(tall) {
            (LeftOutKind::Guide, "long and thin")
        } else if share < 0.5 && is_swatch(blobs, k, colours) {
            (LeftOutKind::Swatch, "a small area of one colour")
        } else if share >= POSE {
            let tall_enough = (HEIGHTS.0..=HEIGHTS.1).contains(&share);
            let why = if tall_enough {
                "as tall as the views, but of another shape"
            } else {
                "of another size than the views"
            };
            (LeftOutKind::ExtraPose, why)
        } else if share >= 0.15 && is_top(blobs, k, &profiles) {
            (LeftOutKind::Head, "smaller than the views and shaped like their upper part")
        } else {
            (LeftOutKind::Prop, "smaller than the views and of another shape")
        };
        left.push(LeftOut { kind, place: blob.bounds, why });
    }
    left.sort_by_key(|l| (l.place.top, l.place.left, l.place.right));
    left
}

fn is_swatch(blobs: &Blobs, k: usize, colours: &Raster<[u8; 3]>) -> bool {
    let bits = blobs.pixels(k, 0);
    if (bits.count() as f64) < FULL * (bits.width * bits.height) as f64 {
        return false;
    }
    let inner = bits.eroded(2.5);
    let bounds = blobs.list[k].bounds;
    let width = inner.width;
    let levels = |c: usize| {
        let at = move |i: usize| {
            let (x, y) = (i % width, i / width);
            let at = (y + bounds.top as usize) * colours.width + x + bounds.left as usize;
            f64::from(colours.data[at][c])
        };
        inner.data.iter().enumerate().filter(|(_, is)| **is).map(move |(i, _)| at(i))
    };
    let count = inner.count() as f64;
    count >= 4.0
        && (0..3).all(|c| {
            let mean = levels(c).sum::<f64>() / count;
            let spread = levels(c).map(|level| (level - mean).powi(2)).sum::<f64>() / count;
            spread.sqrt() <= ONE_COLOUR
        })
}

/// Whether a drawing is like the upper part of a view, scaled up or not.
fn is_top(blobs: &Blobs, k: usize, views: &[Profile]) -> bool {
    let Some(own) = Profile::of(&blobs.pixels(k, 0)) else { return false };
    [0.15, 0.22, 0.3, 0.4].iter().any(|share| {
        views.iter().any(|view| {
            let top = view.upper(*share);
            let aspect = (own.mean_width() + 0.05) / (top.mean_width() + 0.05);
            agreement(&own, &top) >= 0.75 && (0.6..=1.6).contains(&aspect)
        })
    })
}
