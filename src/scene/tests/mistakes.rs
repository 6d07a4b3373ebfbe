//! Every mistake is one error at its place.

use super::*;

/// Parses `text` without its mark `@` and asserts one error that contains `message`, at the mark.
#[track_caller]
fn assert_error_at_mark(text: &str, message: &str) {
    let before = text
        .split('@')
        .next()
        .expect("split yields at least one part");
    let line = before.split('\n').count() as u32;
    let column = 1 + before.rsplit('\n').next().unwrap_or("").chars().count() as u32;
    let error = parse(text.replace('@', ""), Path::new("bad.toml"), &[])
        .expect_err("the scene has a mistake");
    assert!(error.message.contains(message), "{error}");
    let place = error.place.clone().expect("the error has a place");
    assert_eq!(place.file, Path::new("bad.toml"));
    assert_eq!(
        (place.line, place.column),
        (Some(line), Some(column)),
        "{error}"
    );
}

/// As above, for [`VALID`] with `right` replaced by `wrong`, which holds the mark.
#[track_caller]
fn assert_mistake(right: &str, wrong: &str, message: &str) {
    assert_eq!(VALID.matches(right).count(), 1, "`{right}` must occur once");
    assert_error_at_mark(&VALID.replace(right, wrong), message);
}

#[test]
fn lines_and_columns_count_from_one_in_characters() {
    let text = "film = { width = \"größe\", x = 1 }\n";
    let error = parse(text, Path::new("a.toml"), &[]).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("a.toml:1:27: unknown key `x`"),
        "{error}"
    );
    let text = VALID.replace("name = \"ball\"", "name = \"größe\", x");
    let error = parse(text, Path::new("a.toml"), &[]).unwrap_err();
    assert!(error.to_string().starts_with("a.toml:42:15: "), "{error}");
    let error = parse(
        VALID.replace("radius = 1", "radius = -1"),
        Path::new("d/a.toml"),
        &[],
    );
    assert_eq!(
        error.unwrap_err().to_string(),
        "d/a.toml:46:10: `radius` must be > 0 (at least 1.2e-38) and at most 1.8e18, got -1"
    );
}

#[test]
fn unknown_keys_are_errors_everywhere() {
    assert_mistake("[film]", "@typo = 1\n[film]", "unknown key `typo`");
    assert_mistake("width = 8", "@widht = 8", "unknown key `widht`");
    assert_mistake("fov = 40", "@fow = 40", "unknown key `fow`");
    assert_mistake(
        "top_left = [0, 1, 1]",
        "top_left = [0, 1, 1]\n@fov = 40",
        "unknown key `fov`",
    );
    assert_mistake("sigma = 0.5", "@ior = 0.5", "unknown key `ior`");
    assert_mistake(
        "ior = 1.5",
        "ior = 1.5\n@reflectance = 1",
        "unknown key `reflectance`",
    );
    assert_mistake(
        "radius = 1",
        "radius = 1\n@corners = []",
        "unknown key `corners`",
    );
    assert_mistake("sides = 4", "@cells = 4", "unknown key `cells`");
    assert_mistake("intensity = 5", "@power = 5", "unknown key `power`");
    assert_mistake(
        "[render]",
        "[background]\n@color = 1\n[render]",
        "unknown key `color`",
    );
    assert_mistake("spp = 4", "@ssp = 4", "unknown field `ssp`");
}

#[test]
fn missing_keys_are_reported_at_their_table() {
    assert_mistake("[film]\nwidth = 8\n", "@[film]\n", "needs `width`");
    assert_mistake(
        "[materials.grey]\ntype = \"lambertian\"\nreflectance = 0.5",
        "@[materials.grey]\ntype = \"lambertian\"",
        "needs `reflectance`",
    );
    assert_mistake(
        "[[shapes]]\nname = \"ball\"\ntype = \"sphere\"",
        "@[[shapes]]\nname = \"ball\"",
        "needs `type`",
    );
}

