//! What a scene does not need is not there: no queue, no column, no stage, no time.

use wavepath::accel::{Accel, LinearScan};
use wavepath::compile::compile;
use wavepath::integrator::plan::{Plan, QueuePlan};
use wavepath::integrator::stats::RenderStats;
use wavepath::scene::{
    AccelKind, BsdfDescription, Budget, RenderSettings, SamplerKind, SceneDescription, Strategy,
};

use crate::builder::{SceneBuilder, adorned_room, glass, lambertian, mirror, sheet};
use crate::renderer::{endless, path, whitted};
use crate::support::picture;

fn plan(scene: &SceneDescription, settings: &RenderSettings) -> Plan {
    let compiled = compile(scene, 0, 16, 16, settings).expect("the scene is sound");
    Plan::new(&compiled, settings)
}

fn stats(scene: &SceneDescription, settings: &RenderSettings) -> RenderStats {
    let settings = RenderSettings {
        budget: Budget::Samples(4),
        ..settings.clone()
    };
    picture(scene, 0, [16, 16], &settings).stats
}

/// A floor of this material, seen from above.
fn bare_floor(bsdf: BsdfDescription) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(bsdf);
    scene.floor(1.0, 0.0, floor);
    scene.aim([0.3, 0.2, 2.0], [0.0; 3]);
    scene
}

/// Adds what brings one feature with it.
type Addition = fn(&mut SceneBuilder);

/// The settings with the sampler that needs least.
fn independent(settings: RenderSettings) -> RenderSettings {
    RenderSettings {
        sampler: SamplerKind::Independent,
        ..settings
    }
}

#[test]
fn each_feature_is_named_and_costs_bytes_only_where_it_is_needed() {
    let additions: [(&str, Addition); 13] = [
        ("spheres", |s| {
            let black = s.matter(BsdfDescription::Black);
            s.sphere([0.5; 3], 0.1, black);
        }),
        ("glass", |s| {
            let clear = s.matter(glass(1.5));
            s.floor(0.1, 0.5, clear);
        }),
        ("mirrors", |s| {
            let silver = s.matter(mirror(0.5));
            s.floor(0.1, 0.5, silver);
        }),
        ("Oren–Nayar surfaces", |s| {
            let reflectance = glam::DVec3::splat(0.5);
            let rough = s.matter(BsdfDescription::OrenNayar {
                reflectance,
                sigma: 0.3,
            });
            s.floor(0.1, 0.5, rough);
        }),
        ("Phong surfaces", |s| {
            let reflectance = glam::DVec3::splat(0.5);
            let glossy = s.matter(BsdfDescription::Phong {
                reflectance,
                exponent: 5.0,
            });
            s.floor(0.1, 0.5, glossy);
        }),
        ("glossy surfaces", |s| {
            let half = glam::DVec3::splat(0.5);
            let glossy = s.matter(BsdfDescription::Glossy {
                diffuse: half,
                specular: half,
                exponent: 5.0,
            });
            s.floor(0.1, 0.5, glossy);
        }),
        ("smooth normals", |s| {
            let grey = s.matter(lambertian(0.5));
            s.attributed_mesh(sheet(0.1, 0.5, [0.1, 0.0, 1.0]), grey);
        }),
        ("textures", |s| {
            let grey = s.matter(lambertian(0.5));
            let texture = s.texture(1, vec![[9; 3]]);
            s.paint(grey, texture);
            s.attributed_mesh(sheet(0.1, 0.5, [0.0; 3]), grey);
        }),
        ("opacity", |s| {
            let grey = s.matter(lambertian(0.5));
            s.thin(grey, 0.5);
            s.floor(0.1, 0.5, grey);
        }),
        ("flat lights", |s| {
            let lamp = s.one_sided(BsdfDescription::Black, 1.0);
            s.ceiling(0.1, 3.0, lamp);
        }),
        ("sphere lights", |s| {
            let lamp = s.one_sided(BsdfDescription::Black, 1.0);
            s.sphere([0.5; 3], 0.1, lamp);
        }),
        ("point lights", |s| s.point_light([0.0, 0.0, 1.0], 1.0)),
        ("background", |s| s.background(1.0)),
    ];
    let bare = bare_floor(lambertian(0.5));
    let settings = independent(endless(Strategy::Mis));
    let least = plan(&bare.build(), &settings);
    assert_eq!(least.needed, ["triangles", "Lambertian surfaces"]);
    for (name, add) in additions {
        assert!(least.left_out.contains(&name), "{name} is in {least}");
        let mut scene = bare.clone();
        add(&mut scene);
        let with = plan(&scene.build(), &settings);
        assert!(with.needed.contains(&name), "{name} is not in {with}");
        assert!(
            !with.left_out.contains(&name),
            "{name} is left out of {with}"
        );
        // What is looked up at a hit needs no queue and no column.
        if ["spheres", "smooth normals", "textures", "opacity"].contains(&name) {
            assert_eq!(with.bytes_per_path, least.bytes_per_path);
        } else {
            assert!(with.bytes_per_path > least.bytes_per_path, "{name}");
        }
    }
}

