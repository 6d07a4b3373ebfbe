//! From the document to the description: top level, film, lights, background, render.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use super::description::{
    CameraDescription, FilmDescription, MaterialDescription, MaterialId, PointLightDescription,
    SceneDescription, ShapeDescription,
};
use super::document::{Fields, Node};
use super::library::Library;
use super::settings::RenderDefaults;
use super::{cameras, materials, shapes, values};
use crate::error::Result;

/// Most pixels in a row or column.
const MAX_FILM: u32 = 65_535;

/// Largest exposure, in stops either way: 2^127 is f32's largest power of two.
const MAX_EXPOSURE: f64 = 127.0;

/// The scene in `root`, which came from `path`.
pub(super) fn scene(root: &Node, path: &Path) -> Result<SceneDescription> {
    let fields = root.fields(
        "a scene",
        &[
            "film",
            "camera",
            "cameras",
            "materials",
            "shapes",
            "lights",
            "background",
            "render",
        ],
    )?;
    if root.table()?.is_empty() {
        return Err(root.spot.error("the scene is empty"));
    }
    let mut library = Library {
        materials: read_materials(&fields)?,
        ..Library::default()
    };
    Ok(SceneDescription {
        source: path.to_owned(),
        film: read_film(fields.required("film")?)?,
        cameras: read_cameras(root, &fields)?,
        shapes: read_shapes(&fields, &mut library)?,
        materials: library.materials,
        textures: library.textures,
        point_lights: list(&fields, "lights")?
            .iter()
            .map(read_light)
            .collect::<Result<_>>()?,
        background: match fields.optional("background") {
            Some(node) => {
                let background = node.fields("the background", &["radiance"])?;
                values::radiance(background.required("radiance")?, "radiance")?
            }
            None => DVec3::ZERO,
        },
        render: match fields.optional("render") {
            Some(node) => read_render(node)?,
            None => RenderDefaults::default(),
        },
        mesh_files: library.mesh_files,
        warnings: library.warnings,
    })
}

/// The elements of an array that may be missing.
fn list<'a>(fields: &Fields<'a>, key: &str) -> Result<&'a [Node]> {
    fields.optional(key).map_or(Ok(&[]), Node::array)
}

fn read_film(node: &Node) -> Result<FilmDescription> {
    let film = node.fields("the film", &["width", "height", "exposure"])?;
    let pixels = |key| values::integer(film.required(key)?, key, 1, MAX_FILM);
    Ok(FilmDescription {
        width: pixels("width")?,
        height: pixels("height")?,
        exposure: match film.optional("exposure") {
            Some(node) => values::number(node, "exposure", "between -127 and 127", |stops| {
                stops.abs() <= MAX_EXPOSURE
            })?,
            None => 0.0,
        },
    })
}

/// All cameras in the order of the file, but the one that `camera` names first.
fn read_cameras(root: &Node, fields: &Fields<'_>) -> Result<Vec<CameraDescription>> {
    let node = fields
        .optional("cameras")
        .ok_or_else(|| root.spot.error("the scene has no camera"))?;
    let mut all: Vec<CameraDescription> = node
        .table()?
        .iter()
        .map(cameras::read)
        .collect::<Result<_>>()?;
    if all.is_empty() {
        return Err(node.spot.error("the scene has no camera"));
    }
    if let Some(choice) = fields.optional("camera") {
        let name = choice.string()?;
        let index = all
            .iter()
            .position(|camera| camera.name == name)
            .ok_or_else(|| choice.spot.error(format!("there is no camera `{name}`")))?;
        all[..=index].rotate_right(1);
    }
    Ok(all)
}

fn read_materials(fields: &Fields<'_>) -> Result<Vec<MaterialDescription>> {
    match fields.optional("materials") {
        Some(node) => node.table()?.iter().map(materials::read).collect(),
        None => Ok(Vec::new()),
    }
}

fn read_shapes(fields: &Fields<'_>, library: &mut Library) -> Result<Vec<ShapeDescription>> {
    let ids: HashMap<String, MaterialId> = library
        .materials
        .iter()
        .zip((0..).map(MaterialId))
        .map(|(material, id)| (material.name.clone(), id))
        .collect();
    let mut names = HashSet::new();
    let mut all = Vec::new();
    for node in list(fields, "shapes")? {
        let shape = shapes::read(node, &ids, library)?;
        if !shape.name.is_empty() && !names.insert(shape.name.clone()) {
            return Err(node
                .spot
                .error(format!("another shape has the name `{}`", shape.name)));
        }
        all.push(shape);
    }
    Ok(all)
}

fn read_light(node: &Node) -> Result<PointLightDescription> {
    node.tag("a light", &["point"])?;
    let light = node.fields(
        "a light of type `point`",
        &["name", "type", "position", "intensity"],
    )?;
    light.optional("name").map(Node::string).transpose()?;
    Ok(PointLightDescription {
        position: values::point(light.required("position")?, "position")?,
        intensity: values::radiance(light.required("intensity")?, "intensity")?,
    })
}

fn read_render(node: &Node) -> Result<RenderDefaults> {
    let mut settings = toml::Table::new();
    for entry in node.table()? {
        let value = entry.node.scalar()?;
        // Each key alone first, so that a mistake is found at its place.
        let alone = toml::Table::from_iter([(entry.key.clone(), value.clone())]);
        let defaults = RenderDefaults::deserialize(alone)
            .map_err(|error| entry.key_spot.error(error.message().replace('\n', " ")))?;
        if defaults.spp == Some(0) || defaults.max_depth == Some(0) {
            return Err(entry
                .node
                .spot
                .error(format!("`{}` must be > 0, got 0", entry.key)));
        }
        match entry.key.as_str() {
            "clamp" => {
                values::number(&entry.node, "clamp", "> 0 and finite", |x| {
                    x > 0.0 && x.is_finite()
                })?;
            }
            "shadow_bias" => {
                let rule = "≥ 0 and at most 1.8e18";
                values::number(&entry.node, "shadow_bias", rule, |x| {
                    (0.0..=values::MAX_COORDINATE).contains(&x)
                })?;
            }
            _ => {}
        }
        settings.insert(entry.key.clone(), value.clone());
    }
    RenderDefaults::deserialize(settings).map_err(|error| node.spot.error(error.message()))
}
