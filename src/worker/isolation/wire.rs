//! What the service and its child say to each other.
//!
//! A message is two lengths of four bytes, the least significant first; then as
//! many bytes of JSON; then as many bytes of a file.

use std::io::{self, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::ChildSettings;
use super::confine::Held;
use crate::worker::{Task, WorkError};

/// The longest JSON of a message, bytes.
const MAX_JSON: u32 = 64 << 20;
/// The most that is made room for before it has come.
const MAX_RESERVED: usize = 8 << 20;

/// What a child is told.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ToChild {
    /// First of all.
    Begin(ChildSettings),
    /// Work on this; answered by [`FromChild::Done`].
    Run(Task),
    /// Answers a [`FromChild::Read`]; the bytes are the file's.
    Input { request: u64, error: Option<ReadError> },
    /// Stop working.
    Cancel,
}

/// What a child tells.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum FromChild {
    /// It may be given work; what holds it.
    Ready(Held),
    /// It needs an input.
    Read { request: u64, name: String },
    /// A whole artifact; the bytes are its.
    Artifact { name: String, media_type: String },
    /// An artifact that comes in pieces begins.
    Create { writer: u64, name: String, media_type: String },
    /// The bytes are the next ones of that artifact.
    Piece { writer: u64 },
    /// That artifact is whole.
    Finish { writer: u64 },
    /// How far the work is.
    Progress { fraction: f64, progress: Value },
    /// What the work came to.
    Done(Result<Option<Value>, WorkError>),
}

/// Why an input can't be read.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct ReadError {
    kind: ReadErrorKind,
    detail: String,
}

/// The kinds that work tells apart.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum ReadErrorKind {
    NotFound,
    InvalidInput,
    Other,
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        let kind = match error.kind() {
            io::ErrorKind::NotFound => ReadErrorKind::NotFound,
            io::ErrorKind::InvalidInput => ReadErrorKind::InvalidInput,
            _ => ReadErrorKind::Other,
        };
        Self { kind, detail: error.to_string() }
    }
}

impl From<ReadError> for io::Error {
    fn from(error: ReadError) -> Self {
        let kind = match error.kind {
            ReadErrorKind::NotFound => io::ErrorKind::NotFound,
            ReadErrorKind::InvalidInput => io::ErrorKind::InvalidInput,
            ReadErrorKind::Other => io::ErrorKind::Other,
        };
        Self::new(kind, error.detail)
    }
}

/// Sends a message and the bytes that come with it.
///
/// # Errors
/// `InvalidInput` if it is too long; what the socket says.
pub(super) fn send<T: Serialize>(out: &mut impl Write, what: &T, bytes: &[u8]) -> io::Result<()> {
    let json = serde_json::to_vec(what)?;
    let too_long = || io::Error::new(io::ErrorKind::InvalidInput, "a message is too long");
    let json_length = u32::try_from(json.len()).ok().filter(|length| *length <= MAX_JSON);
    let json_length = json_length.ok_or_else(too_long)?;
    let bytes_length = u32::try_from(bytes.len()).map_err(|_| too_long())?;
    let mut head = Vec::with_capacity(8 + json.len());
    head.extend(json_length.to_le_bytes());
    head.extend(bytes_length.to_le_bytes());
    head.extend(json);
    out.write_all(&head)?;
    out.write_all(bytes)
}

/// The next message and the bytes that come with it.
///
/// # Errors
/// `UnexpectedEof` at the end, `InvalidData` for what is no message.
pub(super) fn receive<T: DeserializeOwned>(input: &mut impl Read) -> io::Result<(T, Vec<u8>)> {
    let mut lengths = [[0; 4]; 2];
    input.read_exact(lengths.as_flattened_mut())?;
    let [json, bytes] = lengths.map(u32::from_le_bytes);
    if json > MAX_JSON {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a message is too long"));
    }
    let what = serde_json::from_slice(&exactly(input, json)?)?;
    Ok((what, exactly(input, bytes)?))
}

/// So many bytes; room is made as they come.
fn exactly(input: &mut impl Read, length: u32) -> io::Result<Vec<u8>> {
    let wanted = length as usize;
    let mut bytes = Vec::with_capacity(wanted.min(MAX_RESERVED));
    if input.take(length.into()).read_to_end(&mut bytes)? < wanted {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_as_they_were_sent() {
        let mut sent = Vec::new();
        send(&mut sent, &FromChild::Piece { writer: 7 }, b"bytes").unwrap();
        send(&mut sent, &FromChild::Done(Err(WorkError::Cancelled)), b"").unwrap();
        let mut rest = sent.as_slice();
        let (piece, bytes) = receive(&mut rest).unwrap();
        assert!(matches!(piece, FromChild::Piece { writer: 7 }));
        assert_eq!(bytes, b"bytes");
        let (done, bytes) = receive(&mut rest).unwrap();
        assert!(matches!(done, FromChild::Done(Err(WorkError::Cancelled))));
        assert!(bytes.is_empty());
        let end = receive::<FromChild>(&mut rest).unwrap_err();
        assert_eq!(end.kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn false_lengths_are_refused_without_making_room() {
        for lengths in [[u32::MAX, 0], [4, u32::MAX]] {
            let mut sent: Vec<u8> = lengths.iter().flat_map(|it| it.to_le_bytes()).collect();
            sent.extend(b"null");
            assert!(receive::<Value>(&mut sent.as_slice()).is_err());
        }
        let mut sent = [3u32, 0].map(u32::to_le_bytes).concat();
        sent.extend(b"{x}");
        let error = receive::<Value>(&mut sent.as_slice()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }
}
