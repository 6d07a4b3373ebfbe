//! A scene around an OBJ file that has none: camera, sky and sun.

use std::path::Path;

use glam::DVec3;

use super::description::{Mesh, SceneDescription, ShapeDescription, ShapeGeometry};
use super::library::Library;
use super::{document, obj, overrides, reader};
use crate::error::{Error, Result};

/// Size of the image.
const FILM: [u32; 2] = [800, 600];

/// Vertical field of view in degrees.
const FOV: f64 = 40.0;

/// From the middle of the mesh towards the camera: from the front, the right and above, +y being up and
/// +z the front, as is the custom in OBJ files.
const VIEW: DVec3 = DVec3::new(0.55, 0.45, 1.0);

/// From the middle of the mesh towards the sun: over the camera's left shoulder.
const SUN: DVec3 = DVec3::new(-0.35, 1.0, 0.6);

/// Room left around the mesh in the image.
const MARGIN: f64 = 1.05;

/// Distance of the sun in radii of the mesh: outside of it and behind the camera, and near enough to cost
/// f32 coordinates about the middle of the scene two bits only.
const SUN_DISTANCE: f64 = 5.0;

/// Width of the sun over its distance: six degrees, for shadows that are soft but plain.
const SUN_WIDTH: f64 = 0.105;

/// Radiance of the sky. With the sun, white chalk in full light has about the display's white.
const SKY: [f64; 3] = [0.4, 0.45, 0.55];

/// Irradiance of a surface that faces the sun; three times what the sky gives it.
const SUN_IRRADIANCE: [f64; 3] = [2.2, 2.0, 1.7];

/// The OBJ file `path` in a scene of its own, after applying `overrides` to it. Sky and sun are left
/// out where a material of the mesh emits light.
pub(super) fn load(path: &Path, overrides: &[String]) -> Result<SceneDescription> {
    let mut library = Library::default();
    let mut obj = obj::read(path, |error| Error::io(path, error))?;
    let material = obj.use_own_materials(&mut library);
    let mesh = obj.finish(&mut library, || {
        Error::file(path, "no face of the mesh can be traced")
    })?;
    let has_lights = library.materials.iter().any(|m| m.emission.is_some());

    let mut root = document::parse(surroundings(&mesh, !has_lights), path)?;
    for option in overrides {
        overrides::apply(&mut root, option)?;
    }
    let mut scene = reader::scene(&root, path)?;
    let offset = scene.materials.len() as u32;
    let moved = |id: super::MaterialId| super::MaterialId(id.0 + offset);
    scene.shapes.push(ShapeDescription {
        name: obj::stem(path).unwrap_or_default().to_owned(),
        material: moved(material),
        geometry: ShapeGeometry::Mesh(Mesh {
            face_materials: mesh.face_materials.iter().copied().map(moved).collect(),
            ..mesh
        }),
    });
    scene.materials.append(&mut library.materials);
    scene.textures = library.textures;
    scene.mesh_files = library.mesh_files;
    scene.warnings.append(&mut library.warnings);
    Ok(scene)
}

/// A scene file without the mesh.
fn surroundings(mesh: &Mesh, is_lit: bool) -> String {
    let (lowest, highest) = mesh.positions.iter().fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(lowest, highest), &position| (lowest.min(position), highest.max(position)),
    );
    let middle = 0.5 * lowest + 0.5 * highest;
    let half = highest - middle;
    let eye = middle + camera_distance(half) * VIEW.normalize();
    let [width, height] = FILM;
    let mut text = format!(
        "[film]\nwidth = {width}\nheight = {height}\n\
         [cameras.view]\neye = {}\nlook_at = {}\nup = [0, 1, 0]\nfov = {FOV:?}\n",
        point(eye),
        point(middle)
    );
    if is_lit {
        let towards = SUN.normalize();
        let distance = SUN_DISTANCE * half.length();
        let center = middle + distance * towards;
        let right = (0.5 * SUN_WIDTH * distance) * towards.cross(DVec3::Y).normalize();
        let up = right.cross(towards);
        // Counter-clockwise as seen from the mesh.
        let corners = [-right - up, right - up, right + up, -right + up];
        let corners = corners.map(|corner| point(center + corner));
        let solid_angle = SUN_WIDTH * SUN_WIDTH;
        let radiance = SUN_IRRADIANCE.map(|irradiance| irradiance / solid_angle);
        text += &format!(
            "[background]\nradiance = {SKY:?}\n\
             [materials.sun]\ntype = \"emitter\"\nemission = {radiance:?}\n\
             [[shapes]]\nname = \"sun\"\ntype = \"quad\"\nmaterial = \"sun\"\ncorners = [{}]\n",
            corners.join(", ")
        );
    }
    text
}

