//! Stored bytes: uploaded inputs and published artifacts.
