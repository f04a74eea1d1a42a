//! What the study varies, and over which values.

use uncalibrated::DisparityGrid;
use uncalibrated::Options;
use uncalibrated::options::{Descriptor, Detector, DisparityOptions};

/// What is varied, and over which values.
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// What is not varied: table 4.3's and 4.5's parameters.
    pub base: Options,
    /// Tables 4.1 and 4.2, in the dissertation's order.
    pub combinations: Vec<(Detector, Descriptor)>,
    /// Figure 4.3a, px.
    pub thresholds_px: Vec<f64>,
    /// Figure 4.3b.
    pub confidences: Vec<f64>,
    /// Figure 4.6, px.
    pub block_sizes: Vec<i32>,
    /// Block sizes whose maps are fused, beside figure 4.6's single ones, px.
    pub fusions: Vec<Vec<i32>>,
    /// Tables 4.7 and 4.8.
    pub grid: DisparityGrid,
}

impl Default for Protocol {
    fn default() -> Self {
        let grid = DisparityGrid::default();
        Self {
            base: Options::default(),
            combinations: combinations(),
            thresholds_px: vec![0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0],
            confidences: vec![0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999],
            block_sizes: grid.block_sizes.clone(),
            fusions: vec![vec![9, 21, 51], vec![15, 21, 37, 51]],
            grid,
        }
    }
}

impl Protocol {
    /// Figure 4.6's settings: the single block sizes, then the fused ones.
    pub(super) fn blocks(&self) -> Vec<Blocks> {
        let single = self.block_sizes.iter().map(|&size| Blocks(vec![size]));
        single.chain(self.fusions.iter().cloned().map(Blocks)).collect()
    }
}

/// One block size, or several whose maps are fused; px.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Blocks(pub Vec<i32>);

impl Blocks {
    pub(crate) fn single(&self) -> Option<i32> {
        match self.0[..] {
            [size] => Some(size),
            _ => None,
        }
    }

    /// Such as `9+21+51`.
    pub(crate) fn name(&self) -> String {
        self.0.iter().map(i32::to_string).collect::<Vec<_>>().join("+")
    }

    pub(crate) fn options(&self, base: &DisparityOptions) -> DisparityOptions {
        match self.single() {
            Some(block_size) => {
                DisparityOptions { block_size, block_sizes: Vec::new(), ..base.clone() }
            }
            None => DisparityOptions { block_sizes: self.0.clone(), ..base.clone() },
        }
    }
}

/// Every detector with every descriptor, refused ones too.
fn combinations() -> Vec<(Detector, Descriptor)> {
    use Detector::{Fast, Harris, Orb, ShiTomasi, Sift, Surf};
    [Fast, Orb, Harris, ShiTomasi, Sift, Surf]
        .into_iter()
        .flat_map(|detector| {
            [Descriptor::Sift, Descriptor::Surf, Descriptor::Orb].map(|d| (detector, d))
        })
        .collect()
}

/// Whether a detector finds corners by the gradient, as Harris and Shi-Tomasi do.
pub(super) fn is_gradient(detector: Detector) -> bool {
    matches!(detector, Detector::Harris | Detector::ShiTomasi)
}

/// The detector's name as tables write it.
pub(super) fn detector_name(detector: Detector) -> &'static str {
    match detector {
        Detector::Fast => "FAST",
        Detector::Orb => "ORB",
        Detector::Harris => "Harris",
        Detector::ShiTomasi => "Shi-Tomasi",
        Detector::Sift => "SIFT",
        Detector::Surf => "SURF",
    }
}

/// The descriptor's name as tables write it.
pub(super) fn descriptor_name(descriptor: Descriptor) -> &'static str {
    match descriptor {
        Descriptor::Orb => "ORB",
        Descriptor::Sift => "SIFT",
        Descriptor::Surf => "SURF",
    }
}
