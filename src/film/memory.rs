//! Refuses a film that the machine cannot hold, before it is allocated.

use crate::error::{Error, Result};

use super::{Film, openexr};

/// Errors with [`ErrorKind::Limit`](crate::ErrorKind::Limit) if a film of this size with `halves` halves, and the images
/// written from it, need more memory than the machine has available. Where the machine does not
/// say, nothing is refused.
pub fn check_memory(width: u32, height: u32, aux: bool, halves: u64) -> Result<()> {
    available_bytes().map_or(Ok(()), |available| {
        check_against(width, height, aux, halves, available)
    })
}

fn check_against(width: u32, height: u32, aux: bool, halves: u64, available: u64) -> Result<()> {
    let needed =
        halves * Film::bytes(width, height, aux) + openexr::write_bytes(width, height, aux);
    if needed <= available {
        return Ok(());
    }
    Err(Error::limit(format!(
        "an image of {width} × {height} pixels needs {} of memory, and {} are available",
        gibibytes(needed),
        gibibytes(available),
    )))
}

fn gibibytes(bytes: u64) -> String {
    format!("{:.2} GiB", bytes as f64 / f64::from(1 << 30))
}

/// Bytes that can be allocated without swapping: the kernel's estimate, or the limit of the
/// process's control group where that is smaller. `None` where neither can be read.
pub(crate) fn available_bytes() -> Option<u64> {
    let machine = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .as_deref()
        .and_then(|text| bytes_field(text, "MemAvailable:"));
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max")
        .ok()
        .and_then(|text| text.trim().parse().ok());
    machine.into_iter().chain(group).min()
}

/// A size in a file of `/proc`, where a line is `name: <number> kB`, in bytes.
pub(crate) fn bytes_field(text: &str, name: &str) -> Option<u64> {
    let value = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = value.trim().strip_suffix("kB")?.trim_end().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn sizes_in_kibibytes_are_read_in_bytes() {
        let text = "MemTotal:  16 kB\nMemFree: 1 kB\nMemAvailable:    8123 kB\n";
        assert_eq!(bytes_field(text, "MemAvailable:"), Some(8123 * 1024));
        assert_eq!(bytes_field("MemTotal: 16 kB\n", "MemAvailable:"), None);
    }

    #[test]
    fn too_large_an_image_is_refused_with_both_numbers() {
        let error = check_against(16384, 16384, true, 1, 8 << 30).unwrap_err();
        assert_eq!(error.kind, ErrorKind::Limit);
        assert!(error.message.contains("16384 × 16384"), "{error}");
        assert!(error.message.contains("8.00 GiB are available"), "{error}");
    }

    #[test]
    fn limit_is_exactly_what_is_needed() {
        for halves in [1, 2] {
            let film = halves * Film::bytes(64, 64, false);
            let needed = film + openexr::write_bytes(64, 64, false);
            assert!(check_against(64, 64, false, halves, needed).is_ok());
            assert!(check_against(64, 64, false, halves, needed - 1).is_err());
        }
    }

    #[test]
    fn sizes_do_not_overflow() {
        assert!(check_against(u32::MAX, 65_535, true, 2, u64::MAX >> 7).is_ok());
    }
}
