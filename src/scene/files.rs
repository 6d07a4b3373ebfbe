//! Reading whole files with a limit on their size.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The bytes of `file`. Errors if there are more than `limit`: a device that never ends does not fill the memory.
pub(super) fn read_at_most(file: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(file)?
        .take(limit.saturating_add(1))
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("larger than the limit of {limit} bytes"),
        ));
    }
    Ok(bytes)
}
