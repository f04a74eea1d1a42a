//! Options of keypoints, descriptors and matches.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Corner or blob detector (Arys 2020, §2.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detector {
    /// Corners: a bright or dark arc about the pixel (Rosten & Drummond 2006).
    Fast,
    /// FAST corners over a pyramid, with orientation (Rublee et al. 2011).
    Orb,
    /// Corners by determinant and trace of the gradients' scatter (1988).
    Harris,
    /// Corners by the smaller eigenvalue of the gradients' scatter (1994).
    #[default]
    ShiTomasi,
    /// Blobs: extrema of differences of Gaussians (Lowe 2004).
    Sift,
    /// Blobs: maxima of the Hessian's determinant (Bay et al. 2008).
    Surf,
}

/// Keypoint descriptor (Arys 2020, §2.2.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Descriptor {
    /// Rotated BRIEF, 256 bits, compared by Hamming distance.
    #[default]
    Orb,
    /// 128 values, compared by Euclidean distance.
    Sift,
    /// 64 values, compared by Euclidean distance.
    Surf,
}

/// Which keypoints are found and how they are described (Arys 2020, table 4.3).
///
/// Every detector goes with every descriptor, but SIFT's points with ORB's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct DetectionOptions {
    pub detector: Detector,
    pub descriptor: Descriptor,
    pub fast: FastOptions,
    pub orb: OrbOptions,
    pub harris: HarrisOptions,
    pub shi_tomasi: ShiTomasiOptions,
    pub sift: SiftOptions,
    pub surf: SurfOptions,
}

/// FAST corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FastOptions {
    /// Grey levels by which the ring must differ from the centre.
    #[schemars(range(min = 1, max = 254))]
    pub threshold: i32,
}

impl Default for FastOptions {
    fn default() -> Self {
        Self { threshold: 38 }
    }
}

/// ORB as a detector; as a descriptor of other detectors' points it runs with
/// OpenCV's defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OrbOptions {
    /// The most keypoints kept.
    #[schemars(range(min = 8, max = 100000))]
    pub max_features: i32,
    /// Ratio between neighbouring pyramid levels.
    #[schemars(range(min = 1.01, max = 2.0))]
    pub scale_factor: f32,
    /// Pyramid levels.
    #[schemars(range(min = 1, max = 32))]
    pub levels: i32,
    /// The level that holds the picture as it is.
    #[schemars(range(min = 0, max = 31))]
    pub first_level: i32,
    /// Descriptor patch, px.
    #[schemars(range(min = 5, max = 255))]
    pub patch_size_px: i32,
    /// Border without keypoints, px.
    #[schemars(range(min = 2, max = 255))]
    pub edge_threshold_px: i32,
    /// FAST threshold, grey levels.
    #[schemars(range(min = 1, max = 254))]
    pub fast_threshold: i32,
}

impl Default for OrbOptions {
    fn default() -> Self {
        Self {
            max_features: 450,
            scale_factor: 1.125,
            levels: 14,
            first_level: 0,
            patch_size_px: 37,
            edge_threshold_px: 37,
            fast_threshold: 6,
        }
    }
}

/// Harris corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HarrisOptions {
    /// The most corners kept.
    #[schemars(range(min = 8, max = 100000))]
    pub max_corners: i32,
    /// The least accepted quality, as a share of the best corner's.
    #[schemars(range(min = 0.000001, max = 1.0))]
    pub quality: f64,
    /// The least distance between corners, px.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub min_distance_px: f64,
    /// Window over which gradients are summed, px.
    #[schemars(range(min = 1, max = 101))]
    pub block_size_px: i32,
    /// Sobel aperture, px (1, 3, 5 or 7).
    #[schemars(range(min = 1, max = 7))]
    pub gradient_size_px: i32,
    /// Harris' free parameter.
    #[schemars(range(min = 0.0, max = 0.25))]
    pub k: f64,
}

impl Default for HarrisOptions {
    fn default() -> Self {
        Self {
            max_corners: 1000,
            quality: 0.011,
            min_distance_px: 3.0,
            block_size_px: 6,
            gradient_size_px: 7,
            k: 0.04,
        }
    }
}