#[test]
fn unknown_names_are_errors() {
    assert_mistake(
        "material = \"glass\"",
        "material = @\"brass\"",
        "no material `brass`",
    );
    assert_mistake(
        "camera = \"front\"",
        "camera = @\"rear\"",
        "no camera `rear`",
    );
    assert_mistake(
        "type = \"lambertian\"",
        "type = @\"lambert\"",
        "unknown type `lambert`",
    );
    assert_mistake(
        "type = \"sphere\"",
        "type = @\"ball\"",
        "unknown type `ball`",
    );
    assert_mistake(
        "type = \"point\"",
        "type = @\"spot\"",
        "unknown type `spot`",
    );
    assert_mistake(
        "mesh = \"torus\"",
        "mesh = @\"donut\"",
        "unknown mesh `donut`",
    );
    for (key, message) in [
        ("triangles = @999", "between 1000 and 30000000, got 999"),
        ("seed = @-1", "`seed` must be between 0"),
        ("@sides = 4", "unknown key `sides`"),
    ] {
        let soup = format!("mesh = \"soup\"\nmaterial = \"shiny\"\n{key}");
        let torus = "mesh = \"torus\"\nmaterial = \"shiny\"\nsegments = 8\nsides = 4";
        assert_mistake(torus, &soup, message);
    }
    assert_mistake(
        "ior = 1.5",
        "ior = 1.5\nfresnel = @\"none\"",
        "unknown fresnel `none`",
    );
    assert_mistake(
        "spp = 4",
        "@integrator = \"magic\"",
        "unknown variant `magic`",
    );
}

#[test]
fn duplicates_are_errors() {
    assert_mistake("[cameras.plane]", "[cameras.@front]", "duplicate key");
    assert_mistake("[materials.rough]", "[materials.@grey]", "duplicate key");
    assert_mistake("height = 6", "@width = 6", "duplicate key");
    assert_mistake(
        "[[shapes]]\nname = \"panel\"",
        "@[[shapes]]\nname = \"ball\"",
        "another shape has the name `ball`",
    );
}

#[test]
fn numbers_outside_their_range_are_errors() {
    for radius in ["-1", "0", "nan", "inf", "1e-40", "1e19"] {
        assert_mistake(
            "radius = 1",
            &format!("radius = @{radius}"),
            "`radius` must be > 0",
        );
    }
    for sigma in ["-0.1", "-inf", "nan"] {
        assert_mistake(
            "sigma = 0.5",
            &format!("sigma = @{sigma}"),
            "`sigma` must be ≥ 0",
        );
    }
    for ior in ["0", "-1.5", "nan", "inf"] {
        assert_mistake("ior = 1.5", &format!("ior = @{ior}"), "`ior` must be > 0");
    }
    for exponent in ["-1", "1.1e6", "nan", "inf"] {
        let wrong = format!("exponent = @{exponent}");
        assert_mistake("exponent = 10", &wrong, "`exponent` must be in [0, 1e6]");
    }
    for albedo in ["[@-0.1, 0, 0]", "[0, @1.01, 0]", "[0, 0, @nan]", "@1.5"] {
        let wrong = format!("reflectance = {albedo}");
        assert_mistake(
            "reflectance = [0.1, 0.2, 0.3]",
            &wrong,
            "`reflectance` must be in [0, 1]",
        );
    }
    for emission in ["[@-1, 2, 3]", "[1, @inf, 3]", "@nan", "@1e31"] {
        let wrong = format!("emission = {emission}");
        assert_mistake("emission = [1, 2, 3]", &wrong, "`emission` must be ≥ 0");
    }
    assert_mistake(
        "intensity = 5",
        "intensity = @-5",
        "`intensity` must be ≥ 0",
    );
    for fov in ["0", "180", "-40", "nan", "inf"] {
        let wrong = format!("fov = @{fov}");
        assert_mistake("fov = 40", &wrong, "`fov` must be between 0 and 180");
    }
    for width in ["0", "65536", "-8", "99999999999"] {
        let wrong = format!("width = @{width}");
        assert_mistake("width = 8", &wrong, "`width` must be between 1 and 65535");
    }
    assert_mistake(
        "height = 6",
        "height = 6\nexposure = @inf",
        "`exposure` must be between",
    );
    for x in ["1.81e18", "-1.81e18", "nan", "inf"] {
        let message = "finite and at most 1.8e18 in absolute value";
        assert_mistake(
            "center = [0, 0, 1]",
            &format!("center = [0, @{x}, 1]"),
            message,
        );
        assert_mistake("eye = [0, -4, 1]", &format!("eye = [@{x}, -4, 1]"), message);
        assert_mistake(
            "position = [0, 0, 2]",
            &format!("position = [0, 0, @{x}]"),
            message,
        );
        let wrong = format!("positions = [[0, 0, @{x}], ");
        assert_mistake("positions = [[0, 0, 0], ", &wrong, message);
        let wrong = format!("corners = [[@{x}, -1, 3], ");
        assert_mistake("corners = [[-1, -1, 3], ", &wrong, message);
    }
    for scale in ["@0", "[1, @0, 1]", "@nan"] {
        let wrong = format!("sides = 4\nscale = {scale}");
        assert_mistake("sides = 4", &wrong, "`scale` must be finite, not 0");
    }
    assert_mistake(
        "sides = 4",
        "sides = @2",
        "`sides` must be between 3 and 2048",
    );
    assert_mistake("spp = 4", "spp = @0", "`spp` must be > 0");
    assert_mistake("spp = 4", "max_depth = @0", "`max_depth` must be > 0");
    assert_mistake("spp = 4", "@spp = -1", "invalid value");
    assert_mistake("ior = 1.5", "ior = @1e999", "number too large");
    assert_mistake(
        "width = 8",
        "width = @99999999999999999999",
        "integer too large",
    );
}

