-- There is a row once a key was ever made: from then on requests need one, also
-- when none is left, until somebody says otherwise. Written by a trigger, so that
-- nodes of the version before write it too.
CREATE TABLE closed (since_ms BIGINT NOT NULL);

CREATE FUNCTION close_by_a_key() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO closed SELECT NEW.created_ms WHERE NOT EXISTS (SELECT 1 FROM closed);
    RETURN NULL;
END
$$;

CREATE TRIGGER closed_by_a_key AFTER INSERT ON keys
    FOR EACH ROW EXECUTE FUNCTION close_by_a_key();

-- Last: whoever makes a key meanwhile waits for the trigger's lock, or is seen here.
INSERT INTO closed SELECT min(created_ms) FROM keys HAVING count(*) > 0;
