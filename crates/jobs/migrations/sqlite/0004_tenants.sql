-- Whose jobs are kept apart. Names are lower-case words.
CREATE TABLE tenants (
    name       TEXT    NOT NULL PRIMARY KEY,
    created_ms INTEGER NOT NULL,
    -- What of the service's limits is otherwise for this tenant, JSON.
    limits     TEXT    NOT NULL DEFAULT '{}',
    -- Number of its latest claim among all claims: who was served longest ago
    -- is served next.
    served     INTEGER NOT NULL DEFAULT 0
) STRICT, WITHOUT ROWID;

INSERT INTO tenants (name, created_ms) VALUES ('default', 0);

CREATE TABLE keys (
    -- The readable first part of the key.
    id         TEXT    NOT NULL PRIMARY KEY,
    tenant     TEXT    NOT NULL REFERENCES tenants (name) ON DELETE CASCADE,
    label      TEXT    NOT NULL,
    scope      TEXT    NOT NULL CHECK (scope IN ('read', 'write', 'admin')),
    -- SHA-256 of the whole key, lower-case hexadecimal.
    hash       TEXT    NOT NULL,
    created_ms INTEGER NOT NULL,
    revoked_ms INTEGER
) STRICT, WITHOUT ROWID;

-- Jobs from before tenants belong to the default one.
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
-- Higher is claimed first, within a tenant.
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;

CREATE INDEX jobs_of_tenant ON jobs (tenant, kind, id);
CREATE INDEX jobs_waiting ON jobs (tenant, priority DESC) WHERE state = 'queued';
CREATE INDEX jobs_at_work ON jobs (tenant) WHERE state = 'running';
