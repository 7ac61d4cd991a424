//! Asking for memory before it is needed, which changes nothing but the time.

/// Whether there is a way to ask.
pub(super) const POSSIBLE: bool = cfg!(target_arch = "x86_64");

/// Asks for the cache line in which item `i` begins: of an item that is not there, for nothing of use.
#[inline(always)]
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_variables, reason = "not asked for elsewhere"))]
pub(super) fn prefetch<T>(items: &[T], i: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let at = items.as_ptr().wrapping_add(i);
        // SAFETY: every x86-64 has the instruction; it reads nothing, and may be given any address.
        #[expect(unsafe_code, reason = "there is no safe way to say it")]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(at.cast());
        }
    }
}
