//! Jobs that reconstruct a sheet.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use sheet::SheetDocument;

/// The kind of jobs that reconstruct a sheet.
pub const RECONSTRUCTION: &str = "reconstruction";

/// What a reconstruction job needs apart from its stored inputs. The image
/// names of the document are the inputs' names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReconstructionPayload {
    /// The sheet: its views, options and truth.
    pub document: SheetDocument,
    /// The earlier job whose inputs were taken over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Uuid>,
}
