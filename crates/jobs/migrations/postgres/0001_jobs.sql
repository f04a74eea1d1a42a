-- The tables of the SQLite store, in which each column is explained: the same
-- names, the same values. Numbers are BIGINT, flags 0 and 1, JSON is TEXT as it
-- was written, so that one set of statements serves both.
--
-- Nodes of the version before go on while this is applied, and may start after
-- it: later files add tables, columns with defaults and indexes, and take nothing
-- away that the version before uses.

CREATE TABLE tenants (
    name       TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    created_ms BIGINT NOT NULL,
    limits     TEXT   NOT NULL DEFAULT '{}',
    served     BIGINT NOT NULL DEFAULT 0,
    webhook    TEXT
);

INSERT INTO tenants (name, created_ms) VALUES ('default', 0);

CREATE TABLE keys (
    id         TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    tenant     TEXT COLLATE "C" NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    label      TEXT   NOT NULL,
    scope      TEXT   NOT NULL CHECK (scope IN ('read', 'write', 'admin')),
    hash       TEXT   NOT NULL,
    created_ms BIGINT NOT NULL,
    revoked_ms BIGINT
);

CREATE TABLE jobs (
    -- In the order of arrival.
    rowid            BIGINT GENERATED ALWAYS AS IDENTITY,
    id               TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    tenant           TEXT COLLATE "C" NOT NULL REFERENCES tenants (name),
    kind             TEXT   NOT NULL,
    priority         BIGINT NOT NULL,
    payload          TEXT   NOT NULL,
    state            TEXT   NOT NULL
        CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    attempt          BIGINT NOT NULL,
    attempts_used    BIGINT NOT NULL,
    max_attempts     BIGINT NOT NULL CHECK (max_attempts >= 1),
    troubles         BIGINT NOT NULL DEFAULT 0,
    cancel_requested BIGINT NOT NULL CHECK (cancel_requested IN (0, 1)),
    delete_requested BIGINT NOT NULL DEFAULT 0 CHECK (delete_requested IN (0, 1)),
    worker           TEXT,
    -- By the database's clock: milliseconds since 1970-01-01 UTC, and no `boot`.
    boot             TEXT   NOT NULL,
    lease_until_ms   BIGINT,
    not_before_ms    BIGINT NOT NULL,
    progress         TEXT,
    failure          TEXT,
    artifacts        TEXT   NOT NULL,
    summary          TEXT,
    name             TEXT,
    labels           TEXT   NOT NULL DEFAULT '{}',
    expires_ms       BIGINT,
    pinned           BIGINT NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1)),
    webhook          TEXT,
    bytes            BIGINT,
    created_ms       BIGINT NOT NULL,
    started_ms       BIGINT,
    finished_ms      BIGINT,
    version          BIGINT NOT NULL,
    CHECK ((state = 'running') = (lease_until_ms IS NOT NULL))
);

CREATE INDEX jobs_waiting ON jobs (tenant, priority DESC, rowid) WHERE state = 'queued';
CREATE INDEX jobs_at_work ON jobs (tenant) WHERE state = 'running';
CREATE INDEX jobs_running ON jobs (lease_until_ms) WHERE state = 'running';
CREATE INDEX jobs_by_state ON jobs (state, id);
CREATE INDEX jobs_of_tenant ON jobs (tenant, kind, id);
CREATE INDEX jobs_by_bytes ON jobs (tenant, bytes);
CREATE INDEX jobs_by_end ON jobs (finished_ms) WHERE finished_ms IS NOT NULL;
CREATE INDEX jobs_that_expire ON jobs (expires_ms) WHERE expires_ms IS NOT NULL AND pinned = 0;
CREATE INDEX jobs_to_delete ON jobs (id) WHERE delete_requested = 1;
CREATE INDEX jobs_unmeasured ON jobs (id) WHERE bytes IS NULL;

CREATE TABLE events (
    job_id TEXT COLLATE "C" NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    number BIGINT NOT NULL,
    at_ms  BIGINT NOT NULL,
    kind   TEXT   NOT NULL,
    data   TEXT   NOT NULL,
    PRIMARY KEY (job_id, number)
);

CREATE TABLE pages (
    id         TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    tenant     TEXT COLLATE "C" NOT NULL REFERENCES tenants (name),
    content    TEXT   NOT NULL,
    version    BIGINT NOT NULL CHECK (version >= 1),
    created_ms BIGINT NOT NULL,
    changed_ms BIGINT NOT NULL,
    expires_ms BIGINT,
    bytes      BIGINT
);

CREATE INDEX pages_of_tenant ON pages (tenant, id);
CREATE INDEX pages_by_bytes ON pages (tenant, bytes);
CREATE INDEX pages_that_expire ON pages (expires_ms) WHERE expires_ms IS NOT NULL;

CREATE TABLE ownerless (
    job_id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    boot   TEXT   NOT NULL,
    at_ms  BIGINT NOT NULL
);

CREATE TABLE idempotency (
    tenant      TEXT COLLATE "C" NOT NULL,
    key         TEXT   NOT NULL,
    fingerprint TEXT   NOT NULL,
    job_id      TEXT COLLATE "C" NOT NULL,
    at_ms       BIGINT NOT NULL,
    PRIMARY KEY (tenant, key)
);

CREATE INDEX idempotency_by_age ON idempotency (tenant, at_ms);

CREATE TABLE secrets (
    name   TEXT NOT NULL PRIMARY KEY,
    secret TEXT NOT NULL
);

CREATE TABLE webhook_secrets (
    tenant     TEXT COLLATE "C" NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    secret     TEXT   NOT NULL,
    until_ms   BIGINT,
    created_ms BIGINT NOT NULL,
    PRIMARY KEY (tenant, secret)
);

CREATE TABLE deliveries (
    id            TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    job_id        TEXT COLLATE "C" NOT NULL,
    tenant        TEXT COLLATE "C" NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    url           TEXT   NOT NULL,
    kind          TEXT   NOT NULL,
    job_state     TEXT   NOT NULL,
    name          TEXT,
    labels        TEXT   NOT NULL,
    failure       TEXT,
    finished_ms   BIGINT NOT NULL,
    state         TEXT   NOT NULL CHECK (state IN ('pending', 'delivered', 'given_up')),
    tries         BIGINT NOT NULL DEFAULT 0,
    boot          TEXT   NOT NULL DEFAULT '',
    not_before_ms BIGINT NOT NULL DEFAULT 0
);

CREATE INDEX deliveries_pending ON deliveries (id) WHERE state = 'pending';
CREATE INDEX deliveries_of_job ON deliveries (job_id);

CREATE TABLE delivery_attempts (
    delivery    TEXT COLLATE "C" NOT NULL REFERENCES deliveries (id) ON DELETE CASCADE,
    number      BIGINT NOT NULL,
    at_ms       BIGINT NOT NULL,
    duration_ms BIGINT NOT NULL,
    status      BIGINT,
    error       TEXT,
    PRIMARY KEY (delivery, number)
);

CREATE FUNCTION forget_deliveries() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    DELETE FROM deliveries WHERE job_id = OLD.id AND state <> 'pending';
    RETURN NULL;
END
$$;

CREATE TRIGGER deliveries_of_deleted_jobs AFTER DELETE ON jobs
    FOR EACH ROW EXECUTE FUNCTION forget_deliveries();
