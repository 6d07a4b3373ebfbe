//! Cache lines asked for before they are needed.

/// Asks for the cache line of `column[index]`; without effect past the end, and where the machine has no
/// such instruction.
#[inline(always)]
pub fn prefetch<T>(column: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        #![expect(unsafe_code, reason = "the instruction takes an address")]
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: prefetching reads nothing that the program can see and never faults, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(column.as_ptr().wrapping_add(index).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (column, index);
}
