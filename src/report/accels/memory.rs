//! Memory that a build takes at its height.

use std::fs;

use crate::report::memory::{peak_memory, status};

/// What `build` returns, and the most bytes by which the process's resident memory was larger while it
/// ran than before; `None` where the system does not tell.
pub(super) fn peak_growth<R>(build: impl FnOnce() -> R) -> (R, Option<u64>) {
    release_freed();
    // Linux: writing 5 sets the peak to the present size (proc(5), /proc/[pid]/clear_refs).
    let reset = fs::write("/proc/self/clear_refs", "5").is_ok();
    let before = status("VmRSS:");
    let result = build();
    let after = peak_memory().filter(|_| reset);
    let growth = before
        .zip(after)
        .map(|(before, after)| after.saturating_sub(before));
    (result, growth)
}

/// Lets the allocator give every large allocation back to the system as soon as it is freed, from now on,
/// so that [`peak_growth`] sees what later builds take. By default it keeps up to 64 MiB per thread.
pub(super) fn keep_no_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        #![expect(unsafe_code, reason = "the standard library has no such call")]
        /// Bytes from which on an allocation is the system's own.
        const LARGE: libc::c_int = 1 << 18;
        // SAFETY: sets a parameter of the allocator; it may be called at any time.
        unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE) };
    }
}

/// Gives freed memory back to the system: what a build reuses of it would not be counted.
fn release_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        #![expect(unsafe_code, reason = "the standard library has no such call")]
        // SAFETY: may be called at any time; it changes no allocation that is in use.
        unsafe { libc::malloc_trim(0) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    const ALONE: &str = "WAVEPATH_TEST_ALONE";

    /// In a process of its own: what other tests free meanwhile would be missing from the growth.
    #[test]
    fn what_is_touched_and_freed_counts() {
        if std::env::var_os(ALONE).is_none() {
            let path = concat!(module_path!(), "::what_is_touched_and_freed_counts");
            let (_crate, name) = path.split_once("::").unwrap();
            let output = Command::new(std::env::current_exe().unwrap())
                .args(["--exact", name])
                .env(ALONE, "1")
                .output()
                .unwrap();
            let text = String::from_utf8_lossy(&output.stdout);
            assert!(
                output.status.success() && text.contains("1 passed"),
                "{text}{}",
                String::from_utf8_lossy(&output.stderr)
            );
            return;
        }
        let (sum, growth) = peak_growth(|| {
            let touched = vec![1u8; 64 << 20];
            std::hint::black_box(&touched)
                .iter()
                .map(|&x| u64::from(x))
                .sum::<u64>()
        });
        assert_eq!(sum, 64 << 20);
        if let Some(growth) = growth {
            assert!(growth >= 63 << 20, "{growth}");
        }
    }
}
