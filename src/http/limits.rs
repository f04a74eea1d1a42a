//! What one client may ask of the service, and how long it is waited for.

use std::time::Duration;

use crate::draft::DraftLimits;
use drawing::SheetLimits;
use mesh::read;
use picture::ImageLimits;

/// What one client may ask of the service.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HttpLimits {
    /// A reconstruction as a whole: one that could not run is refused.
    pub draft: DraftLimits,
    /// Threads that a job computes with.
    pub threads_per_job: usize,
    /// Each drawing, mask and picture of true values.
    pub image: ImageLimits,
    /// A true model, or one to draw.
    pub model: read::Limits,
    /// A sheet to draw.
    pub sheet: SheetLimits,
    /// A whole upload, bytes.
    pub max_body_bytes: u64,
    /// Views of one reconstruction.
    pub max_views: usize,
    /// Each JSON part of an upload, bytes.
    pub max_document_bytes: usize,
    /// All parts `matches` of an upload together, bytes.
    pub max_matches_bytes: usize,
    /// All uploads being received at a time, bytes in memory.
    pub max_upload_memory_bytes: u64,
    /// Uploads are taken only while this much is left on the disk, bytes.
    pub min_free_bytes: u64,
    /// Uploads are taken only while less than this is stored, bytes.
    pub disk_budget_bytes: Option<u64>,
    /// Whether drawings and masks may be named by URL, to be fetched.
    pub inputs_by_url: bool,
    /// Event streams open at a time.
    pub max_streams: usize,
    /// Pictures and models being checked at a time, each on a thread of its own.
    pub concurrent_decodes: usize,
    /// From the first byte of an upload to its answer.
    pub upload_timeout: Duration,
    /// For every other answer to begin, long polls apart.
    pub answer_timeout: Duration,
}

impl Default for HttpLimits {
    fn default() -> Self {
        Self {
            draft: DraftLimits::default(),
            threads_per_job: 1,
            image: ImageLimits::default(),
            model: read::Limits {
                max_bytes: 64 << 20,
                max_vertices: 3_000_000,
                max_triangles: 1_000_000,
            },
            // Views of up to 3840x2160 pixels with 2x2 samples.
            sheet: SheetLimits { max_views: 180, max_pixels: 1 << 26, max_view_samples: 1 << 25 },
            max_body_bytes: 256 << 20,
            max_views: 64,
            max_document_bytes: 1 << 20,
            max_matches_bytes: 8 << 20,
            max_upload_memory_bytes: 768 << 20,
            min_free_bytes: 64 << 20,
            disk_budget_bytes: None,
            inputs_by_url: false,
            max_streams: 256,
            concurrent_decodes: 2,
            upload_timeout: Duration::from_secs(600),
            answer_timeout: Duration::from_secs(30),
        }
    }
}

/// How long the server waits for a client, and at its end for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServerTimeouts {
    /// For a request's header to arrive; also closes idle connections.
    pub header_read: Duration,
    /// For the next bytes of a request's body.
    pub body_idle: Duration,
    /// For a client to take the next bytes of an answer.
    pub write: Duration,
    /// For open connections to end at a shutdown.
    pub shutdown_grace: Duration,
}

impl Default for ServerTimeouts {
    fn default() -> Self {
        Self {
            header_read: Duration::from_secs(10),
            body_idle: Duration::from_secs(30),
            write: Duration::from_secs(30),
            shutdown_grace: Duration::from_secs(2),
        }
    }
}