/// Shi-Tomasi corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ShiTomasiOptions {
    /// The most corners kept.
    #[schemars(range(min = 8, max = 100000))]
    pub max_corners: i32,
    /// The least accepted quality, as a share of the best corner's.
    #[schemars(range(min = 0.000001, max = 1.0))]
    pub quality: f64,
    /// The least distance between corners, px.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub min_distance_px: f64,
    /// Window over which gradients are summed, px.
    #[schemars(range(min = 1, max = 101))]
    pub block_size_px: i32,
    /// Sobel aperture, px (1, 3, 5 or 7).
    #[schemars(range(min = 1, max = 7))]
    pub gradient_size_px: i32,
}

impl Default for ShiTomasiOptions {
    fn default() -> Self {
        Self {
            max_corners: 1000,
            quality: 0.1,
            min_distance_px: 2.0,
            block_size_px: 11,
            gradient_size_px: 7,
        }
    }
}

/// SIFT keypoints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SiftOptions {
    /// The most keypoints kept.
    #[schemars(range(min = 8, max = 100000))]
    pub max_features: i32,
    /// Layers an octave.
    #[schemars(range(min = 1, max = 16))]
    pub octave_layers: i32,
    /// Weaker extrema are dropped.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub contrast_threshold: f64,
    /// More edge-like extrema are dropped.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub edge_threshold: f64,
    /// Blur of the first octave, px.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub sigma_px: f64,
}

impl Default for SiftOptions {
    fn default() -> Self {
        Self {
            max_features: 1000,
            octave_layers: 3,
            contrast_threshold: 0.15,
            edge_threshold: 22.0,
            sigma_px: 1.6,
        }
    }
}

/// SURF keypoints, and how SURF describes any detector's points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SurfOptions {
    /// The least determinant of the Hessian, of 8-bit grey levels and filters
    /// normalised by their boxes' areas, as OpenCV counts.
    #[schemars(range(min = 0.0, max = 1_000_000.0))]
    pub hessian_threshold: f64,
    /// Octaves: how often sampling step and filter size double, and one.
    #[schemars(range(min = 1, max = 8))]
    pub octaves: u32,
    /// Scales an octave in which blobs are found.
    #[schemars(range(min = 1, max = 16))]
    pub octave_layers: u32,
    /// Leave out the orientation: faster, for pictures that are not rotated.
    pub upright: bool,
}

impl Default for SurfOptions {
    fn default() -> Self {
        Self { hessian_threshold: 1000.0, octaves: 2, octave_layers: 4, upright: false }
    }
}

/// How the nearest descriptors are searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Matcher {
    /// Every descriptor against every other: exact.
    #[default]
    BruteForce,
    /// Approximate: randomised k-d trees for values, locality-sensitive hashing
    /// for bits (Muja & Lowe 2009).
    Flann,
}

/// The approximate search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FlannOptions {
    /// Randomised k-d trees searched together (SIFT and SURF descriptors).
    #[schemars(range(min = 1, max = 64))]
    pub trees: i32,
    /// Leaves of the k-d trees looked at: more are slower and more exact.
    #[schemars(range(min = 1, max = 100000))]
    pub checks: i32,
    /// Hash tables (ORB descriptors).
    #[schemars(range(min = 1, max = 64))]
    pub tables: i32,
    /// Bits of a hash key.
    #[schemars(range(min = 1, max = 24))]
    pub key_bits: i32,
    /// Keys this many bits away are looked up too.
    #[schemars(range(min = 0, max = 3))]
    pub multi_probe_level: i32,
}

impl Default for FlannOptions {
    fn default() -> Self {
        Self { trees: 4, checks: 32, tables: 6, key_bits: 12, multi_probe_level: 1 }
    }
}

/// How descriptors become matches (Arys 2020, §2.2.3, §3.3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct MatchingOptions {
    pub matcher: Matcher,
    pub flann: FlannOptions,
    /// Keep a match only if each is the other's best.
    pub cross_check: bool,
    /// Lowe's ratio: keep a match only if its distance is below this share of
    /// the second best's; null switches the test off.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub ratio: Option<f32>,
    /// The largest accepted descriptor distance (bits for ORB, Euclidean
    /// otherwise); null accepts all.
    #[schemars(range(min = 0.0, max = 100000.0))]
    pub max_distance: Option<f32>,
}

impl Default for MatchingOptions {
    fn default() -> Self {
        Self {
            matcher: Matcher::default(),
            flann: FlannOptions::default(),
            cross_check: true,
            ratio: None,
            max_distance: None,
        }
    }
}
