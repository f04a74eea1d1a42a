//! How finely meshes are compared.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::solid::ComparisonOptions;

/// How the mesh is compared with the true model, where one came with the sheet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationOptions {
    /// Cells a side of the grid for the intersection over union.
    #[schemars(range(min = 16, max = 384))]
    pub grid_cells: u32,
    /// Points on either surface.
    #[schemars(range(min = 1000, max = 1000000))]
    pub samples: u32,
}

impl From<&EvaluationOptions> for ComparisonOptions {
    fn from(options: &EvaluationOptions) -> Self {
        Self {
            grid_cells: options.grid_cells as usize,
            samples: options.samples as usize,
            ..Self::default()
        }
    }
}

impl Default for EvaluationOptions {
    fn default() -> Self {
        Self { grid_cells: 192, samples: 100_000 }
    }
}
