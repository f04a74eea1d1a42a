# The two commands of the README, and what builders use besides.

.PHONY: run test check lint lint-api docs openapi web

# Install, build, start the service, send it a sample sheet, fetch the results.
run:
	@scripts/install-prerequisites
	@$(MAKE) --no-print-directory web
	cargo build --release --locked
	@scripts/run-sample

# Install what the tests need and run all of them.
test:
	@scripts/install-prerequisites test
	@$(MAKE) --no-print-directory web
	cargo test --workspace --locked --lib --bins --tests
	cargo test --workspace --locked --doc
	cd web && npm run --silent check && npm test && npm run --silent e2e
	scripts/test-clients

# Build the web page, which the service holds inside of itself.
web: web/node_modules/.package-lock.json
	cd web && npm run --silent build

web/node_modules/.package-lock.json: web/package-lock.json
	cd web && npm ci --no-audit --no-fund

check: lint docs test

lint:
	cargo fmt --all --check
	cargo clippy --workspace --locked --all-targets -- -D warnings

docs:
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --locked --no-deps

# Hold the API description against the rules of Redocly and Spectral.
lint-api:
	npx --yes @redocly/cli@2 lint --config scripts/redocly.yaml api/openapi.json
	npx --yes @stoplight/spectral-cli@6 lint --ruleset scripts/spectral.yaml --fail-severity warn api/openapi.json

# Write the API description again after a change to the interface.
openapi:
	cargo run --locked -- openapi > api/openapi.json
