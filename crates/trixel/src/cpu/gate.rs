//! Two steps of work without waking threads between them: nobody begins the second before all have ended the first.
//!
//! Only threads that are at work are waited for, never those that have not begun: a pool that is busy with other things may
//! run all shares on one thread, one after the other.

use std::sync::atomic::{AtomicU32, Ordering};

/// Between the first step and the second.
pub(super) struct Gate {
    /// Threads in the first step, or [`Self::OPEN`].
    state: AtomicU32,
}

impl Gate {
    /// Nobody may begin the first step any more.
    const OPEN: u32 = u32::MAX;

    /// Closed: the second step has not begun.
    pub(super) fn new() -> Self {
        Self { state: AtomicU32::new(0) }
    }

    /// Does the first step, if the second has not begun without this thread, and waits until nobody else is at it.
    pub(super) fn pass(&self, first_step: impl FnOnce()) {
        /// Rounds to wait before others get the processor.
        const SPINS: u32 = 1 << 10;
        let enter = |state| (state != Self::OPEN).then(|| state + 1);
        if self.state.fetch_update(Ordering::AcqRel, Ordering::Acquire, enter).is_err() {
            return;
        }
        {
            let _inside = Inside(&self.state);
            first_step();
        }
        let mut rounds = 0u32;
        // Whoever finds nobody at the first step opens.
        while let Err(state) = self.state.compare_exchange(0, Self::OPEN, Ordering::AcqRel, Ordering::Acquire)
            && state != Self::OPEN
        {
            rounds += 1;
            if rounds.is_multiple_of(SPINS) {
                std::thread::yield_now();
            } else {
                std::hint::spin_loop();
            }
        }
    }
}

/// A thread in the first step. It leaves even by a panic, for which the others would wait forever.
struct Inside<'a>(&'a AtomicU32);

impl Drop for Inside<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;

    #[test]
    fn nobody_passes_before_all_that_began_have_ended() {
        for threads in [1, 2, 5] {
            let (gate, begun, ended) = (Gate::new(), AtomicUsize::new(0), AtomicUsize::new(0));
            std::thread::scope(|scope| {
                for _ in 0..threads {
                    scope.spawn(|| {
                        gate.pass(|| {
                            begun.fetch_add(1, Ordering::SeqCst);
                            std::thread::yield_now();
                            ended.fetch_add(1, Ordering::SeqCst);
                        });
                        assert_eq!(begun.load(Ordering::SeqCst), ended.load(Ordering::SeqCst));
                    });
                }
            });
        }
    }

    #[test]
    fn nobody_waits_for_a_thread_that_panicked() {
        let gate = Gate::new();
        let panicked = std::thread::scope(|scope| scope.spawn(|| gate.pass(|| panic!("of the test"))).join());
        assert!(panicked.is_err());
        // Would spin for ever if the other still counted.
        assert_eq!(gate.state.load(Ordering::SeqCst), 0);
        gate.pass(|| ());
    }

    #[test]
    fn who_comes_too_late_does_not_begin() {
        let gate = Gate::new();
        let mut times = 0;
        for _ in 0..3 {
            gate.pass(|| times += 1);
        }
        assert_eq!(times, 1);
    }
}
