//! The options of imperfect drawings, and their presets.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::degrade::Degradation;

/// Imperfections as in drawings by hand. A preset gives all values; any of them can be set alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DegradeOptions {
    /// Where unset values come from; none: no imperfection.
    pub preset: Option<DegradePreset>,
    /// The same seed gives the same imperfections.
    pub seed: u64,
    /// Root mean square deviation of lines, pixels.
    #[schemars(range(min = 0, max = 20))]
    pub wobble_rms_px: Option<f64>,
    /// Length of a wave of the lines' wobble, pixels.
    #[schemars(range(min = 4, max = 1000))]
    pub wobble_wavelength_px: Option<f64>,
    /// Share of the lines' length that is missing in gaps.
    #[schemars(range(min = 0, max = 0.9))]
    pub gap_share: Option<f64>,
    /// Smallest line width, pixels.
    #[schemars(range(min = 0.1, max = 32))]
    pub width_min_px: Option<f64>,
    /// Largest line width, pixels.
    #[schemars(range(min = 0.1, max = 32))]
    pub width_max_px: Option<f64>,
    /// Lightness of the lines: 0 is black ink, 0.6 a hard pencil.
    #[schemars(range(min = 0, max = 0.9))]
    pub pencil_lightness: Option<f64>,
    /// Standard deviation of the paper's texture, share of the grey range.
    #[schemars(range(min = 0, max = 0.5))]
    pub paper_texture: Option<f64>,
    /// Largest error of a view's scale, share.
    #[schemars(range(min = 0, max = 0.2))]
    pub scale_error: Option<f64>,
    /// Largest shift of a view, pixels, horizontally and vertically.
    #[schemars(range(min = 0, max = 100))]
    pub shift_px: Option<f64>,
    /// Largest error of a view's azimuth, degrees.
    #[schemars(range(min = 0, max = 20))]
    pub azimuth_error_deg: Option<f64>,
    /// Share of the strokes inside the outline that are missing.
    #[schemars(range(min = 0, max = 1))]
    pub missing_interior: Option<f64>,
    /// Quality of a JPEG compression that the drawing goes through; 0 for none.
    #[schemars(range(min = 0, max = 100))]
    pub jpeg_quality: Option<u8>,
}

/// How imperfect drawings are: middle, half of that, or double.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "the schema describes it")]
pub enum DegradePreset {
    Light,
    Middle,
    Heavy,
}

impl DegradeOptions {
    /// All values as `preset` has them, random from `seed`.
    pub fn preset(preset: DegradePreset, seed: u64) -> Self {
        Self { preset: Some(preset), seed, ..Self::default() }
    }

    /// The values that apply; `None` if the drawing stays as it is.
    ///
    /// * `line_width_px`: what widths vary about.
    pub fn resolved(&self, line_width_px: f64) -> Option<Degradation> {
        let strength: f64 = match self.preset {
            None => 0.0,
            Some(DegradePreset::Light) => 0.5,
            Some(DegradePreset::Middle) => 1.0,
            Some(DegradePreset::Heavy) => 2.0,
        };
        let jpeg_quality = match self.preset {
            None => 0,
            Some(_) => (100.0 - 25.0 * strength).round() as u8,
        };
        let thinnest = (line_width_px * (1.0 - strength / 3.0)).max(0.1);
        let degradation = Degradation {
            wobble_rms_px: self.wobble_rms_px.unwrap_or(strength),
            wobble_wavelength_px: self.wobble_wavelength_px.unwrap_or(40.0),
            gap_share: self.gap_share.unwrap_or(0.02 * strength),
            width_min_px: self.width_min_px.unwrap_or(thinnest),
            width_max_px: self.width_max_px.unwrap_or(line_width_px * (1.0 + strength * 2.0 / 3.0)),
            pencil_lightness: self.pencil_lightness.unwrap_or(0.3 * strength),
            paper_texture: self.paper_texture.unwrap_or(0.015 * strength),
            scale_error: self.scale_error.unwrap_or(0.02 * strength),
            shift_px: self.shift_px.unwrap_or(3.0 * strength),
            azimuth_error_deg: self.azimuth_error_deg.unwrap_or(2.0 * strength),
            missing_interior: self.missing_interior.unwrap_or(0.2 * strength),
            jpeg_quality: self.jpeg_quality.unwrap_or(jpeg_quality),
        };
        (degradation != Degradation::none(line_width_px)).then_some(degradation)
    }
}
