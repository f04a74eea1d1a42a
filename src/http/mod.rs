//! The HTTP interface: resources over the job store and the byte store.
