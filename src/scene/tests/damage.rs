//! Damaged files give errors, never panics.

use proptest::prelude::{Just, any, prop, prop_assert, prop_oneof, proptest};
use proptest::strategy::Strategy as Generate;
use proptest::test_runner::{Config as ProptestConfig, RngSeed};

use super::*;

/// Replaces bytes (positions wrap around) and cuts the text.
fn mutate(text: &str, changes: &[(usize, u8)], cut: Option<usize>) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for &(position, byte) in changes {
        let position = position % bytes.len();
        bytes[position] = byte;
    }
    bytes.truncate(cut.map_or(usize::MAX, |cut| cut % bytes.len()));
    bytes
}

fn mutations() -> impl Generate<Value = (Vec<(usize, u8)>, Option<usize>)> {
    let byte = prop_oneof![
        any::<u8>(),
        prop::sample::select(&b"0123456789-./= \n[]\"ef"[..])
    ];
    let cut = prop_oneof![3 => Just(None), 1 => any::<usize>().prop_map(Some)];
    (prop::collection::vec((any::<usize>(), byte), 0..6), cut)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 512,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_damaged_scene_never_panics((changes, cut) in mutations()) {
        let text = include_str!("../../../scenes/hexroom.toml");
        let bytes = mutate(text, &changes, cut);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.toml");
        fs::write(&path, bytes).unwrap();
        if let Err(error) = load(&path, &[]) {
            let place = error.place.expect("an error in a file has a place");
            prop_assert!(place.line.is_some() && place.column.is_some());
        }
    }

    #[test]
    fn a_damaged_obj_file_never_panics((changes, cut) in mutations()) {
        let bytes = mutate(TETRAHEDRON, &changes, cut);
        if let Err(error) = load_obj(&bytes, "") {
            prop_assert!(error.place.is_some());
        }
    }
}
