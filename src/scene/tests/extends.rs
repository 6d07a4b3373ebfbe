//! Files that build on another.

use super::*;

#[test]
fn a_derived_file_changes_what_it_says_and_keeps_the_rest() {
    let derived = "extends = \"base/valid.toml\"\ncamera = \"plane\"\n\
        [film]\nheight = 9\n\
        [cameras.new]\neye = [1, 0, 0]\nlook_at = [0, 0, 1]\nup = [0, 0, 1]\nfov = 40\n\
        [materials.rough]\ntype = \"mirror\"\n\
        [materials.glass]\nior = 2\n\
        [[shapes]]\ntype = \"sphere\"\nmaterial = \"rough\"\ncenter = [9, 9, 9]\nradius = 2\n\
        [render]\nseed = 3\n";
    let folder = folder(&[("base/valid.toml", VALID), ("derived.toml", derived)]);
    let scene = load(&folder.path().join("derived.toml"), &[]).unwrap();
    assert_eq!((scene.film.width, scene.film.height), (8, 9));
    let cameras: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(cameras, ["plane", "front", "new"]);
    assert_eq!(scene.materials.len(), 5);
    assert!(matches!(
        scene.materials[1].bsdf,
        BsdfDescription::Mirror { .. }
    ));
    assert!(matches!(
        scene.materials[2].bsdf,
        BsdfDescription::Dielectric { ior: 2.0, .. }
    ));
    assert_eq!(scene.shapes.len(), 5);
    assert_eq!(scene.shapes[4].material, MaterialId(1));
    assert_eq!((scene.render.spp, scene.render.seed), (Some(4), Some(3)));
}

#[test]
fn errors_in_a_chain_of_files_point_to_the_right_one() {
    let middle = "extends = \"base.toml\"\n[materials.glass]\nior = -1\n";
    let files = [
        ("base.toml", VALID),
        ("middle.toml", middle),
        ("top.toml", "extends = \"middle.toml\"\n"),
        (
            "healed.toml",
            "extends = \"middle.toml\"\n[materials.glass]\nior = 1.3\n",
        ),
        ("broken.toml", "a = = 1\n"),
        ("on-broken.toml", "extends = \"broken.toml\"\n"),
        ("on-nothing.toml", "# nothing\nextends = \"nothing.toml\"\n"),
        ("number.toml", "extends = 1\n"),
        (
            "conflict.toml",
            "extends = \"base.toml\"\n[materials.glass]\nsigma = 1\n",
        ),
    ];
    let folder = folder(&files);
    let fail = |name: &str| load(&folder.path().join(name), &[]).expect_err(name);
    assert_eq!(place_in(&fail("top.toml"), "middle.toml"), (3, 7));
    assert!(load(&folder.path().join("healed.toml"), &[]).is_ok());
    assert_eq!(place_in(&fail("on-broken.toml"), "broken.toml"), (1, 5));
    assert_eq!(
        place_in(&fail("on-nothing.toml"), "on-nothing.toml"),
        (2, 11)
    );
    assert_eq!(fail("on-nothing.toml").kind, ErrorKind::Io);
    assert_eq!(place_in(&fail("number.toml"), "number.toml"), (1, 11));
    assert_eq!(place_in(&fail("conflict.toml"), "conflict.toml"), (3, 1));
}

#[test]
fn circular_and_endless_chains_are_errors() {
    let mut files = vec![
        (
            "self.toml".to_owned(),
            "extends = \"self.toml\"\n".to_owned(),
        ),
        ("a.toml".to_owned(), "extends = \"b.toml\"\n".to_owned()),
        ("b.toml".to_owned(), "extends = \"./a.toml\"\n".to_owned()),
        ("0.toml".to_owned(), VALID.to_owned()),
    ];
    for i in 1..=16 {
        files.push((
            format!("{i}.toml"),
            format!("extends = \"{}.toml\"\n", i - 1),
        ));
    }
    let files: Vec<_> = files
        .iter()
        .map(|(a, b)| (a.as_str(), b.as_str()))
        .collect();
    let folder = folder(&files);
    let load = |name: &str| load(&folder.path().join(name), &[]);
    let error = load("self.toml").unwrap_err();
    assert!(error.message.contains("extends itself"), "{error}");
    let error = load("a.toml").unwrap_err();
    assert!(error.message.contains("extends itself"), "{error}");
    assert_eq!(place_in(&error, "b.toml"), (1, 11));
    assert!(load("15.toml").is_ok());
    let error = load("16.toml").unwrap_err();
    assert!(error.message.contains("more than 16 files"), "{error}");
}
