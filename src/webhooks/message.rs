//! What a message says, and its signature.

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use bytes::Bytes;
use jiff::Timestamp;
use serde_json::json;
use standardwebhooks::{
    HEADER_WEBHOOK_ID, HEADER_WEBHOOK_SIGNATURE, HEADER_WEBHOOK_TIMESTAMP, Webhook, WebhookError,
};

use crate::http::{noun_of, path_of};
use jobs::Delivery;

/// The message's body: the same however often it is sent.
pub(super) fn body(delivery: &Delivery) -> Bytes {
    let ended = &delivery.ended;
    let noun = noun_of(&ended.kind).unwrap_or(&ended.kind);
    let state = serde_json::to_value(ended.state).unwrap_or_default();
    let state = state.as_str().unwrap_or_default();
    let body = json!({
        "type": format!("{noun}.{state}"),
        "timestamp": ended.finished_at,
        "data": {
            "id": ended.job,
            "state": state,
            "name": ended.name,
            "labels": ended.labels,
            "failure": ended.failure,
            "href": path_of(&ended.kind, ended.job),
        }
    });
    body.to_string().into()
}

/// The message's header, signed with each of the secrets.
///
/// # Errors
/// If a secret is none.
pub(super) fn headers(
    delivery: &Delivery,
    body: &[u8],
    secrets: &[String],
    now: Timestamp,
) -> Result<HeaderMap, WebhookError> {
    let (id, seconds) = (format!("msg_{}", delivery.id.simple()), now.as_second());
    let signatures: Vec<String> = secrets
        .iter()
        .map(|secret| Webhook::new(secret)?.sign(&id, seconds, body))
        .collect::<Result<_, _>>()?;
    let mut headers = HeaderMap::new();
    for (name, value) in [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (HeaderName::from_static(HEADER_WEBHOOK_ID), id),
        (HeaderName::from_static(HEADER_WEBHOOK_TIMESTAMP), seconds.to_string()),
        (HeaderName::from_static(HEADER_WEBHOOK_SIGNATURE), signatures.join(" ")),
    ] {
        let value = HeaderValue::from_str(&value);
        headers.insert(name, value.map_err(|_| WebhookError::InvalidPayload)?);
    }
    Ok(headers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::DRAWING;
    use jobs::{DeliveryState, Ended, Failure, JobId, JobState, TenantName, new_webhook_secret};
    use uuid::Uuid;

    fn delivery() -> Delivery {
        let job = "01976d2c-0000-7000-8000-000000000001".parse::<JobId>().unwrap();
        let failure = Failure { code: "bad".to_owned(), detail: "it is „bad“".to_owned() };
        Delivery {
            id: Uuid::nil(),
            tenant: TenantName::default(),
            url: "https://studio.example/".to_owned(),
            ended: Ended {
                job,
                kind: DRAWING.to_owned(),
                state: JobState::Failed,
                name: None,
                labels: [("shot".to_owned(), "12".to_owned())].into(),
                failure: Some(failure),
                finished_at: "2026-01-02T03:04:05Z".parse().unwrap(),
            },
            state: DeliveryState::Pending,
            tries: 1,
        }
    }

    #[test]
    fn a_message_says_what_ended_and_where_it_is() {
        let body: serde_json::Value = serde_json::from_slice(&body(&delivery())).unwrap();
        assert_eq!(
            body,
            json!({
                "type": "sheet.failed",
                "timestamp": "2026-01-02T03:04:05Z",
                "data": {
                    "id": "01976d2c-0000-7000-8000-000000000001",
                    "state": "failed",
                    "name": null,
                    "labels": {"shot": "12"},
                    "failure": {"code": "bad", "detail": "it is „bad“"},
                    "href": "/v1/sheets/01976d2c-0000-7000-8000-000000000001",
                }
            })
        );
    }

    /// With the specification's own example, and by both secrets of a change.
    #[test]
    fn signatures_are_those_of_the_specification() {
        let example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
        let signed = Webhook::new(example)
            .unwrap()
            .sign("msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, br#"{"test": 2432232314}"#)
            .unwrap();
        assert_eq!(signed, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
        let (body, secrets) = (body(&delivery()), [new_webhook_secret(), new_webhook_secret()]);
        let now = Timestamp::now();
        let headers = headers(&delivery(), &body, &secrets, now).unwrap();
        for secret in &secrets {
            Webhook::new(secret).unwrap().verify(&body, &headers).unwrap();
        }
        assert!(Webhook::new(&new_webhook_secret()).unwrap().verify(&body, &headers).is_err());
        assert!(Webhook::new(&secrets[0]).unwrap().verify(b"{}", &headers).is_err());
        assert_ne!(secrets[0], secrets[1]);
    }
}
