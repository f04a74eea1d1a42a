//! Why a file is not a model that can be drawn.

/// Why the bytes are not a model that can be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The file is too large to be read.
    #[error("the model has {found} bytes; at most {limit} are read")]
    TooManyBytes {
        /// Its size, bytes.
        found: usize,
        /// The most that is read, bytes.
        limit: usize,
    },
    /// The file promises more vertices than are read.
    #[error("the model promises {found} vertices; at most {limit} are read")]
    TooManyVertices {
        /// How many it promises.
        found: usize,
        /// The most that are read.
        limit: usize,
    },
    /// The file promises more triangles than are read.
    #[error("the model promises {found} triangles; at most {limit} are read")]
    TooManyTriangles {
        /// How many it promises.
        found: usize,
        /// The most that are read.
        limit: usize,
    },
    /// The bytes break the rules of their format.
    #[error("not a valid {format} file: {reason}")]
    Malformed {
        /// Name of the format, such as `OBJ`.
        format: &'static str,
        /// Where and how, for people.
        reason: String,
    },
    /// The file is valid but uses something that is not read.
    #[error("the {format} file needs {feature}, which is not supported")]
    Unsupported {
        /// Name of the format.
        format: &'static str,
        /// What it uses, such as an extension.
        feature: String,
    },
    /// The file refers to another one; only what it holds itself is read.
    #[error("the {format} file refers to {uri:?}, but only what the file itself holds is read")]
    ExternalReference {
        /// Name of the format.
        format: &'static str,
        /// What it refers to, shortened.
        uri: String,
    },
    /// A triangle refers to a vertex that there is not.
    #[error("triangle {triangle} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names; may be negative.
        vertex: i64,
        /// How many vertices the model has.
        vertices: usize,
    },
    /// A vertex has a coordinate that is NaN, infinite or absurdly large.
    #[error("vertex {vertex} of the model has a coordinate that is not a finite number")]
    NonFiniteVertex {
        /// Index of the vertex.
        vertex: usize,
    },
    /// Nothing is left when triangles without an area are left out.
    #[error("the model has no triangle with an area ({degenerate} without)")]
    NoTriangles {
        /// How many triangles have none.
        degenerate: usize,
    },
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
