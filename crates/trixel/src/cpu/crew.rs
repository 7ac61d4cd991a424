//! The threads that work on one grid: whoever calls, and others from a pool.
//!
//! The caller works too, rather than wait for as many others: one thread less has to be woken, which takes time. Where a
//! waiting caller and two workers took turns on two processors, the system often woke the second worker on the first one's.

/// A pool, or whichever the caller is in.
pub(super) struct Crew<'a> {
    pool: Option<&'a rayon::ThreadPool>,
}

impl<'a> Crew<'a> {
    pub(super) fn new(pool: Option<&'a rayon::ThreadPool>) -> Self {
        Self { pool }
    }

    /// The threads, the caller's included.
    pub(super) fn count(&self) -> usize {
        self.pool.map_or_else(rayon::current_num_threads, rayon::ThreadPool::current_num_threads)
    }

    /// Does `work` here, which may give others some, and waits until all has been done. Others may begin late where the pool is
    /// busy, even after all that matters is done; a caller from the pool itself may have to do theirs, one after the other.
    pub(super) fn scope<'scope, R>(&self, work: impl FnOnce(&rayon::Scope<'scope>) -> R) -> R {
        match self.pool {
            Some(pool) => pool.in_place_scope(work),
            None => rayon::in_place_scope(work),
        }
    }
}
