//! The corpus of the fuzz targets: each file is answered, by what it says or by an error that names it.

use std::path::Path;

#[path = "../../fuzz/readers.rs"]
mod readers;

/// Reads every file of a target's corpus as the target would.
fn replay(target: &str, read: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(target);
    let mut count = 0;
    for entry in folder.read_dir().expect("the corpus is there") {
        let path = entry.expect("readable").path();
        let bytes = std::fs::read(&path).expect("readable");
        let answer = std::panic::catch_unwind(|| read(&bytes));
        assert!(answer.is_ok(), "{} is not answered", path.display());
        count += 1;
    }
    assert!(count >= 10, "{count} files");
}

#[test]
fn hostile_scene_files_are_answered() {
    replay("scene", readers::scene);
}

#[test]
fn hostile_obj_files_are_answered() {
    replay("obj", readers::obj);
}

#[test]
fn hostile_mtl_files_are_answered() {
    replay("mtl", readers::mtl);
}

#[test]
fn hostile_exr_images_are_answered() {
    replay("exr", readers::exr);
}

#[test]
fn hostile_checkpoints_are_answered() {
    replay("checkpoint", readers::checkpoint);
}
