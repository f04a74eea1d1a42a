//! What depth stages hand to the solid: a depth a pixel and what it rests on.

use image::GrayImage;
use picture::FloatImage;

/// What a pixel's depth rests on, as stored in [`DepthMap::confidence`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Confidence {
    /// No surface here.
    Outside = 0,
    /// Carried on from lines farther off.
    Guessed = 1,
    /// At the visual hull's bound.
    Hull = 2,
    /// At a line that several views agree on.
    Lines = 3,
}

/// A view's depth and what it rests on.
#[derive(Clone, Debug)]
pub struct DepthMap {
    /// Depth along the view direction from the axis plane in the turntable
    /// frame, px, growing away from the camera; NaN outside the silhouette.
    pub depth_px: FloatImage,
    /// [`Confidence`] per pixel.
    pub confidence: GrayImage,
}