#[test]
fn attributes_and_pictures_that_nothing_shows_are_left_out() {
    let mut scene = bare_floor(lambertian(0.5));
    let grey = scene.matter(lambertian(0.5));
    let white = scene.texture(1, vec![[255; 3]]);
    let painted = scene.matter(lambertian(0.5));
    scene.paint(painted, white);
    // Coordinates without a texture, a texture without coordinates, normals without a direction.
    let mut mesh = sheet(0.5, 0.5, [f32::NAN, 0.0, 1.0]);
    scene.attributed_mesh(mesh.clone(), grey);
    scene.floor(0.2, 0.3, painted);
    let settings = endless(Strategy::Mis);
    let compiled = compile(&scene.build(), 0, 16, 16, &settings).expect("the scene is sound");
    assert_eq!(compiled.surfaces.uvs.bytes(), 0);
    assert!(compiled.textures.is_empty());
    for name in ["textures", "opacity"] {
        assert!(plan(&scene.build(), &settings).left_out.contains(&name));
    }
    // One texture, however many materials show it; three indices per triangle.
    let again = scene.matter(lambertian(0.3));
    scene.paint(again, white);
    scene.cut_out(again, white);
    mesh.normals = vec![[0.0, 0.0, 2.0]];
    scene.attributed_mesh(mesh.clone(), again);
    scene.attributed_mesh(mesh, painted);
    let compiled = compile(&scene.build(), 0, 16, 16, &settings).expect("the scene is sound");
    assert_eq!(compiled.textures.len(), 1);
    let triangles = compiled.surfaces.first_sphere as usize;
    assert_eq!(triangles, 2 * 5);
    assert_eq!(compiled.surfaces.uvs.bytes(), 12 * triangles + 8 * 4 * 2);
}

