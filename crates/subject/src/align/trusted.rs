//! Where a view can be trusted: not where a limb or a prop that the others
//! show is missing from it.

use image::{GrayImage, Luma};

use super::Alignment;
use super::profile::{Profile, ROWS, Rows};
use super::section::{NOISE_PX, Section, strips};

/// What a view takes from the others must be at least this wide, share of the
/// figure's height.
const LEAST_LIMB: f64 = 0.03;
/// Leaving out a view that is at fault explains the rest this much better.
const BETTER: f64 = 0.35;
/// What may be cut of the view at fault itself, share of all that is cut.
const OWN_SHARE: f64 = 0.2;
/// So many rows in turn make a limb, of [`ROWS`].
const LEAST_RUN: usize = 2;

/// Per view, 255 where it can be trusted and 0 where others show the subject and
/// it shows paper, so that its paper would cut off what several others agree on;
/// `None` if it can be trusted all over. In the views' order.
///
/// In a row, every view's extent must be the shadow of one common section. If
/// it is not, the view is at fault without which the others' extents are
/// explained, or the only one that shows nothing there.
///
/// * `masks`: of each view, on the canvas or, with `laid` off, as it was drawn.
pub fn trust(alignment: &Alignment, masks: &[&GrayImage], laid: bool) -> Vec<Option<GrayImage>> {
    let canvas = &alignment.canvas;
    let height = (canvas.rows[1] - canvas.rows[0]).max(1.0);
    let frames: Vec<Frame> = alignment
        .views
        .iter()
        .map(|view| {
            let transform = if laid { super::Transform::IDENTITY } else { view.transform };
            Frame {
                axis: if laid { canvas.axis_x } else { view.axis_x },
                top: (canvas.rows[0] - transform.dy) / transform.scale,
                scale: transform.scale,
            }
        })
        .collect();
    let azimuths: Vec<f64> = alignment.views.iter().map(|view| view.azimuth_deg).collect();
    let rows: Vec<Rows> = masks
        .iter()
        .zip(&frames)
        .map(|(mask, f)| Profile::of(mask).sampled(f.top, height / f.scale, f.axis, f.scale))
        .collect();
    let mut faults: Vec<Vec<Option<(f64, f64)>>> = vec![vec![None; ROWS]; rows.len()];
    let none = vec![0.0; rows.len()];
    let found = (0..ROWS).filter_map(|y| {
        let all = strips(&azimuths, &rows, &none, y, NOISE_PX);
        Some((y, fault(&azimuths, &all, LEAST_LIMB * height)?))
    });
    for (y, (view, span)) in found {
        faults[view][y] = Some(span);
    }
    let map = |(view, faults): (usize, &Vec<Option<(f64, f64)>>)| {
        let runs = runs(faults);
        let (mask, frame) = (masks[view], &frames[view]);
        let mut map = GrayImage::from_pixel(mask.width(), mask.height(), Luma([255]));
        let step = height / frame.scale / ROWS as f64;
        let mut doubted = false;
        for &(y, span) in &runs {
            let (from, to) = (frame.top + y as f64 * step, frame.top + (y as f64 + 1.0) * step);
            let column = |u: f64| u / frame.scale + frame.axis;
            let columns = column(span.0).floor().max(0.0) as u32
                ..(column(span.1).ceil().max(0.0) as u32).min(mask.width());
            for v in from.floor().max(0.0) as u32..(to.ceil().max(0.0) as u32).min(mask.height()) {
                for u in columns.clone().filter(|&u| mask.get_pixel(u, v).0[0] < 128) {
                    map.put_pixel(u, v, Luma([0]));
                    doubted = true;
                }
            }
        }
        doubted.then_some(map)
    };
    faults.iter().enumerate().map(map).collect()
}

/// Where the subject lies in a view: its axis' column, its first row, and canvas
/// pixels per view pixel.
struct Frame {
    axis: f64,
    top: f64,
    scale: f64,
}

/// Faulty rows that have faulty neighbours.
fn runs(faults: &[Option<(f64, f64)>]) -> Vec<(usize, (f64, f64))> {
    let mut kept = Vec::new();
    let mut run: Vec<(usize, (f64, f64))> = Vec::new();
    for (y, fault) in faults.iter().enumerate() {
        match fault {
            Some(span) => run.push((y, *span)),
            None => {
                if run.len() >= LEAST_RUN {
                    kept.append(&mut run);
                }
                run.clear();
            }
        }
    }
    if run.len() >= LEAST_RUN {
        kept.append(&mut run);
    }
    kept
}

/// The view at fault in a row, and the columns in which the others show the
/// subject, px from the axis.
fn fault(
    azimuths_deg: &[f64],
    all: &[Option<(f64, f64, f64)>],
    least_px: f64,
) -> Option<(usize, (f64, f64))> {
    let missing = |without: Option<usize>| {
        let shown: Vec<_> =
            (0..all.len()).filter(|k| Some(*k) != without).filter_map(|k| all[k]).collect();
        let section = Section::within(&shown);
        (shown.iter().map(|strip| section.beyond(strip, 0.0)).sum::<f64>(), section, shown.len())
    };
    let (base, whole, shown) = missing(None);
    let mut absent = (0..all.len()).filter(|k| all[*k].is_none());
    if let (Some(view), None) = (absent.next(), absent.next())
        && shown >= 2
        && base < least_px
    {
        return Some((view, whole.shadow(azimuths_deg[view])?));
    }
    if base < least_px || shown < 3 {
        return None;
    }
    let mut best = None;
    for k in 0..all.len() {
        let Some(own @ (_, left, right)) = all[k] else { continue };
        let (rest, section, _) = missing(Some(k));
        let Some((a, b)) = section.shadow(azimuths_deg[k]) else { continue };
        // Only a view that shows less than the others allow cuts them, and is
        // itself not cut.
        let wider = (left - a).max(0.0) + (b - right).max(0.0);
        let cuts = whole.beyond(&own, 0.0) <= OWN_SHARE * base;
        if rest > BETTER * base || wider < least_px || !cuts {
            continue;
        }
        // Two views that could be at fault: nobody knows which.
        if best.is_some() {
            return None;
        }
        let width = right - left;
        best = Some((k, (a.max(left - 2.0 * width), b.min(right + 2.0 * width))));
    }
    best
}
