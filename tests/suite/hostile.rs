//! The corpus of the fuzz targets: each file is answered, by what it says or by an error that names it.

use std::path::Path;

use rand_core::Rng;
use rand_pcg::Pcg32;

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

/// Inputs that are tried unless `WAVEPATH_MUTATIONS` says how many.
const MUTATIONS: u64 = 1500;

/// Numbers at which something may go over.
const NUMBERS: [u64; 12] = [
    0,
    1,
    2,
    3,
    64,
    1 << 31,
    1 << 40,
    1 << 53,
    i64::MAX as u64,
    u64::MAX,
    f64::NAN.to_bits(),
    f64::MAX.to_bits(),
];

/// A number below `end` > 0.
fn below(random: &mut Pcg32, end: usize) -> usize {
    random.next_u64() as usize % end
}

/// Another checkpoint: with a number of its header, a word after it, a bit or a stretch replaced.
fn mutate(bytes: &mut Vec<u8>, random: &mut Pcg32) {
    let number = NUMBERS[below(random, NUMBERS.len())];
    let header = bytes.get(12..16).map_or(0, |length| {
        u32::from_le_bytes(length.try_into().expect("four bytes")) as usize
    });
    let end = 16usize.saturating_add(header).min(bytes.len());
    let place = below(random, bytes.len().max(1));
    match random.next_u32() % 5 {
        0 if end > 16 => {
            let from = 16 + below(random, end - 16);
            let digits = |byte: &u8| byte.is_ascii_digit();
            if let Some(start) = bytes[from..end].iter().position(digits) {
                let start = from + start;
                let length = bytes[start..end].iter().take_while(|b| digits(b)).count();
                bytes.splice(start..start + length, number.to_string().into_bytes());
            }
        }
        1 if bytes.len() > end + 16 => {
            let word = end + 4 + 8 * below(random, (bytes.len() - end - 8) / 8);
            bytes[word..word + 8].copy_from_slice(&number.to_le_bytes());
        }
        2 if !bytes.is_empty() => bytes[place] ^= 1 << (random.next_u32() % 8),
        3 => {
            drop(bytes.drain(place.min(bytes.len())..(place + below(random, 64)).min(bytes.len())))
        }
        _ => {
            let stretch = bytes[place..(place + below(random, 64)).min(bytes.len())].to_vec();
            bytes.splice(place..place, stretch);
        }
    }
}

#[test]
fn mutated_checkpoints_are_answered() {
    let count = std::env::var("WAVEPATH_MUTATIONS")
        .map_or(MUTATIONS, |count| count.parse().expect("a number"));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/checkpoint");
    let mut paths: Vec<_> = folder
        .read_dir()
        .expect("the corpus is there")
        .map(|entry| entry.expect("readable").path())
        .collect();
    paths.sort();
    let corpus: Vec<Vec<u8>> = paths
        .iter()
        .map(|path| std::fs::read(path).expect("readable"))
        .collect();
    for seed in 0..count {
        let mut random = Pcg32::new(seed, 1);
        let mut bytes = corpus[below(&mut random, corpus.len())].clone();
        for _ in 0..1 + random.next_u32() % 3 {
            mutate(&mut bytes, &mut random);
        }
        let answer = std::panic::catch_unwind(|| readers::checkpoint(&bytes));
        assert!(
            answer.is_ok(),
            "the mutation of seed {seed} is not answered"
        );
    }
}
