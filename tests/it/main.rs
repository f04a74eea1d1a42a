//! The service and its parts from outside, in one program.

mod api;
mod documents;
mod farm;
mod faults;
mod layers;
mod model_regressions;
mod service_crash;
mod traces;
mod watching;
mod worker;

/// A client of services on the loopback.
fn client() -> reqwest::Client {
    // `reqwest` leaves the choice to the program, also where there is no TLS.
    let _ = rustls::crypto::ring::default_provider().install_default();
    reqwest::Client::builder().no_proxy().build().unwrap()
}
