-- Bytes stored under the name of a job or page: what was sent, and the artifacts
-- of a job that succeeded. NULL until they are measured: of rows from before.
ALTER TABLE jobs ADD COLUMN bytes INTEGER;
ALTER TABLE pages ADD COLUMN bytes INTEGER;
-- When a page is deleted by itself.
ALTER TABLE pages ADD COLUMN expires_ms INTEGER;

CREATE INDEX jobs_by_bytes ON jobs (tenant, bytes);
CREATE INDEX pages_by_bytes ON pages (tenant, bytes);
CREATE INDEX jobs_by_end ON jobs (finished_ms) WHERE finished_ms IS NOT NULL;
