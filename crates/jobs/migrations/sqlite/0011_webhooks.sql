-- Where the end of a job is told; NULL for its tenant's address.
ALTER TABLE jobs ADD COLUMN webhook TEXT;
ALTER TABLE tenants ADD COLUMN webhook TEXT;

-- What a tenant's messages are signed with. They can't be hashes: each message
-- needs the secret itself.
CREATE TABLE webhook_secrets (
    tenant     TEXT    NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    secret     TEXT    NOT NULL,
    -- Signed with besides the newest one until then; NULL for that one.
    until_ms   INTEGER,
    created_ms INTEGER NOT NULL,
    PRIMARY KEY (tenant, secret)
) STRICT, WITHOUT ROWID;

-- The outbox: a message for every job that ended and had an address, written
-- with the end itself. The job may be deleted since.
CREATE TABLE deliveries (
    id            TEXT    NOT NULL PRIMARY KEY,
    job_id        TEXT    NOT NULL,
    tenant        TEXT    NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    url           TEXT    NOT NULL,
    -- Of the job as it ended.
    kind          TEXT    NOT NULL,
    job_state     TEXT    NOT NULL,
    name          TEXT,
    labels        TEXT    NOT NULL,
    failure       TEXT,
    finished_ms   INTEGER NOT NULL,
    state         TEXT    NOT NULL CHECK (state IN ('pending', 'delivered', 'given_up')),
    -- Since it was last asked for.
    tries         INTEGER NOT NULL DEFAULT 0,
    -- Not sent before this, by the machine's time since the start `boot`.
    boot          TEXT    NOT NULL DEFAULT '',
    not_before_ms INTEGER NOT NULL DEFAULT 0
) STRICT, WITHOUT ROWID;

CREATE INDEX deliveries_pending ON deliveries (tries, not_before_ms) WHERE state = 'pending';
CREATE INDEX deliveries_of_job ON deliveries (job_id);

CREATE TABLE delivery_attempts (
    delivery    TEXT    NOT NULL REFERENCES deliveries (id) ON DELETE CASCADE,
    number      INTEGER NOT NULL,
    at_ms       INTEGER NOT NULL,
    duration_ms INTEGER NOT NULL,
    -- What the receiver answered; NULL if nothing.
    status      INTEGER,
    -- Why it was no success; NULL if it was.
    error       TEXT,
    PRIMARY KEY (delivery, number)
) STRICT, WITHOUT ROWID;

-- The log goes with its job; what is not yet told is told all the same.
CREATE TRIGGER deliveries_of_deleted_jobs AFTER DELETE ON jobs BEGIN
    DELETE FROM deliveries WHERE job_id = OLD.id AND state <> 'pending';
END;
