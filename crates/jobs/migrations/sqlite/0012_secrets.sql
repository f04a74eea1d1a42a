-- What the service signs with for itself, made at first use: a name and 256
-- random bits in lower-case hexadecimal.
CREATE TABLE secrets (
    name   TEXT NOT NULL PRIMARY KEY,
    secret TEXT NOT NULL
) STRICT, WITHOUT ROWID;
