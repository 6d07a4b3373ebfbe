//! Large pages for what is read all over: a traversal of a tree of gigabytes misses the processor's
//! page tables otherwise at nearly every step.

/// Asks the system to put the memory that `vector` has reserved and not yet touched on large pages.
/// Without effect where the system has none.
pub(super) fn advise<T>(vector: &mut Vec<T>) {
    #[cfg(target_os = "linux")]
    {
        #![expect(unsafe_code, reason = "the system call takes an address")]
        /// Smaller vectors fit few pages of any size.
        const LEAST: usize = 1 << 22;
        const PAGE: usize = 4096;
        let spare = vector.spare_capacity_mut();
        let bytes = std::mem::size_of_val(spare);
        let start = (spare.as_mut_ptr() as usize).next_multiple_of(PAGE);
        if bytes >= LEAST {
            // SAFETY: the range lies within memory that this vector owns; the advice changes how the
            // system maps it, not what it holds. A failure leaves everything as it was.
            unsafe {
                libc::madvise(
                    start as *mut libc::c_void,
                    bytes - PAGE,
                    libc::MADV_HUGEPAGE,
                );
            }
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = vector;
}
