//! One scene at any size and place: the same picture.

use glam::DVec3;

use super::renders::{Picture, kind, path};
use super::scenes::{SceneBuilder, glass, lambertian, mirror};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::scene::{
    BsdfDescription, Budget, Projection, RenderSettings, SceneDescription, ShapeGeometry, Strategy,
};

/// A room with everything in it.
fn room() -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let white = scene.matter(lambertian(0.7));
    let rough = scene.matter(BsdfDescription::OrenNayar {
        reflectance: DVec3::splat(0.6),
        sigma: 0.5,
    });
    let clear = scene.matter(glass(1.5));
    let silver = scene.matter(mirror(0.9));
    let lamp = scene.one_sided(BsdfDescription::Black, 4.0);
    scene.floor(2.0, 0.0, white);
    scene.ceiling(2.0, 3.0, rough);
    scene.ceiling(0.7, 2.9, lamp);
    let wall = [
        [2.0, -2.0, 0.0],
        [2.0, 2.0, 0.0],
        [2.0, 2.0, 3.0],
        [2.0, -2.0, 3.0],
    ];
    scene.quad(wall, white);
    scene.skew_cube(0.8, DVec3::new(0.4, -1.2, 0.4), rough);
    scene.sphere([0.5, 0.9, 0.8], 0.5, clear);
    scene.sphere([-0.5, 0.3, 0.4], 0.4, silver);
    scene.point_light([-0.5, 1.0, 1.5], 2.0);
    scene.background(0.3);
    scene.window(
        [-3.5, 0.0, 1.5],
        [-2.5, 0.8, 2.2],
        [0.0, -1.6, 0.0],
        [0.0, 0.0, -1.6],
    );
    scene.build()
}

/// The scene, scaled and then moved; point lights keep the irradiance they cause.
fn placed(scene: &SceneDescription, scale: f64, offset: DVec3) -> SceneDescription {
    let mut scene = scene.clone();
    let place = |p: &mut DVec3| *p = *p * scale + offset;
    for shape in &mut scene.shapes {
        match &mut shape.geometry {
            ShapeGeometry::Mesh(mesh) => mesh.positions.iter_mut().for_each(place),
            ShapeGeometry::Quad(corners) => corners.iter_mut().for_each(place),
            ShapeGeometry::Sphere { center, radius } => {
                place(center);
                *radius *= scale;
            }
        }
    }
    for light in &mut scene.point_lights {
        place(&mut light.position);
        light.intensity *= scale * scale;
    }
    for camera in &mut scene.cameras {
        if let Projection::Plane {
            eye,
            top_left,
            right,
            down,
        } = &mut camera.projection
        {
            place(eye);
            place(top_left);
            *right *= scale;
            *down *= scale;
        }
    }
    scene
}

/// Difference of two pictures' means over the first one's. Both are made with the same random numbers, so
/// that most paths are the same.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let (a, b) = (a.mean().0, b.mean().0);
    ((b - a) / a).abs()
}

pub(super) fn same_picture(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(32);
    let base = room();
    let sizes = [1e-6, 1e-3, 1e3, 1e7].map(|scale| (scale, 0.0));
    let places = [1e3, 1e4, 1e5, 1e6].map(|far| (1.0, far));
    for (scale, far) in sizes.into_iter().chain(places) {
        let scene = placed(&base, scale, far * DVec3::new(1.0, -0.3, 0.7));
        trial.on_structures(
            format!("scale {scale:e}, moved by {far:e}"),
            "mean of the picture at scale 1",
            |trial, structure| {
                let settings = RenderSettings {
                    accel: kind(structure),
                    budget: Budget::Samples(samples),
                    ..path(Strategy::Mis, 8)
                };
                let at_home = trial.picture(&base, [24, 24], &settings)?;
                let away = trial.picture(&scene, [24, 24], &settings)?;
                let samples = away.film.total_samples();
                Ok(Figure::relative(difference(&at_home, &away), 1e-4, samples))
            },
        )?;
    }
    Ok(())
}
