-- Leases and pauses are measured by the machine's time since its start, which
-- nobody sets: lease_until_ms and not_before_ms are milliseconds of the start
-- that `boot` names. Those of another start, and of before, are over.
ALTER TABLE jobs ADD COLUMN boot TEXT NOT NULL DEFAULT '';
-- Claims that the machine broke off, not the job: given back, but not for ever.
ALTER TABLE jobs ADD COLUMN troubles INTEGER NOT NULL DEFAULT 0;

-- Jobs without a row whose stored bytes may be deleted: those that are being
-- uploaded and those that were deleted. Bytes of any other job that has no row
-- are of another database, or of a later state of this one, and are kept.
CREATE TABLE ownerless (
    job_id TEXT    NOT NULL PRIMARY KEY,
    boot   TEXT    NOT NULL,
    at_ms  INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
