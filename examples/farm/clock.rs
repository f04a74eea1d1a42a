//! The clock of one node, which can be set wrong while it runs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Result;

/// Debian's `libfaketime`; the loader puts the machine's folder of libraries in for `$LIB`.
const LIBRARY: &str = "/usr/$LIB/faketime/libfaketimeMT.so.1";

/// A file that says how far the clock of the nodes started with it is off.
pub(crate) struct NodeClock(PathBuf);

impl NodeClock {
    /// A clock that is right.
    pub(crate) fn new(folder: &Path, name: &str) -> Result<Self> {
        let clock = Self(folder.join(format!("clock-{name}")));
        clock.set(0)?;
        Ok(clock)
    }

    /// Puts it `off_s` seconds forward, for processes that run too.
    pub(crate) fn set(&self, off_s: i32) -> Result<()> {
        // In one step: a node may be reading it.
        let next = self.0.with_extension("next");
        fs::write(&next, format!("{off_s:+}"))?;
        Ok(fs::rename(next, &self.0)?)
    }

    /// Lets what `command` starts go by it. Time that only ever passes goes right, as on a
    /// machine whose clock is set.
    pub(crate) fn rule(&self, command: &mut Command) {
        command.env("LD_PRELOAD", LIBRARY).env("FAKETIME_TIMESTAMP_FILE", &self.0);
        command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1").env("FAKETIME_CACHE_DURATION", "1");
    }
}

/// Fails unless clocks can be set wrong here.
pub(crate) fn check() -> Result<()> {
    let asked = Command::new("date")
        .arg("+%s")
        .env("LD_PRELOAD", LIBRARY)
        .env("FAKETIME", "-86400")
        .output()?;
    let told: i64 = String::from_utf8_lossy(&asked.stdout).trim().parse()?;
    let off_s = jiff::Timestamp::now().as_second() - told;
    if off_s < 3600 {
        Err("libfaketime is not installed (Debian: faketime)".into())
    } else {
        Ok(())
    }
}
