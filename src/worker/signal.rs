//! Tells a running attempt to stop, and why.

use std::sync::atomic::{AtomicU8, Ordering};

/// Why an attempt should stop, the weakest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub(super) enum StopReason {
    /// The worker stops: put the job back.
    Shutdown = 1,
    /// The job has run for as long as one may.
    TimeLimit = 2,
    /// The user cancelled the job.
    Cancel = 3,
    /// The lease is lost: nothing may be written any more.
    LeaseLost = 4,
}

/// Tells a running attempt to stop. A stronger reason replaces a weaker one.
#[derive(Debug, Default)]
pub(super) struct Signal(AtomicU8);

impl Signal {
    pub(super) fn stop(&self, reason: StopReason) {
        self.0.fetch_max(reason as u8, Ordering::SeqCst);
    }

    pub(super) fn reason(&self) -> Option<StopReason> {
        match self.0.load(Ordering::SeqCst) {
            0 => None,
            1 => Some(StopReason::Shutdown),
            2 => Some(StopReason::TimeLimit),
            3 => Some(StopReason::Cancel),
            _ => Some(StopReason::LeaseLost),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_reason_stays() {
        let signal = Signal::default();
        assert_eq!(signal.reason(), None);
        for (given, then) in [
            (StopReason::Shutdown, StopReason::Shutdown),
            (StopReason::LeaseLost, StopReason::LeaseLost),
            (StopReason::Cancel, StopReason::LeaseLost),
        ] {
            signal.stop(given);
            assert_eq!(signal.reason(), Some(then));
        }
    }
}
