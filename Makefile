# The two commands of the README, and what builders use besides.

.PHONY: run test check lint docs openapi

# Install, build, start the service, send it a sample sheet, fetch the results.
run:
	@scripts/install-prerequisites
	cargo build --release --locked
	@scripts/run-sample

# Install what the tests need and run all of them.
test:
	@scripts/install-prerequisites
	cargo test --workspace --locked --lib --bins --tests
	cargo test --workspace --locked --doc

check: lint docs test

lint:
	cargo fmt --all --check
	cargo clippy --workspace --locked --all-targets -- -D warnings

docs:
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --locked --no-deps

# Write the API description again after a change to the interface.
openapi:
	cargo run --locked -- openapi > api/openapi.json
