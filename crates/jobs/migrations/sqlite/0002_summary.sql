-- What a succeeded job came to, in a few values.
ALTER TABLE jobs ADD COLUMN summary TEXT;
