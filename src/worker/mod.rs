//! The worker pool: claims jobs, runs them on blocking threads, keeps their leases.
