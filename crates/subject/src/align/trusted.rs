//! Where a view can be trusted: not where a limb or a prop that the others
//! show is missing from it.

use image::{GrayImage, Luma};

use super::profile::{Profile, ROWS, Rows};
use super::section::{NOISE_PX, Section, strips};
use super::{Aligned, Alignment};

/// What a view takes from the others must be at least this wide, share of the
/// figure's height.
const LEAST_LIMB: f64 = 0.03;
/// Leaving out a view that is at fault explains the rest this much better.
const BETTER: f64 = 0.35;
/// So many rows in turn make a limb, of [`ROWS`].
const LEAST_RUN: usize = 2;

/// Per view of the canvas' size, 255 where the view can be trusted and 0 where
/// others show the subject and it shows paper, or where its paper would cut off
/// what several others agree on. In the views' order.
///
/// In a row, every view's extent must be the shadow of one common section. If
/// it is not, the view is at fault without which the others' extents are
/// explained; of two opposite views that differ it is the narrower one.
pub fn trust(alignment: &Alignment, aligned: &[Aligned]) -> Vec<GrayImage> {
    let canvas = &alignment.canvas;
    let (top, height) = (canvas.rows[0], (canvas.rows[1] - canvas.rows[0]).max(1.0));
    let azimuths: Vec<f64> = alignment.views.iter().map(|view| view.azimuth_deg).collect();
    let profiles: Vec<Profile> = aligned.iter().map(|view| Profile::of(&view.mask)).collect();
    let rows: Vec<Rows> =
        profiles.iter().map(|p| p.sampled(top, height, canvas.axis_x, 1.0)).collect();
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
        let mut map = GrayImage::from_pixel(canvas.width, canvas.height, Luma([255]));
        let step = height / ROWS as f64;
        for (y, span) in runs(faults) {
            let (from, to) = (top + y as f64 * step, top + (y as f64 + 1.0) * step);
            let (left, right) = (span.0 + canvas.axis_x, span.1 + canvas.axis_x);
            for v in from.floor().max(0.0) as u32..(to.ceil() as u32).min(canvas.height) {
                for u in
                    left.floor().max(0.0) as u32..(right.ceil().max(0.0) as u32).min(canvas.width)
                {
                    if aligned[view].mask.get_pixel(u, v).0[0] < 128 {
                        map.put_pixel(u, v, Luma([0]));
                    }
                }
            }
        }
        map
    };
    faults.iter().enumerate().map(map).collect()
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
        let of_strip = |strip: &(f64, f64, f64)| match section.shadow(strip.0) {
            None => strip.2 - strip.1,
            Some((a, b)) => (a - strip.1).max(0.0) + (strip.2 - b).max(0.0),
        };
        (shown.iter().map(of_strip).sum::<f64>(), section, shown.len())
    };
    let (base, _, shown) = missing(None);
    if base < least_px || shown < 3 {
        return None;
    }
    let mut best: Option<(f64, usize, (f64, f64))> = None;
    for k in 0..all.len() {
        let Some((_, left, right)) = all[k] else { continue };
        let (rest, section, _) = missing(Some(k));
        let Some((a, b)) = section.shadow(azimuths_deg[k]) else { continue };
        // Only a view that shows less than the others allow cuts them.
        let wider = (left - a).max(0.0) + (b - right).max(0.0);
        let gain = base - rest;
        let explains = rest <= BETTER * base && wider >= least_px;
        if explains && best.as_ref().is_none_or(|(most, ..)| gain > *most) {
            best = Some((
                gain,
                k,
                (a.max(left - 2.0 * (right - left)), b.min(right + 2.0 * (right - left))),
            ));
        }
    }
    best.map(|(_, view, span)| (view, span))
}
