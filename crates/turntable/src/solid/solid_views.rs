//! The views as the solid's stages see them.

use super::crease::InkEvidence;
use super::outline::Outline;
use super::symmetry::{Drawing, MirrorPlane};
use crate::ink;
use crate::silhouette::{Silhouette, Silhouettes};
use crate::views::ViewSet;
use frames::Azimuth;
use image::GrayImage;

/// One view, drawn or mirrored.
#[derive(Clone, Debug)]
pub(super) struct SolidView {
    pub outline: Outline,
    /// Index of the drawing in the view set.
    pub drawing: usize,
    /// For a mirrored view: columns of view and drawing add up to this, px.
    pub mirror_sum_px: Option<f64>,
    /// What the drawing's depth gains in this view, px; `None` if it says
    /// nothing here: that a profile is symmetric does not make the front like
    /// the back.
    pub depth_gain_px: Option<f64>,
}

/// Drawings as ink bits, and views of them.
pub(super) struct SolidSheet {
    pub width: usize,
    pub height: usize,
    pub axis_px: f64,
    pub origin_row_px: f64,
    /// Per drawing.
    pub azimuths: Vec<Azimuth>,
    /// Per drawing and pixel, whether it is ink.
    pub ink: Vec<Vec<bool>>,
    /// The same with gaps in lines closed, grown by two columns and one row.
    near_ink: Vec<Vec<bool>>,
    /// Per drawing, whether its outline leaves out what one sees through.
    pub has_holes: Vec<bool>,
    pub views: Vec<SolidView>,
}

impl SolidSheet {
    pub(super) fn new(views: &ViewSet, silhouettes: &Silhouettes) -> Self {
        use rayon::prelude::*;
        let axis_px = views.axis_px();
        let (width, height) = (views.width() as usize, views.height() as usize);
        let ink: Vec<Vec<bool>> =
            views.views().par_iter().map(|view| ink::inked(&view.image)).collect();
        let near_ink = ink
            .par_iter()
            .zip(&silhouettes.silhouettes)
            .map(|(ink, silhouette)| near(ink, silhouette, width))
            .collect();
        let outlines = silhouettes.silhouettes.par_iter();
        let solid_views = outlines.enumerate().map(|(drawing, silhouette)| SolidView {
            outline: Outline::from_silhouette(silhouette, axis_px),
            drawing,
            mirror_sum_px: None,
            depth_gain_px: Some(0.0),
        });
        Self {
            width,
            height,
            axis_px,
            origin_row_px: views.origin_row_px(),
            azimuths: views.azimuths().collect(),
            views: solid_views.collect(),
            ink,
            near_ink,
            has_holes: views.views().iter().map(|view| view.mask_has_holes).collect(),
        }
    }

    /// The drawings, for finding a mirror plane.
    pub(super) fn drawings(&self) -> Vec<Drawing<'_>> {
        self.views
            .iter()
            .map(|view| Drawing {
                outline: &view.outline,
                ink: &self.ink[view.drawing],
                width: self.width,
                axis_px: self.axis_px,
            })
            .collect()
    }

    /// Per pixel of a drawing, whether there is ink within two columns and one row.
    pub(super) fn near_ink(&self, drawing: usize) -> &[bool] {
        &self.near_ink[drawing]
    }

    /// Every view's mirror image at azimuths that are not drawn.
    pub(super) fn mirrored(&self, plane: &MirrorPlane) -> Vec<SolidView> {
        let same = |a: f64, b: f64| (a - b).sin().abs() < 1e-3 && (a - b).cos() > 0.0;
        let mut images: Vec<SolidView> = Vec::new();
        for view in &self.views {
            let own_rad = view.outline.azimuth_rad;
            let azimuth_rad = plane.azimuth_rad(own_rad);
            let mut known = self.views.iter().chain(&images);
            if known.any(|view| same(view.outline.azimuth_rad, azimuth_rad)) {
                continue;
            }
            let sum_px = plane.column_sum_px(own_rad);
            images.push(SolidView {
                outline: view.outline.mirrored(azimuth_rad, sum_px),
                drawing: view.drawing,
                mirror_sum_px: Some(sum_px),
                depth_gain_px: plane.left_right.then(|| plane.depth_gain_px(own_rad)),
            });
        }
        images
    }

    /// What each view tells about creases.
    pub(super) fn ink_evidence(&self) -> Vec<InkEvidence<'_>> {
        self.views
            .iter()
            .map(|view| InkEvidence {
                outline: &view.outline,
                near_ink: &self.near_ink[view.drawing],
                width: self.width,
                axis_px: self.axis_px,
                mirror_sum_px: view.mirror_sum_px,
            })
            .collect()
    }

    /// One outline per direction: the first of those that look along one line.
    pub(super) fn directions(&self) -> Vec<Outline> {
        directions_of(&self.views)
    }
}

/// One outline per direction: the first of those that look along one line.
pub(super) fn directions_of<'a>(views: impl IntoIterator<Item = &'a SolidView>) -> Vec<Outline> {
    distinct(views.into_iter().map(|view| view.outline.clone()))
}

/// The first of those outlines that look along one line.
pub(super) fn distinct(outlines: impl Iterator<Item = Outline>) -> Vec<Outline> {
    let mut directions: Vec<Outline> = Vec::new();
    for outline in outlines {
        if !directions.iter().any(|other| other.is_parallel_to(&outline)) {
            directions.push(outline);
        }
    }
    directions
}

/// Per pixel of a drawing, whether there is ink within two columns and one row, gaps in lines being
/// closed.
pub(super) fn near_ink(image: &GrayImage, silhouette: &Silhouette) -> Vec<bool> {
    near(&ink::inked(image), silhouette, image.width() as usize)
}

fn near(ink: &[bool], silhouette: &Silhouette, width: usize) -> Vec<bool> {
    let mut closed = ink.to_vec();
    silhouette.bridges().iter().for_each(|&index| closed[index] = true);
    grown(&closed, width, 2, 1)
}

/// `bits` dilated by `columns` and `rows` to each side.
fn grown(bits: &[bool], width: usize, columns: usize, rows: usize) -> Vec<bool> {
    let height = bits.len() / width.max(1);
    let mut wide = vec![false; bits.len()];
    for (row, out) in bits.chunks_exact(width).zip(wide.chunks_exact_mut(width)) {
        for (x, _) in row.iter().enumerate().filter(|(_, ink)| **ink) {
            out[x.saturating_sub(columns)..(x + columns + 1).min(width)].fill(true);
        }
    }
    let mut tall = wide.clone();
    for y in 0..height {
        let out = &mut tall[y * width..(y + 1) * width];
        for near in y.saturating_sub(rows)..(y + rows + 1).min(height) {
            let near = &wide[near * width..(near + 1) * width];
            out.iter_mut().zip(near).for_each(|(out, near)| *out |= near);
        }
    }
    tall
}
