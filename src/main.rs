//! The program: turns a result into an exit code, nothing else.

use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    match wavepath::cli::run(std::env::args_os()) {
        Ok(status) => status.into(),
        Err(error) => {
            // Nobody is left to tell if standard error is closed.
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::from(wavepath::cli::BAD_INPUT)
        }
    }
}
