//! The service as a process, in trouble: what the machine, people and clients do
//! to one that runs unattended, a file a matter.

mod full_disk;
mod homes;
mod isolation;
mod keys;
pub(crate) mod process;
mod settings;
mod stopping;
mod webhooks;
