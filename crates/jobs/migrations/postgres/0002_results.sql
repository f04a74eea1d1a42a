-- What a job's result depends on, hashed; NULL of jobs from before.
ALTER TABLE jobs ADD COLUMN result_key TEXT COLLATE "C";
-- The job whose result it was answered with.
ALTER TABLE jobs ADD COLUMN reused_from TEXT COLLATE "C";
-- The request that it came with.
ALTER TABLE jobs ADD COLUMN request_id TEXT;

CREATE INDEX jobs_by_result ON jobs (tenant, result_key)
    WHERE state = 'succeeded' AND result_key IS NOT NULL;
