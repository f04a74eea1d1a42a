-- Whether the bytes of a job or page lie below its tenant's prefix; otherwise they
-- lie beside those of all tenants, as all did before. Nodes of the version before
-- look there alone, and set nothing here.
ALTER TABLE jobs ADD COLUMN by_tenant BIGINT NOT NULL DEFAULT 0 CHECK (by_tenant IN (0, 1));
ALTER TABLE pages ADD COLUMN by_tenant BIGINT NOT NULL DEFAULT 0 CHECK (by_tenant IN (0, 1));
