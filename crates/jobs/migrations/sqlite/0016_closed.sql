-- There is a row once a key was ever made: from then on requests need one, also
-- when none is left, until somebody says otherwise.
CREATE TABLE closed (since_ms INTEGER NOT NULL) STRICT;

INSERT INTO closed SELECT min(created_ms) FROM keys HAVING count(*) > 0;

CREATE TRIGGER closed_by_a_key AFTER INSERT ON keys BEGIN
    INSERT INTO closed SELECT NEW.created_ms WHERE NOT EXISTS (SELECT 1 FROM closed);
END;
