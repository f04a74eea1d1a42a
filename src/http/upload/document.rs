//! JSON parts of an upload: kept as they came until all parts are there, and
//! then parsed into what they are, for parsed values take many times the room.

use bytes::Bytes;
use multer::Field;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::parts::read_limited;
use crate::http::HttpLimits;
use crate::http::problem::{INVALID_JSON, Problem, ProblemType};

/// A part that is JSON, not parsed yet.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    part: String,
    bytes: Bytes,
}

impl Document {
    /// Reads a part within its limit and checks that it is JSON.
    pub(crate) async fn read(
        field: Field<'_>,
        part: &str,
        limits: &HttpLimits,
    ) -> Result<Self, Problem> {
        Self::of(read_limited(field, part, limits.max_document_bytes).await?, part)
    }

    /// Checks that `bytes` are JSON.
    pub(crate) fn of(bytes: Bytes, part: &str) -> Result<Self, Problem> {
        serde_json::from_slice::<IgnoredAny>(&bytes).map_err(|error| {
            let detail = format!("`{part}` is not valid JSON: {error}");
            Problem::new(INVALID_JSON, detail).part(part)
        })?;
        Ok(Self { part: part.to_owned(), bytes })
    }

    /// Its size, bytes.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The first character that is no space.
    pub(crate) fn first(&self) -> Option<u8> {
        self.bytes.iter().copied().find(|byte| !byte.is_ascii_whitespace())
    }

    /// What it says, as a `T`.
    ///
    /// # Errors
    /// A problem of `kind` that names the place, if it is no `T`.
    pub(crate) fn parse<T: DeserializeOwned>(&self, kind: ProblemType) -> Result<T, Problem> {
        let mut json = serde_json::Deserializer::from_slice(&self.bytes);
        serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let (part, path) = (&self.part, error.path());
            // What the first look skips, such as numbers out of range.
            let kind = if error.inner().is_syntax() { INVALID_JSON } else { kind };
            let detail = format!("in the part `{part}`, at `{path}`: {}", error.inner());
            Problem::new(kind, detail).part(part)
        })
    }
}
