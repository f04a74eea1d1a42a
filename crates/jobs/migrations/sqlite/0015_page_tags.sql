-- What people call a page and find it by, as of jobs; whether it stays although
-- its time is over.
ALTER TABLE pages ADD COLUMN name TEXT;
ALTER TABLE pages ADD COLUMN labels TEXT NOT NULL DEFAULT '{}';
ALTER TABLE pages ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));
-- Counts the changes of these: `version` is that of the content, under which its
-- files lie.
ALTER TABLE pages ADD COLUMN tags_version INTEGER NOT NULL DEFAULT 0;