#[test]
fn settings_bring_their_features_and_no_more() {
    let mut scene = bare_floor(lambertian(0.5));
    let lamp = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.ceiling(0.5, 3.0, lamp);
    let clear = scene.matter(glass(1.5));
    scene.floor(0.1, 0.5, clear);
    let scene = scene.build();
    let base = independent(endless(Strategy::Bsdf));
    let nee = independent(endless(Strategy::Nee));
    let features = |settings: RenderSettings| plan(&scene, &settings).needed;
    let least = ["triangles", "Lambertian surfaces", "glass", "flat lights"];
    assert_eq!(features(base.clone()), least);
    let with = |more: &[&'static str]| [&least, more].concat();
    assert_eq!(features(nee.clone()), with(&["shadow rays"]));
    let mis = ["shadow rays", "multiple importance sampling"];
    assert_eq!(features(independent(endless(Strategy::Mis))), with(&mis));
    assert_eq!(
        features(independent(whitted(9))),
        with(&[
            "shadow rays",
            "Whitted's transport",
            "rays through pixel centres"
        ])
    );
    let stratified = RenderSettings {
        sampler: SamplerKind::Stratified,
        ..base.clone()
    };
    assert_eq!(features(stratified), with(&["stratified sampling"]));
    let sobol = RenderSettings {
        sampler: SamplerKind::Sobol,
        ..base.clone()
    };
    assert_eq!(features(sobol), with(&["Sobol sampling"]));
    let several = RenderSettings {
        light_samples: 2,
        ..nee.clone()
    };
    assert_eq!(
        features(several.clone()),
        with(&["shadow rays", "several light samples"])
    );
    let bytes = |settings: &RenderSettings| plan(&scene, settings).bytes_per_path;
    assert!(bytes(&several) > bytes(&nee));
    let splits = RenderSettings {
        glass_splits: 2,
        ..base.clone()
    };
    assert_eq!(features(splits.clone()), with(&["splitting at glass"]));
    // Without light sampling and without glass there is nothing to multiply.
    let idle = RenderSettings {
        light_samples: 2,
        ..base.clone()
    };
    assert_eq!(features(idle), least);
    let floor = bare_floor(lambertian(0.5)).build();
    assert_eq!(plan(&floor, &splits), plan(&floor, &base));
    let transparent = RenderSettings {
        transparent_shadows: true,
        ..nee.clone()
    };
    assert_eq!(
        features(transparent.clone()),
        with(&["shadow rays", "transparent shadows"])
    );
    let aux = RenderSettings {
        aux: true,
        ..base.clone()
    };
    assert_eq!(features(aux), with(&["auxiliary images"]));
    let biased = RenderSettings {
        shadow_bias: Some(1e-3),
        ..base.clone()
    };
    assert_eq!(features(biased), with(&["shadow bias"]));
    // Emission alone needs no material, and direction sampling no shadow ray to be transparent.
    assert_eq!(
        features(independent(path(Strategy::Mis, 1))),
        ["triangles", "flat lights"]
    );
    let no_shadows = RenderSettings {
        strategy: Strategy::Bsdf,
        ..transparent
    };
    assert_eq!(features(no_shadows), least);
}

#[test]
fn absent_queues_and_columns_are_left_out_of_the_plan() {
    let settings = endless(Strategy::Mis);
    let scene = bare_floor(lambertian(0.5)).build();
    let lean = plan(&scene, &settings);
    let [rays, hits, shadows, indices] = lean.queues.as_slice() else {
        panic!("four kinds of queue");
    };
    assert_eq!((rays.count, hits.count), (2, 1));
    assert_eq!((shadows.count, indices.count), (0, 1));
    for column in ["pdf", "eta"] {
        assert!(rays.left_out.contains(&column), "{column} is in {lean}");
        assert!(!rays.columns.contains(&column), "{column} is in {lean}");
    }
    let bytes = |queue: &QueuePlan| queue.count * queue.bytes_per_item;
    assert_eq!(
        lean.bytes_per_path,
        lean.queues.iter().map(bytes).sum::<usize>()
    );
    let runs: Vec<&str> = lean
        .stages
        .iter()
        .filter(|stage| stage.runs)
        .map(|stage| stage.name.as_str())
        .collect();
    assert_eq!(
        runs,
        [
            "generate",
            "intersect",
            "sort",
            "shade Lambertian",
            "roulette"
        ]
    );
    let full = RenderSettings {
        force_features: true,
        ..settings
    };
    let full = plan(&scene, &full);
    assert!(full.bytes_per_path > lean.bytes_per_path);
    assert!(full.queues[0].bytes_per_item > rays.bytes_per_item);
}

#[test]
fn stages_of_absent_features_see_no_item() {
    let items = |stats: &RenderStats, name: &str| {
        let stage = stats.stages.iter().find(|stage| stage.name == name);
        stage.expect("a stage of this name").clone()
    };
    // A floor in the dark: it is shaded, but there is nothing to see or to connect to.
    let dark = stats(
        &bare_floor(lambertian(0.5)).build(),
        &endless(Strategy::Mis),
    );
    assert!(items(&dark, "shade").items > 0);
    for name in ["emission", "connect"] {
        assert_eq!(items(&dark, name).items, 0, "{name}");
    }
    assert_eq!(items(&dark, "connect").cpu_seconds, 0.0);
    assert_eq!(dark.shadow_rays, 0);

    // A black floor under a sky: nothing to shade, nothing to go on.
    let mut scene = bare_floor(BsdfDescription::Black);
    scene.background(1.0);
    let black = stats(&scene.build(), &endless(Strategy::Mis));
    for name in ["shade", "connect", "roulette"] {
        assert_eq!(items(&black, name).items, 0, "{name}");
    }

    // Mirrors and a lamp: no hit has a light to sample.
    let mut scene = bare_floor(mirror(0.5));
    let lamp = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.ceiling(9.0, 3.0, lamp);
    let specular = stats(&scene.build(), &endless(Strategy::Mis));
    assert!(items(&specular, "emission").items > 0);
    assert_eq!(items(&specular, "connect").cpu_seconds, 0.0);
    assert_eq!(specular.shadow_rays, 0);
}

#[test]
fn the_structure_that_is_asked_for_is_planned() {
    let scene = bare_floor(lambertian(0.5)).build();
    for (accel, name) in [
        (AccelKind::Linear, "linear"),
        (AccelKind::Octree, "octree"),
        (AccelKind::Bvh2, "bvh2"),
        (AccelKind::Bvh8, "bvh8"),
        (AccelKind::Packet, "packet"),
    ] {
        let settings = RenderSettings {
            accel,
            ..endless(Strategy::Mis)
        };
        assert_eq!(plan(&scene, &settings).accel, name);
    }
}

#[test]
fn primitives_of_a_compiled_scene_are_those_that_its_structure_was_built_over() {
    let mut spheres = bare_floor(lambertian(0.5));
    let black = spheres.matter(BsdfDescription::Black);
    spheres.sphere([0.5; 3], 0.1, black);
    let settings = RenderSettings {
        accel: AccelKind::Linear,
        ..endless(Strategy::Mis)
    };
    for scene in [spheres.build(), adorned_room().build()] {
        let compiled = compile(&scene, 0, 16, 16, &settings).expect("the scene is sound");
        // The scan's size tells how many faces were merged: those with attributes are not.
        let scan = LinearScan::new(&compiled.geometry(&scene));
        assert_eq!(scan.bytes(), compiled.accel.bytes());
    }
}
