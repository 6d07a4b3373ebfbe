//! Records the commit that the binary was built from, for the report of a render.
use std::path::Path;
use std::process::Command;

fn main() {
    // The sources too: what is built from changed ones must say that it is.
    for path in ["build.rs", "Cargo.toml", "src"] {
        println!("cargo:rerun-if-changed={path}");
    }
    // Without a repository, as in an archive of the sources, there is nothing more to watch.
    for file in ["HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--git-path", file])
            && Path::new(&path).exists()
        {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let commit = git(&["describe", "--always", "--dirty", "--abbrev=12"])
        .unwrap_or_else(|| "unknown".to_owned());
    println!("cargo:rustc-env=WAVEPATH_COMMIT={commit}");
    println!("cargo:rustc-env=WAVEPATH_COMPILER={}", compiler());
    println!(
        "cargo:rustc-env=WAVEPATH_TARGET_FEATURES={}",
        std::env::var("CARGO_CFG_TARGET_FEATURE").unwrap_or_default()
    );
}

/// The compiler's name and version.
fn compiler() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or("rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    let text = output
        .ok()
        .and_then(|output| String::from_utf8(output.stdout).ok());
    text.map_or_else(|| "unknown".to_owned(), |text| text.trim().to_owned())
}

/// What git prints for `arguments`, if it is there and in a repository.
fn git(arguments: &[&str]) -> Option<String> {
    // No optional locks: a refreshed index would count as changed at the next build.
    let mut command = Command::new("git");
    let output = command
        .arg("--no-optional-locks")
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
