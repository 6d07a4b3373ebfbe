//! The process's peak memory.

use crate::film::memory::bytes_field;

/// Most bytes that the process ever held in memory. `None` where the system does not say.
pub fn peak_memory() -> Option<u64> {
    status("VmHWM:")
}

/// Bytes that the system states of this process under `name`, with its colon.
pub(super) fn status(name: &str) -> Option<u64> {
    bytes_field(&std::fs::read_to_string("/proc/self/status").ok()?, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_memory_includes_what_was_touched() {
        let touched = std::hint::black_box(vec![1u8; 32 << 20]);
        assert!(peak_memory().unwrap() >= touched.len() as u64);
    }
}
