-- What people call a job, and what they find it by: a JSON object of texts.
ALTER TABLE jobs ADD COLUMN name TEXT;
ALTER TABLE jobs ADD COLUMN labels TEXT NOT NULL DEFAULT '{}';
-- When it is deleted by itself, unless it is pinned.
ALTER TABLE jobs ADD COLUMN expires_ms INTEGER;
ALTER TABLE jobs ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));
-- Somebody asked to delete it while it ran: it goes when its attempt has ended.
ALTER TABLE jobs ADD COLUMN delete_requested INTEGER NOT NULL DEFAULT 0;

CREATE INDEX jobs_that_expire ON jobs (expires_ms) WHERE expires_ms IS NOT NULL AND pinned = 0;
