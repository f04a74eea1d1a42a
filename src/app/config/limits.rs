//! Settings of what an upload may cost.

use clap::Args;
use serde::{Deserialize, Serialize};

use mesh::read;
use picture::ImageLimits;

/// What an upload may cost.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Limits")]
pub(crate) struct LimitConfig {
    /// Largest image file, MiB
    #[arg(long, env = "TURNAROUND_MAX_IMAGE_MIB", value_name = "MIB", default_value_t = 32)]
    pub max_image_mib: u64,
    /// Most pixels of an image, megapixels
    #[arg(
        long,
        env = "TURNAROUND_MAX_IMAGE_MEGAPIXELS",
        value_name = "MEGAPIXELS",
        default_value_t = 64
    )]
    pub max_image_megapixels: u64,
    /// Largest width or height of an image, pixels
    #[arg(
        long,
        env = "TURNAROUND_MAX_IMAGE_SIDE",
        value_name = "PIXELS",
        default_value_t = 16_384
    )]
    pub max_image_side: u32,
    /// Most views of a sheet
    #[arg(long, env = "TURNAROUND_MAX_VIEWS", value_name = "N", default_value_t = 64)]
    pub max_views: usize,
    /// Largest model file to draw, MiB
    #[arg(long, env = "TURNAROUND_MAX_MODEL_MIB", value_name = "MIB", default_value_t = 64)]
    pub max_model_mib: usize,
    /// Most triangles of a model to draw
    #[arg(
        long,
        env = "TURNAROUND_MAX_MODEL_TRIANGLES",
        value_name = "N",
        default_value_t = 1_000_000
    )]
    pub max_model_triangles: usize,
    /// Memory that one job may take, MiB; 0 shares what the machine or the control
    /// group has among the workers
    #[arg(long, env = "TURNAROUND_MAX_JOB_MIB", value_name = "MIB", default_value_t = 0)]
    pub max_job_mib: u64,
    /// Largest request body, MiB
    #[arg(long, env = "TURNAROUND_MAX_BODY_MIB", value_name = "MIB", default_value_t = 256)]
    pub max_body_mib: u64,
}

impl LimitConfig {
    /// The limits of a model; formats without indices have three vertices a triangle.
    pub(crate) fn model(&self) -> read::Limits {
        read::Limits {
            max_bytes: self.max_model_mib << 20,
            max_vertices: 3 * self.max_model_triangles,
            max_triangles: self.max_model_triangles,
        }
    }

    /// The limits of one picture.
    pub(crate) fn image(&self) -> ImageLimits {
        ImageLimits {
            max_bytes: self.max_image_mib << 20,
            max_pixels: self.max_image_megapixels * 1_000_000,
            max_side_px: self.max_image_side,
        }
    }
}
