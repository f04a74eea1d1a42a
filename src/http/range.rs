//! Byte ranges (RFC 9110, section 14).

use std::ops::Range;

use http_range_header::{EndPosition, StartPosition, SyntacticallyCorrectRange};

/// What a `Range` header asks of content of a certain length.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Selection {
    /// All of it: no range, one that cannot be read, or several (a server may
    /// answer those with everything).
    Whole,
    Part(Range<u64>),
    /// The range lies outside.
    Unsatisfiable,
}

/// Reads a `Range` header for content of `length` bytes.
pub(super) fn select(header: &str, length: u64) -> Selection {
    let Ok(parsed) = http_range_header::parse_range_header(header) else {
        return if is_empty_suffix(header) { Selection::Unsatisfiable } else { Selection::Whole };
    };
    match parsed.ranges.as_slice() {
        [range] => select_one(*range, length),
        _ => Selection::Whole,
    }
}

fn select_one(range: SyntacticallyCorrectRange, length: u64) -> Selection {
    let start = match range.start {
        StartPosition::Index(start) => start,
        StartPosition::FromLast(count) => length.saturating_sub(count),
    };
    let end = match range.end {
        EndPosition::Index(last) if last < start => return Selection::Whole,
        EndPosition::Index(last) => last.saturating_add(1).min(length),
        EndPosition::LastByte => length,
    };
    if start >= length { Selection::Unsatisfiable } else { Selection::Part(start..end) }
}

/// `bytes=-0` is well formed, but no byte is in it.
fn is_empty_suffix(header: &str) -> bool {
    header.strip_prefix("bytes=-").is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b == b'0'))
}

#[cfg(test)]
mod tests {
    use super::Selection::{Part, Unsatisfiable, Whole};
    use super::*;

    #[test]
    fn selects_as_the_rfc_has_it() {
        for (header, expected) in [
            ("bytes=0-0", Part(0..1)),
            ("bytes=2-4", Part(2..5)),
            ("bytes=2-", Part(2..10)),
            ("bytes=2-400", Part(2..10)),
            ("bytes=-3", Part(7..10)),
            ("bytes=-300", Part(0..10)),
            ("bytes=10-", Unsatisfiable),
            ("bytes=10-20", Unsatisfiable),
            ("bytes=-0", Unsatisfiable),
            ("bytes=4-2", Whole),
            ("bytes=0-1,4-5", Whole),
            ("bytes=a-b", Whole),
            ("lines=0-1", Whole),
            ("bytes=-", Whole),
        ] {
            assert_eq!(select(header, 10), expected, "{header}");
        }
        assert_eq!(select("bytes=0-", 0), Unsatisfiable);
        assert_eq!(select("bytes=0-18446744073709551615", 10), Part(0..10));
    }
}
