-- Pages of drawings whose figures clients look at and put right. Their files lie
-- among the inputs under the page's own name.
CREATE TABLE pages (
    id         TEXT    NOT NULL PRIMARY KEY,
    tenant     TEXT    NOT NULL REFERENCES tenants (name),
    -- What was found and put right, as the interface wrote it.
    content    TEXT    NOT NULL,
    -- Counts changes, from 1.
    version    INTEGER NOT NULL CHECK (version >= 1),
    created_ms INTEGER NOT NULL,
    changed_ms INTEGER NOT NULL
) STRICT;
