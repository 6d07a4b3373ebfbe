//! Overrides replace values, and quote themselves when wrong.

use glam::DVec3;

use super::*;

#[test]
fn overrides_replace_and_add_values() {
    let scene = parse_valid(&[
        "film.width=64",
        " film.exposure = 1.5 ",
        "render.max_depth=7",
        "background.radiance=[1, 2, 3]",
        "materials.glass.ior=1.75",
        "materials.glass.fresnel=schlick",
        "materials.grey={ type = \"mirror\" }",
        "shapes.ball.radius=0.5",
        "shapes.0.center.2=9",
        "shapes.\"panel\".material=grey",
        "lights.bulb.intensity=7",
        "camera=plane",
        "film.width=65",
    ])
    .unwrap();
    assert_eq!((scene.film.width, scene.film.exposure), (65, 1.5));
    assert_eq!(scene.render.max_depth, Some(7));
    assert_eq!(scene.background, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(
        scene.materials[2].bsdf,
        BsdfDescription::Dielectric {
            ior: 1.75,
            fresnel: Fresnel::Schlick
        }
    );
    assert_eq!(
        scene.materials[0].bsdf,
        BsdfDescription::Mirror {
            reflectance: DVec3::ONE
        }
    );
    assert!(matches!(
        scene.shapes[0].geometry,
        ShapeGeometry::Sphere { center, radius: 0.5 } if center.z == 9.0
    ));
    assert_eq!(scene.shapes[1].material, MaterialId(0));
    assert_eq!(scene.point_lights[0].intensity, DVec3::splat(7.0));
    assert_eq!(scene.cameras[0].name, "plane");
}

#[test]
fn a_wrong_override_is_one_error_that_quotes_it() {
    for (option, message) in [
        ("film.width", "must be written path.to.key=value"),
        ("film.width=", "must be written path.to.key=value"),
        ("=3", "must be written path.to.key=value"),
        ("film..width=3", "must be written path.to.key=value"),
        ("", "must be written path.to.key=value"),
        ("film.widht=3", "unknown key `widht`"),
        ("flim.width=3", "there is no `flim` here"),
        (
            "materials.brass.ior=2",
            "there is no `brass` here, only `grey`, `rough`",
        ),
        (
            "shapes.cube.radius=1",
            "`cube` is neither the name nor the index of one of 4 elements",
        ),
        (
            "shapes.4.radius=1",
            "`4` is neither the name nor the index of one of 4 elements",
        ),
        ("film.width.x=1", "a single value has no `x`"),
        ("film.width.x.y=1", "a single value has no `x`"),
        (
            "film.width=wide",
            "expected a whole number, found the string \"wide\"",
        ),
        ("film.width=0", "`width` must be between 1 and 65535, got 0"),
        ("shapes.ball.radius=-1", "`radius` must be > 0"),
        ("shapes.ball.material=brass", "there is no material `brass`"),
        ("shapes.ball={}", "a shape needs `type`"),
        ("camera=rear", "there is no camera `rear`"),
        ("render.spp=0", "`spp` must be > 0"),
        ("render.ssp=1", "unknown field `ssp`"),
        ("extends=hexroom.toml", "unknown key `extends`"),
        ("cameras.front.up=[0, 1, 0]", "parallel to the view"),
    ] {
        let error = parse_valid(&[option]).expect_err(option);
        assert_eq!(error.kind, ErrorKind::Usage, "{option}: {error}");
        assert_eq!(error.place, None);
        let text = error.to_string();
        assert!(text.starts_with(&format!("--set {option}: ")), "{text}");
        assert!(text.contains(message), "{text}");
        assert!(!text.contains('\n'), "{text}");
    }
}
