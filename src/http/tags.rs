//! What people say of a job or page: its name, its labels, and how long it stays. Given
//! with the upload as query parameters, and changed with PATCH.

use std::collections::BTreeMap;

use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Deserializer};
use utoipa::ToSchema;

use super::problem::{INVALID_BODY, INVALID_QUERY, Problem, ProblemType};
use jobs::Tags;

const MAX_LABELS: usize = 16;
const MAX_LABEL_NAME: usize = 63;
const MAX_TEXT: usize = 200;
/// The longest time to stay: ten years.
const MAX_SECONDS: i64 = 10 * 366 * 24 * 3600;

/// What to change of what people say of a job or page; what is left out stays.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(example = json!({"name": "Ida, final", "labels": {"show": "7", "shot": "12"}, "pinned": true}))]
pub(super) struct Changes {
    /// Null takes it away.
    #[serde(deserialize_with = "given")]
    #[schema(value_type = Option<String>, max_length = 200)]
    name: Option<Option<String>>,
    /// All of them: those not given are taken away. Names are 1 to 63 letters,
    /// digits, `_`, `-` and `.`; texts have 200 characters at most; 16 pairs at most.
    labels: Option<BTreeMap<String, String>>,
    /// Seconds from now until it is deleted by itself; null keeps it for ever.
    #[serde(deserialize_with = "given")]
    #[schema(value_type = Option<i64>, minimum = 0, maximum = 316_224_000)]
    expires_in: Option<Option<i64>>,
    /// Whether it stays although its time is over.
    pinned: Option<bool>,
}

/// Tells null from nothing.
fn given<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<Option<T>, D::Error> {
    T::deserialize(from).map(Some)
}

impl Changes {
    /// The tags with these changes.
    pub(super) fn over(self, tags: Tags, now: Timestamp) -> Result<Tags, Problem> {
        let wrong = |detail| Problem::new(INVALID_BODY, detail);
        Ok(Tags {
            name: match self.name {
                None => tags.name,
                Some(None) => None,
                Some(Some(name)) => Some(text("name", name).map_err(wrong)?),
            },
            labels: match self.labels {
                None => tags.labels,
                Some(labels) => checked(labels).map_err(wrong)?,
            },
            expires_at: match self.expires_in {
                None => tags.expires_at,
                Some(None) => None,
                Some(Some(seconds)) => Some(after(now, seconds).map_err(wrong)?),
            },
            pinned: self.pinned.unwrap_or(tags.pinned),
        })
    }
}

/// The tags of a new job or page, as query parameters have them.
pub(super) fn of_query(
    name: Option<String>,
    labels: Option<&str>,
    expires_in: Option<i64>,
    pinned: bool,
    now: Timestamp,
) -> Result<Tags, Problem> {
    let wrong =
        |parameter: &str, detail: String| Problem::new(INVALID_QUERY, detail).parameter(parameter);
    let name = name.map(|name| text("name", name)).transpose();
    let expires_at = expires_in.map(|seconds| after(now, seconds)).transpose();
    Ok(Tags {
        name: name.map_err(|detail| wrong("name", detail))?,
        labels: labels.map_or_else(|| Ok(BTreeMap::new()), |it| pairs(it, INVALID_QUERY))?,
        expires_at: expires_at.map_err(|detail| wrong("expires_in", detail))?,
        pinned,
    })
}

/// Labels as a query parameter has them: `show:7,shot:12`.
pub(super) fn pairs(text: &str, kind: ProblemType) -> Result<BTreeMap<String, String>, Problem> {
    let wrong = |detail: String| Problem::new(kind, detail).parameter("labels");
    let mut labels = BTreeMap::new();
    for pair in text.split(',').filter(|pair| !pair.is_empty()) {
        let (name, value) = pair.split_once(':').ok_or_else(|| {
            wrong(format!("`{pair}` is no label; write NAME:TEXT, with commas between them"))
        })?;
        labels.insert(name.to_owned(), value.to_owned());
    }
    checked(labels).map_err(wrong)
}

fn checked(labels: BTreeMap<String, String>) -> Result<BTreeMap<String, String>, String> {
    if labels.len() > MAX_LABELS {
        return Err(format!("there are {} labels; give {MAX_LABELS} at most", labels.len()));
    }
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'.');
    for (name, value) in &labels {
        if !(1..=MAX_LABEL_NAME).contains(&name.len()) || !name.bytes().all(plain) {
            return Err(format!(
                "`{name}` is no name of a label; use 1 to {MAX_LABEL_NAME} letters, digits, `_`, `-` and `.`"
            ));
        }
        text(name, value.clone())?;
    }
    Ok(labels)
}

fn text(what: &str, text: String) -> Result<String, String> {
    if text.chars().count() <= MAX_TEXT && !text.chars().any(char::is_control) {
        return Ok(text);
    }
    Err(format!("`{what}` must have {MAX_TEXT} characters at most, and no control characters"))
}

fn after(now: Timestamp, seconds: i64) -> Result<Timestamp, String> {
    let wrong = || format!("`expires_in` is {seconds}; give 0 to {MAX_SECONDS} seconds");
    if !(0..=MAX_SECONDS).contains(&seconds) {
        return Err(wrong());
    }
    // As it is stored, so that it is told alike at once and later.
    let at = now.checked_add(SignedDuration::from_secs(seconds)).map_err(|_| wrong())?;
    Timestamp::from_millisecond(at.as_millisecond()).map_err(|_| wrong())
}
