-- Times are milliseconds since 1970-01-01 UTC. Identifiers are version 7 UUIDs
-- in lower-case text, so that their order is the order of creation.

CREATE TABLE jobs (
    id               TEXT    NOT NULL PRIMARY KEY,
    kind             TEXT    NOT NULL,
    payload          TEXT    NOT NULL,
    state            TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    -- The fencing token: grows with every claim, never used twice.
    attempt          INTEGER NOT NULL,
    -- Claims that count towards max_attempts: a released one is given back.
    attempts_used    INTEGER NOT NULL,
    max_attempts     INTEGER NOT NULL CHECK (max_attempts >= 1),
    cancel_requested INTEGER NOT NULL CHECK (cancel_requested IN (0, 1)),
    worker           TEXT,
    lease_until_ms   INTEGER,
    not_before_ms    INTEGER NOT NULL,
    progress         TEXT,
    failure          TEXT,
    artifacts        TEXT    NOT NULL,
    created_ms       INTEGER NOT NULL,
    started_ms       INTEGER,
    finished_ms      INTEGER,
    -- Number of the latest event.
    version          INTEGER NOT NULL,
    CHECK ((state = 'running') = (lease_until_ms IS NOT NULL))
) STRICT;

CREATE INDEX jobs_queued ON jobs (id) WHERE state = 'queued';
CREATE INDEX jobs_running ON jobs (lease_until_ms) WHERE state = 'running';
CREATE INDEX jobs_by_state ON jobs (state, id);

CREATE TABLE events (
    job_id TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    number INTEGER NOT NULL,
    at_ms  INTEGER NOT NULL,
    kind   TEXT    NOT NULL,
    data   TEXT    NOT NULL,
    PRIMARY KEY (job_id, number)
) STRICT, WITHOUT ROWID;
