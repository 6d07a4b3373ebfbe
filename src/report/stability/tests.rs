//! Every case with the samples of a test, and what the command asks of the list of cases.

use std::collections::HashSet;

use super::*;

/// Runs the case of this function's name, `_` for `-`.
fn passes(function: &str) {
    let settings = StabilitySettings {
        cases: vec![function.replace('_', "-")],
        effort: Effort::Test,
        threads: 2,
        ..StabilitySettings::default()
    };
    let report = run(&settings, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"));
    assert!(!report.findings.is_empty());
    // Times are for the command alone: a test must not depend on what else the machine does.
    let wrong = report
        .failures()
        .any(|finding| finding.unit != Unit::TimeRatio);
    assert!(!wrong, "{report}");
}

/// A test per case, and their names.
macro_rules! cases_pass {
    ($($name:ident),* $(,)?) => {
        $(#[test] fn $name() { passes(stringify!($name)); })*
        const TESTED: &[&str] = &[$(stringify!($name)),*];
    };
}

cases_pass! {
    vertices,
    axes,
    closed_room,
    self_hits,
    convex_neighbours,
    tiny_spheres,
    tiny_flat_lights,
    touching_light,
    mis_weights,
    furnace,
    lit_furnace,
    scaled_furnace,
    same_picture,
    film_sums,
    invalid_rays,
    sampling,
    long_paths,
    perfect_mirrors,
    roulette,
    light_ends,
    far_spheres,
    leaving_spheres,
    ground_sphere,
    needles,
    needle_fan,
    broken_faces,
    garbage,
    duplicates,
    depths,
    same_hits,
    same_bits,
    reference,
    total_reflection,
    equal_indices,
    glass_sphere,
    smallest_gap,
    thin_plates,
    nested_glass,
    frames,
    oren_nayar,
    phong,
    schlick,
    reciprocity,
    energy,
    behind_glass,
    random_numbers,
    unit_ends,
    light_choice,
    many_lights,
    small_scenes,
    eyes,
    limits,
    counters,
    coverage,
    picture_sizes,
    normals,
    bad_reflectances,
    queue_sizes,
    all_or_none,
    denormals,
    whitted,
}

#[test]
fn every_case_has_a_test_and_a_name_of_its_own() {
    let names: HashSet<&str> = CASES.iter().map(|case| case.name).collect();
    assert_eq!(names.len(), CASES.len());
    let tested: HashSet<String> = TESTED.iter().map(|name| name.replace('_', "-")).collect();
    assert!(names.iter().all(|name| tested.contains(*name)));
    assert!(CASES.is_sorted_by_key(|case| case.row));
}

#[test]
fn names_choose_and_unknown_ones_are_refused_with_the_known() {
    let named = |name: &str| vec![name.to_owned()];
    assert_eq!(cases(&[]).unwrap().len(), CASES.len());
    assert_eq!(cases(&named("needles")).unwrap()[0].row, 23);
    assert_eq!(structures(&named("bvh8")).unwrap(), [Structure::Bvh8]);
    let message = cases(&named("needle")).unwrap_err().message;
    assert!(
        message.contains("\"needle\"") && message.contains("needles"),
        "{message}"
    );
    let message = structures(&named("bvh9")).unwrap_err().message;
    assert!(
        message.contains("\"bvh9\"") && message.contains("bvh8"),
        "{message}"
    );
}
