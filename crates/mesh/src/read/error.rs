/// Why the bytes are not a model that can be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    #[error("the model has {found} bytes; at most {limit} are read")]
    TooManyBytes { found: usize, limit: usize },
    #[error("the model promises {found} vertices; at most {limit} are read")]
    TooManyVertices { found: usize, limit: usize },
    #[error("the model promises {found} triangles; at most {limit} are read")]
    TooManyTriangles { found: usize, limit: usize },
    #[error("not a valid {format} file: {reason}")]
    Malformed { format: &'static str, reason: String },
    #[error("the {format} file needs {feature}, which is not supported")]
    Unsupported { format: &'static str, feature: String },
    #[error("the {format} file refers to {uri:?}, but only what the file itself holds is read")]
    ExternalReference { format: &'static str, uri: String },
    #[error("triangle {triangle} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange { triangle: usize, vertex: i64, vertices: usize },
    #[error("vertex {vertex} of the model has a coordinate that is not a finite number")]
    NonFiniteVertex { vertex: usize },
    #[error("the model has no triangle with an area ({degenerate} without)")]
    NoTriangles { degenerate: usize },
}

impl ModelError {
    pub(super) fn malformed(format: &'static str, reason: impl ToString) -> Self {
        Self::Malformed { format, reason: shortened(&reason.to_string()) }
    }

    pub(super) fn unsupported(format: &'static str, feature: impl ToString) -> Self {
        Self::Unsupported { format, feature: shortened(&feature.to_string()) }
    }
}

/// Parsers quote the input in their messages; a megabyte on one line must not come back.
pub(super) fn shortened(text: &str) -> String {
    const LIMIT: usize = 200;
    match text.char_indices().nth(LIMIT) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