#[test]
fn values_of_the_wrong_type_are_errors() {
    assert_mistake(
        "width = 8",
        "width = @8.5",
        "expected a whole number, found 8.5",
    );
    assert_mistake(
        "radius = 1",
        "radius = @\"1\"",
        "expected a number, found the string \"1\"",
    );
    assert_mistake("name = \"ball\"", "name = @1", "expected a string, found 1");
    assert_mistake(
        "center = [0, 0, 1]",
        "center = @[0, 1]",
        "must have three numbers, has 2",
    );
    assert_mistake("center = [0, 0, 1]", "center = @1", "expected an array");
    assert_mistake(
        "emission = [1, 2, 3]",
        "emission = 1\ntwo_sided = @1",
        "expected true or false",
    );
    assert_error_at_mark("film = @1", "expected a table");
    assert_mistake("[[lights]]\nname", "@[lights]\nname", "expected an array");
    assert_mistake("spp = 4", "spp = @[4]", "expected a single value");
}

#[test]
fn degenerate_cameras_are_errors() {
    let parallel = "`up` must not be zero or parallel to the view";
    assert_mistake("up = [0, 0, 1]", "up = @[0, 2, 0]", parallel);
    assert_mistake("up = [0, 0, 1]", "up = @[0, -1e-300, 0]", parallel);
    assert_mistake("up = [0, 0, 1]", "up = @[0, 0, 0]", parallel);
    let message = "`eye` and `look_at` are the same point";
    assert_mistake(
        "[cameras.front]\neye = [0, -4, 1]",
        "@[cameras.front]\neye = [0, 0, 1]",
        message,
    );
    let degenerate = "the image plane is degenerate";
    let plane = |right: &str, down: &str, top_left: &str| {
        let wrong = format!(
            "@[cameras.plane]\neye = [-1, 0, 0]\ntop_left = {top_left}\nright = {right}\ndown = {down}\n"
        );
        let (start, rest) = VALID.split_once("[cameras.plane]").unwrap();
        let rest = rest.split_once("\n\n").unwrap().1;
        assert_error_at_mark(&format!("{start}{wrong}\n{rest}"), degenerate);
    };
    plane("[0, 0, 0]", "[0, 0, -2]", "[0, 1, 1]");
    plane("[0, 0, 3]", "[0, 0, -2]", "[0, 1, 1]");
    plane("[0, -2, 0]", "[0, 0, -2]", "[-1, 1, 1]");
}

#[test]
fn a_scene_needs_a_camera_and_a_film() {
    assert_error_at_mark("@", "the scene is empty");
    assert_error_at_mark("@# nothing\n", "the scene is empty");
    assert_error_at_mark("@[film]\nwidth = 1\nheight = 1\n", "no camera");
    assert_error_at_mark(
        "cameras = @{}\n[film]\nwidth = 1\nheight = 1\n",
        "no camera",
    );
    assert_error_at_mark("@[cameras.a]\neye = [0, 0, 0]\n", "needs `film`");
}