/// How far from the middle of a box with these half edges the whole box is in the image.
fn camera_distance(half: DVec3) -> f64 {
    let towards = VIEW.normalize();
    let right = DVec3::Y.cross(towards).normalize();
    let up = towards.cross(right);
    let slope_y = (0.5 * FOV.to_radians()).tan();
    let slope_x = slope_y * f64::from(FILM[0]) / f64::from(FILM[1]);
    let signs = [-1.0, 1.0];
    let corners = signs.into_iter().flat_map(|x| {
        let faces = signs.into_iter().map(move |y| [x, y]);
        faces.flat_map(|[x, y]| signs.map(|z| half * DVec3::new(x, y, z)))
    });
    let distances = corners.map(|corner| {
        let across = (corner.dot(right).abs() / slope_x).max(corner.dot(up).abs() / slope_y);
        MARGIN * across + corner.dot(towards)
    });
    distances.fold(0.0, f64::max)
}

/// A point as TOML has it.
fn point(point: DVec3) -> String {
    format!("{:?}", point.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::description::Projection;
    use crate::scene::procedural;

    #[test]
    fn the_whole_mesh_is_in_the_image_and_fills_it() {
        for (scale, offset) in [
            (DVec3::ONE, DVec3::ZERO),
            (DVec3::new(100.0, 0.01, 1.0), DVec3::splat(1e6)),
            (DVec3::new(0.1, 7.0, 0.2), DVec3::new(-3.0, 0.0, 5.0)),
        ] {
            let mut mesh = procedural::cuboid(DVec3::ONE);
            for position in &mut mesh.positions {
                *position = *position * scale + offset;
            }
            let root = document::parse(surroundings(&mesh, true), Path::new("a.obj")).unwrap();
            let scene = reader::scene(&root, Path::new("a.obj")).unwrap();
            let Projection::LookAt { target, .. } = scene.cameras[0].projection else {
                panic!("{:?}", scene.cameras[0]);
            };
            assert!((target - offset).length() <= 1e-9 * (1.0 + offset.length()));
            let [eye, top_left, right, down] = scene.cameras[0].projection.plane(800, 600);
            let normal = right.cross(down).normalize();
            let mut largest = 0.0_f64;
            for position in &mesh.positions {
                let ray = *position - eye;
                let depth = ray.dot(normal) / (top_left - eye).dot(normal);
                assert!(depth > 0.0, "behind the camera");
                let on_plane = ray / depth - (top_left - eye);
                let s = on_plane.dot(right) / right.length_squared();
                let t = on_plane.dot(down) / down.length_squared();
                largest = largest
                    .max((2.0 * s - 1.0).abs())
                    .max((2.0 * t - 1.0).abs());
            }
            assert!((0.85..=1.0).contains(&largest), "{largest}");
        }
    }

    #[test]
    fn the_sun_shines_on_the_mesh_from_outside() {
        let mesh = procedural::icosphere(3.0, 2);
        let root = document::parse(surroundings(&mesh, true), Path::new("a.obj")).unwrap();
        let scene = reader::scene(&root, Path::new("a.obj")).unwrap();
        let ShapeGeometry::Quad([a, b, c, _]) = scene.shapes[0].geometry else {
            panic!("{:?}", scene.shapes[0]);
        };
        let normal = (b - a).cross(c - a);
        assert!(normal.dot(-a) > 0.0, "its front is towards the mesh");
        assert!(a.length() > 4.0 * 3.0);
        let radiance = scene.materials[0].emission.unwrap().radiance;
        let irradiance = radiance * normal.length() / (0.5 * (a + c)).length_squared();
        // Over the quad's width the cosine and the distance change by less than 1 %.
        let expected = DVec3::from_array(SUN_IRRADIANCE);
        assert!(
            (irradiance / expected - 1.0).length() < 0.01,
            "{irradiance}"
        );
    }
}
