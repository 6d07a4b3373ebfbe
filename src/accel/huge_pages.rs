//! Large pages for what is large: the system hands them out at a fraction of the cost, and a traversal of a tree
//! of gigabytes misses the processor's page tables otherwise at nearly every step.

use bytemuck::Zeroable;

/// So many zeros. Their memory is on large pages where the system has them, and is touched only when it is
/// written.
pub(super) fn zeroed<T: Zeroable>(length: usize) -> Vec<T> {
    let mut vector = bytemuck::zeroed_vec(length);
    advise(&mut vector);
    vector
}

/// Asks the system to put memory on large pages, what of it is not touched yet. Without effect where the system
/// has none.
fn advise<T>(memory: &mut [T]) {
    #[cfg(target_os = "linux")]
    {
        #![expect(unsafe_code, reason = "the system call takes an address")]
        /// Less memory fits few pages of any size.
        const LEAST: usize = 1 << 21;
        const PAGE: usize = 4096;
        let bytes = std::mem::size_of_val(memory);
        let start = (memory.as_mut_ptr() as usize).next_multiple_of(PAGE);
        if bytes >= LEAST {
            // SAFETY: the range lies within memory that is borrowed; the advice changes how the system maps
            // it, not what it holds. A failure leaves everything as it was.
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
    let _ = memory;
}
