//! What few drawings leave open, by a network trained on random shapes and models.
//!
//! The visual hull of three drawings joins arms and body; who has seen figures
//! sees two arms. The network is trained on procedurally generated subjects
//! and on models; it tells, from 2 to 8 line drawings at known azimuths, how likely each
//! place in the hull is inside the subject.
//!
//! | stage | what it does |
//! |---|---|
//! | [`grid`](Grid) | about 64^3 voxels about the hull |
//! | sampling | drawings at 4 px a voxel: ink and filled outline |
//! | encoder | a two-dimensional U-Net, 24 features a voxel row and column of each view; `convolution` says why it is ours |
//! | lifting | each voxel takes the features of the columns that show it |
//! | volume | a three-dimensional U-Net over the views' mean and maximum; logits at twice the grid |
//!
//! The frame is the turntable frame in drawing pixels: Z up, X right and Y away
//! from the viewer at azimuth 0, the origin on the axis at `origin_row_px`.
//!
//! `weights/CARD.md` says where the weights come from.

mod choice;
mod convolution;
mod field;
mod grid;
mod lifting;
mod network;
mod sampling;
mod tensor;
mod weights;

pub use field::LogitField;
pub use grid::Grid;

use progress::{Cancelled, Observer};
use rayon::prelude::*;
use tensor::Tensor;

/// The most views that the network takes at once; of more it takes those that
/// are spread best.
pub const MAX_VIEWS: usize = 8;
/// The fewest views that bound anything.
pub const MIN_VIEWS: usize = 2;

/// One drawing, row by row, each value 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct PriorView<'a> {
    /// The turntable azimuth, radians.
    pub azimuth_rad: f64,
    /// How far each pixel is covered by the subject.
    pub mask: &'a [f32],
    /// How dark each pixel is.
    pub ink: &'a [f32],
}

/// Drawings of one size.
#[derive(Clone, Debug)]
pub struct PriorInput<'a> {
    /// At least [`MIN_VIEWS`].
    pub views: Vec<PriorView<'a>>,
    /// Columns and rows of every drawing, px.
    pub size: (usize, usize),
    /// The turntable axis' column, px from the left border.
    pub axis_px: f64,
    /// The row of the frame's origin, px from the upper border.
    pub origin_row_px: f64,
    /// Where all views look along one line, how far from the axis the subject may
    /// reach along it, px.
    pub half_depth_px: Option<f64>,
}

/// Why there are no logits.
#[derive(Debug, thiserror::Error)]
pub enum PriorError {
    /// Too few views bound nothing.
    #[error("the prior takes at least {MIN_VIEWS} views, found {found}")]
    TooFewViews {
        /// Views that were given.
        found: usize,
    },
    /// A drawing's pixels do not fill its size.
    #[error("a drawing has {found} pixels where {expected} are expected")]
    SizeDiffers {
        /// Pixels that were given.
        found: usize,
        /// Columns times rows.
        expected: usize,
    },
    /// The outlines share nothing.
    #[error("nothing is inside all outlines")]
    EmptyHull,
    /// A layer's weights are missing or have another shape.
    #[error("the network's weights do not fit: {0}")]
    Weights(String),
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The network with its weights.
pub struct Prior {
    encoder: network::Encoder,
    volume: network::Volume,
}

impl Prior {
    /// Reads the weights that are part of this crate.
    ///
    /// # Errors
    /// [`PriorError::Weights`] if they cannot be read.
    pub fn load() -> Result<Self, PriorError> {
        network::load().map(|(encoder, volume)| Self { encoder, volume })
    }

    /// Logits of being inside the subject, on a grid about the hull.
    ///
    /// Uses rayon's current pool; the result depends neither on its size nor on
    /// the processor. `observer` is asked between the networks' blocks.
    ///
    /// # Errors
    /// [`PriorError`] for drawings that bound nothing and if `observer` says so.
    pub fn occupancy(
        &self,
        input: &PriorInput<'_>,
        observer: &dyn Observer,
    ) -> Result<LogitField, PriorError> {
        self.within(input, grid::BUDGET, observer)
    }

    /// As [`occupancy`](Self::occupancy), on a grid of about so many voxels.
    fn within(
        &self,
        input: &PriorInput<'_>,
        voxels: f64,
        observer: &dyn Observer,
    ) -> Result<LogitField, PriorError> {
        check(input)?;
        let azimuths: Vec<f64> = input.views.iter().map(|view| view.azimuth_rad).collect();
        let chosen = choice::best_spread(&azimuths, MAX_VIEWS);
        let views: Vec<PriorView<'_>> =
            chosen.into_iter().map(|index| input.views[index]).collect();
        let input = PriorInput { views, ..*input };
        let grid = Grid::around(&input, voxels).ok_or(PriorError::EmptyHull)?;
        let images: Vec<sampling::Sampled> =
            input.views.par_iter().map(|view| sampling::sampled(&input, view, &grid)).collect();
        // Views one after the other: each takes all threads.
        let features: Vec<Tensor> = images
            .iter()
            .map(|image| self.encoder.features(image, observer))
            .collect::<Result<_, PriorError>>()?;
        let azimuths: Vec<f64> = input.views.iter().map(|view| view.azimuth_rad).collect();
        let masks: Vec<&[f32]> = images.iter().map(|image| image.mask()).collect();
        observer.check()?;
        let joined = lifting::joined(&self.volume.fusion, &features, &azimuths, &masks, &grid);
        drop((features, images));
        let logits = self.volume.logits(&joined, observer)?;
        Ok(LogitField::new(grid, &logits))
    }
}

fn check(input: &PriorInput<'_>) -> Result<(), PriorError> {
    let found = input.views.len();
    if found < MIN_VIEWS {
        return Err(PriorError::TooFewViews { found });
    }
    let expected = input.size.0 * input.size.1;
    let sizes = input.views.iter().flat_map(|view| [view.mask.len(), view.ink.len()]);
    match sizes.into_iter().find(|&found| found != expected) {
        Some(found) => Err(PriorError::SizeDiffers { found, expected }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
