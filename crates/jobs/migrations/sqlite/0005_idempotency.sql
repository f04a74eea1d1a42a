-- Jobs by the keys that clients gave with their uploads, so that one that is
-- sent again becomes no second job. The job may be deleted since.
CREATE TABLE idempotency (
    tenant      TEXT    NOT NULL,
    key         TEXT    NOT NULL,
    -- SHA-256 of what was uploaded, lower-case hexadecimal.
    fingerprint TEXT    NOT NULL,
    job_id      TEXT    NOT NULL,
    at_ms       INTEGER NOT NULL,
    PRIMARY KEY (tenant, key)
) STRICT, WITHOUT ROWID;

CREATE INDEX idempotency_by_age ON idempotency (at_ms);
