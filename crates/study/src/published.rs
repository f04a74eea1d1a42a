//! The figures that Arys 2020 reports, for laying beside ours.

use uncalibrated::options::{Descriptor, Detector};

/// A row of table 4.2: means over the pairs 40-45 and 45-50 of the dude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PublishedFeatures {
    pub detector: Detector,
    pub descriptor: Descriptor,
    /// Mean Sampson distance; of which matches is not said, nor if squared.
    pub msd: f64,
    pub sev: f64,
    /// Rejected matches of all.
    pub outliers: (f64, f64),
    /// Eo and Ea, percent.
    pub eo_percent: f64,
    pub ea_percent: f64,
}

macro_rules! features {
    ($($detector:ident $descriptor:ident $msd:literal $sev:literal $out:literal / $all:literal $eo:literal $ea:literal;)*) => {
        &[$(PublishedFeatures {
            detector: Detector::$detector,
            descriptor: Descriptor::$descriptor,
            msd: $msd,
            sev: $sev,
            outliers: ($out, $all),
            eo_percent: $eo,
            ea_percent: $ea,
        }),*]
    };
}

pub(super) const TABLE_4_2: &[PublishedFeatures] = features! {
    Fast Sift 42.7 1.4e-5 21.0/96.0 12.7 10.5;
    Fast Surf 1142.5 9.2e-5 23.0/62.0 17.9 18.5;
    Fast Orb 53.4 2.2e-5 17.0/80.0 47.1 27.4;
    Orb Sift 20.1 6.6e-4 66.0/293.0 9.8 10.7;
    Orb Surf 51.0 2.9e-5 24.0/218.0 3.4 2.5;
    Orb Orb 935.4 2.0e-9 38.0/194.0 0.6 0.7;
    Harris Sift 0.3 4.7e-10 1.0/38.0 1.1 1.3;
    Harris Surf 26.3 1.2e-7 1.0/31.0 2.1 1.2;
    Harris Orb 0.1 1.5e-8 1.0/33.0 0.8 1.0;
    ShiTomasi Sift 0.4 9.8e-5 3.0/36.0 3.5 4.8;
    ShiTomasi Surf 434.6 5.6e-9 1.0/31.0 1.0 1.2;
    ShiTomasi Orb 0.3 1.9e-9 1.0/35.0 0.4 0.8;
    Sift Sift 164.2 5.1e-6 12.0/63.0 1.6 2.2;
    Sift Surf 2068.1 8.6e-6 14.0/51.0 5.6 7.1;
    Surf Sift 6.7 2.7e-3 29.0/130.0 40.7 43.0;
    Surf Surf 89.7 1.7e-5 18.0/103.0 1.5 1.8;
    Surf Orb 323.8 2.3e-4 15.0/109.0 5.3 7.6;
};

/// Table 4.4: cross-check on and off.
pub(super) const TABLE_4_4: [(bool, PublishedFeatures); 2] = [
    (true, shi_tomasi_orb(0.3, 1.9e-9, (1.0, 35.0), 0.8)),
    (false, shi_tomasi_orb(129.1, 8.4e-9, (5.0, 44.0), 0.7)),
];

const fn shi_tomasi_orb(msd: f64, sev: f64, outliers: (f64, f64), ea: f64) -> PublishedFeatures {
    PublishedFeatures {
        detector: Detector::ShiTomasi,
        descriptor: Descriptor::Orb,
        msd,
        sev,
        outliers,
        eo_percent: 0.4,
        ea_percent: ea,
    }
}

/// A row of tables 4.7 and 4.8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PublishedSheet {
    /// The dissertation's name.
    pub name: &'static str,
    /// The name of our sheet of the same subject, or of its stand-in.
    pub sheet: &'static str,
    pub spacing_deg: f64,
    pub bad2: f64,
    pub correlation: f64,
    pub block_size: i32,
    pub min_disparity_px: i32,
}

/// Where the dissertation's Batman stands; its model is not free.
pub(super) const STAND_IN: &str = "hero";

pub(super) const TABLE_4_7: &[PublishedSheet] = &[
    sheet("Batman", STAND_IN, 15.0, 0.58, -0.27, 15, 12),
    sheet("Stanford Bunny", "bunny", 5.0, 0.09, 0.23, 7, -18),
    sheet("Cube", "cube", 5.0, 0.29, 0.54, 37, -26),
    sheet("Dude", "dude", 5.0, 0.31, 0.49, 37, 0),
    sheet("Objects", "objects", 5.0, 0.50, 0.11, 23, 14),
    sheet("Suzanne", "suzanne", 5.0, 0.47, -0.07, 37, 0),
    sheet("Torus (flat)", "torus_flat", 5.0, 0.48, -0.22, 37, 0),
    sheet("Torus (side)", "torus_side", 5.0, 0.45, 0.22, 25, -17),
    sheet("Utah Teapot", "teapot", 5.0, 0.13, 0.55, 15, -25),
];

const fn sheet(
    name: &'static str,
    sheet: &'static str,
    spacing_deg: f64,
    bad2: f64,
    correlation: f64,
    block_size: i32,
    min_disparity_px: i32,
) -> PublishedSheet {
    PublishedSheet { name, sheet, spacing_deg, bad2, correlation, block_size, min_disparity_px }
}

/// Figure 4.8, the dude: bad2.0 and correlation of the left map, the right map
/// and their mean.
pub(super) const FIGURE_4_8: [(f64, f64); 3] = [(0.49, 0.40), (0.32, 0.49), (0.31, 0.49)];
