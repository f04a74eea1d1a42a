//! JSON bodies of requests that are not uploads.

use axum::Json;
use axum::extract::{FromRequest, Request};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::problem::{INVALID_BODY, Problem};

/// Numbers up to this are whole exactly as floats.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// A JSON object as a `T`. Lists are none, though `T`s could be read from them;
/// whole numbers may be written as `60.0`, as JSON Schema has it.
pub(super) struct Body<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Body<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let wrong = |detail: String| Problem::new(INVALID_BODY, detail);
        let read = Json::<Value>::from_request(request, state).await;
        let Json(mut value) = read.map_err(|error| wrong(error.body_text()))?;
        if !value.is_object() {
            return Err(wrong("the body is no JSON object; send one".to_owned()));
        }
        make_whole(&mut value);
        serde_path_to_error::deserialize(value)
            .map(Self)
            .map_err(|error| wrong(format!("at `{}`: {}", error.path(), error.inner())))
    }
}

fn make_whole(value: &mut Value) {
    match value {
        Value::Number(number) => {
            let float = number.as_f64().filter(|_| number.is_f64());
            if let Some(float) = float.filter(|it| it.fract() == 0.0 && it.abs() < LARGEST_WHOLE) {
                *value = (float as i64).into();
            }
        }
        Value::Array(values) => values.iter_mut().for_each(make_whole),
        Value::Object(values) => values.values_mut().for_each(make_whole),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body as HttpBody;
    use serde::Deserialize;

    #[derive(Debug, Deserialize, PartialEq)]
    struct Pair {
        name: Option<String>,
        seconds: Option<u32>,
    }

    async fn read(text: &str) -> Option<Pair> {
        let request = Request::builder().header("content-type", "application/json");
        let request = request.body(HttpBody::from(text.to_owned())).unwrap();
        Body::from_request(request, &()).await.ok().map(|Body(pair)| pair)
    }

    #[tokio::test]
    async fn objects_are_read_and_lists_are_not() {
        let pair = |seconds| Some(Pair { name: None, seconds });
        assert_eq!(read("{}").await, pair(None));
        assert_eq!(read(r#"{"seconds": 60.0}"#).await, pair(Some(60)));
        for wrong in
            ["[]", "[null, 60]", "null", "", "{", r#"{"seconds": 0.5}"#, r#"{"seconds": -1}"#]
        {
            assert_eq!(read(wrong).await, None, "{wrong}");
        }
    }
}