#[test]
fn hand_written_faces_must_be_sound() {
    let faces = "faces = [[0, 1, 2], [0, 2, 3]]";
    assert_mistake(
        faces,
        "faces = [[0, 1, 2], [0, 2, @4]]",
        "vertex 4 does not exist; there are 4",
    );
    assert_mistake(
        faces,
        "faces = [[0, 1, 2], [0, @-1, 3]]",
        "vertex -1 does not exist",
    );
    assert_mistake(
        faces,
        "faces = [[0, 1, 2], @[0, 2]]",
        "a face has three vertex indices, this one 2",
    );
    assert_mistake(
        faces,
        "faces = [[0, 1, 2], @[0, 2, 2]]",
        "the face has no area",
    );
    assert_mistake(faces, "faces = @[]", "there are no faces");

    let corners = "corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3]]";
    let quad = |wrong: &str, message: &str| {
        assert_mistake(corners, &format!("corners = @{wrong}"), message);
    };
    quad(
        "[[-1, -1, 3], [-1, 1, 3], [1, 1, 3]]",
        "a quad has four corners, this one 3",
    );
    quad(
        "[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.001]]",
        "not planar",
    );
    quad(
        "[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [-0.9, 0.9, 3]]",
        "not convex",
    );
    quad(
        "[[-1, -1, 3], [1, 1, 3], [-1, 1, 3], [1, -1, 3]]",
        "not convex",
    );
    quad(
        "[[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [0, 0, 3]]",
        "on a line",
    );
    quad(
        "[[-1, -1, 3], [-1, -1, 3], [1, 1, 3], [1, -1, 3]]",
        "on a line",
    );
    let nearly_planar = "corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.000001]]";
    assert!(
        parse(
            VALID.replace(corners, nearly_planar),
            Path::new("a.toml"),
            &[]
        )
        .is_ok()
    );
}

#[test]
fn emission_and_its_sides_go_together() {
    assert_mistake(
        "ior = 1.5",
        "ior = 1.5\ntwo_sided = @true",
        "`emission`, which is missing",
    );
    assert_mistake(
        "[materials.lamp]\ntype = \"emitter\"\nemission = [1, 2, 3]",
        "@[materials.lamp]\ntype = \"emitter\"",
        "needs `emission`",
    );
}

#[test]
fn broken_syntax_is_an_error_at_its_place() {
    assert_mistake("width = 8", "width = @", "");
    assert_mistake("[film]", "[film@\n", "");
    let error = parse(
        &VALID[..VALID.find("corners").unwrap() + 20],
        Path::new("a.toml"),
        &[],
    );
    let place = error.unwrap_err().place.unwrap();
    assert_eq!(place.line, Some(52), "a truncated file");
}

#[test]
fn endless_nesting_is_an_error() {
    let deep = 100_000;
    let dots = "a.".repeat(deep);
    for text in [
        format!("x = {}", "[".repeat(deep)),
        format!("x = {}1{}", "[".repeat(deep), "]".repeat(deep)),
        format!("x = {}1{}", "{a=".repeat(deep), "}".repeat(deep)),
        format!("{dots}a = 1"),
        format!("[{dots}a]"),
        format!("[[{dots}a]]"),
    ] {
        assert!(parse(text, Path::new("a.toml"), &[]).is_err());
    }
    assert!(parse_valid(&[&format!("{dots}a=1")]).is_err());
    assert!(parse_valid(&[&format!("film.width={}", "[".repeat(deep))]).is_err());
}

#[test]
fn a_byte_order_mark_and_windows_line_ends_do_not_shift_places() {
    let text = format!("\u{feff}{}", VALID.replace('\n', "\r\n"));
    assert!(parse(text.as_str(), Path::new("a.toml"), &[]).is_ok());
    let wrong = text.replace("radius = 1", "radius = -1");
    let error = parse(wrong, Path::new("a.toml"), &[]).unwrap_err();
    assert_eq!(place_in(&error, "a.toml"), (46, 10));
}

#[test]
fn unreadable_files_are_errors() {
    let folder = folder(&[("valid.toml", VALID)]);
    let error = load(&folder.path().join("missing.toml"), &[]).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Io);
    assert!(error.place.unwrap().file.ends_with("missing.toml"));
    assert_eq!(load(folder.path(), &[]).unwrap_err().kind, ErrorKind::Io);

    let path = folder.path().join("latin1.toml");
    fs::write(&path, b"# fine: \xc3\xa9\n# not: \xe9\n").unwrap();
    let error = load(&path, &[]).unwrap_err();
    assert_eq!(error.message, "not UTF-8 text");
    assert_eq!(place_in(&error, "latin1.toml"), (2, 8));
}

#[test]
fn a_missing_obj_file_is_an_error_where_it_is_named() {
    let shape = "[[shapes]]\ntype = \"obj\"\nmaterial = \"grey\"\nfile = @\"none.obj\"\n[render]";
    assert_mistake("[render]", shape, "cannot read `none.obj`");
}
