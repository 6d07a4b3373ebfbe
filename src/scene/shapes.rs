//! `[[shapes]]`.

use std::collections::HashMap;

use glam::DVec3;

use super::description::{MaterialId, Mesh, ShapeDescription, ShapeGeometry};
use super::document::{Fields, Node, one_of};
use super::library::Library;
use super::procedural::{self, ScalableKind, ScalableMesh};
use super::{mesh, obj, values};
use crate::error::Result;

/// How far from its plane a quad's last corner may lie, as a share of the quad's size: looser than
/// coordinates written with seven digits need.
const PLANARITY: f64 = 1e-6;

/// Splits of an icosphere: 5.2 million faces.
const MAX_SUBDIVISIONS: u32 = 9;

/// Segments, sides or cells of a procedural mesh along one direction: 8.4 million faces in two.
const MAX_STEPS: u32 = 2048;

/// Triangles of a mesh of any size, unless it says otherwise.
const DEFAULT_TRIANGLES: u32 = 100_000;

const TYPES: [&str; 5] = ["quad", "triangles", "sphere", "obj", "mesh"];
const COMMON_KEYS: [&str; 3] = ["name", "material", "type"];

/// One shape. `materials` maps names to ids; what else the scene needs for it goes to `library`.
pub(super) fn read(
    node: &Node,
    materials: &HashMap<String, MaterialId>,
    library: &mut Library,
) -> Result<ShapeDescription> {
    let tag = node.tag("a shape", &TYPES)?;
    let (kind, own_keys) = match tag {
        "mesh" => mesh_keys(node)?,
        "quad" => ("shape of type `quad`", &["corners"][..]),
        "triangles" => ("shape of type `triangles`", &["positions", "faces"][..]),
        "sphere" => ("shape of type `sphere`", &["center", "radius"][..]),
        _ => ("shape of type `obj`", &["file", "scale", "translate"][..]),
    };
    let what = format!("a {kind}");
    let fields = node.fields(&what, &[&COMMON_KEYS, own_keys].concat())?;

    let name = fields.optional("name").map(Node::string).transpose()?;
    let material = fields
        .optional("material")
        .map(|node| find_material(node, materials))
        .transpose()?;
    let (geometry, material) = if tag == "obj" {
        read_obj(&fields, material, library)?
    } else {
        let material = match material {
            Some(material) => material,
            None => find_material(fields.required("material")?, materials)?,
        };
        (read_geometry(tag, node, &fields, library)?, material)
    };
    Ok(ShapeDescription {
        name: name.unwrap_or_default().to_owned(),
        geometry,
        material,
    })
}

fn find_material(node: &Node, materials: &HashMap<String, MaterialId>) -> Result<MaterialId> {
    let name = node.string()?;
    let found = materials.get(name).copied();
    found.ok_or_else(|| node.spot.error(format!("there is no material `{name}`")))
}

/// The mesh of an OBJ file, and the material of faces that have no other: `material` if there is one, else
/// the file's own.
fn read_obj(
    fields: &Fields<'_>,
    material: Option<MaterialId>,
    library: &mut Library,
) -> Result<(ShapeGeometry, MaterialId)> {
    let node = fields.required("file")?;
    let path = node.spot.resolve(node.string()?);
    let mut obj = obj::read(&path, |error| node.spot.io_error(&path, error))?;
    let material = material.unwrap_or_else(|| obj.use_own_materials(library));
    place(&mut obj.mesh, fields)?;
    let mesh = obj.finish(library, || {
        node.spot.error("no face of the mesh can be traced")
    })?;
    Ok((ShapeGeometry::Mesh(mesh), material))
}

/// What a shape of any other type is.
fn read_geometry(
    tag: &str,
    node: &Node,
    fields: &Fields<'_>,
    library: &mut Library,
) -> Result<ShapeGeometry> {
    Ok(match tag {
        "quad" => ShapeGeometry::Quad(read_quad(fields.required("corners")?)?),
        "sphere" => ShapeGeometry::Sphere {
            center: values::point(fields.required("center")?, "center")?,
            radius: values::length(fields.required("radius")?, "radius")?,
        },
        "triangles" => {
            let mesh = read_triangles(fields)?;
            ShapeGeometry::Mesh(cleaned(mesh, node, library)?)
        }
        _ => {
            let mut mesh = make_mesh(fields)?;
            place(&mut mesh, fields)?;
            ShapeGeometry::Mesh(cleaned(mesh, node, library)?)
        }
    })
}

/// A face, as indices below `vertices`.
fn read_face(node: &Node, vertices: usize) -> Result<[u32; 3]> {
    let elements = node.array()?;
    let [a, b, c] = elements else {
        return Err(node.spot.error(format!(
            "a face has three vertex indices, this one {}",
            elements.len()
        )));
    };
    let index = |element: &Node| {
        let index = element.integer()?;
        u32::try_from(index)
            .ok()
            .filter(|&index| (index as usize) < vertices)
            .ok_or_else(|| {
                element.spot.error(format!(
                    "vertex {index} does not exist; there are {vertices}, counted from 0"
                ))
            })
    };
    Ok([index(a)?, index(b)?, index(c)?])
}

fn read_triangles(fields: &Fields<'_>) -> Result<Mesh> {
    let positions = fields
        .required("positions")?
        .array()?
        .iter()
        .map(|position| values::point(position, "positions"))
        .collect::<Result<Vec<DVec3>>>()?;
    let face_nodes = fields.required("faces")?;
    let mut faces = Vec::new();
    for node in face_nodes.array()? {
        let face = read_face(node, positions.len())?;
        if mesh::is_degenerate(face.map(|index| positions[index as usize])) {
            return Err(node.spot.error("the face has no area"));
        }
        faces.push(face);
    }
    if faces.is_empty() {
        return Err(face_nodes.spot.error("there are no faces"));
    }
    Ok(Mesh {
        positions,
        faces,
        ..Mesh::default()
    })
}

fn read_quad(node: &Node) -> Result<[DVec3; 4]> {
    let elements = node.array()?;
    let [a, b, c, d] = elements else {
        return Err(node.spot.error(format!(
            "a quad has four corners, this one {}",
            elements.len()
        )));
    };
    let corner = |element| values::point(element, "corners");
    let corners = [corner(a)?, corner(b)?, corner(c)?, corner(d)?];
    match quad_mistake(corners) {
        Some(mistake) => Err(node.spot.error(mistake)),
        None => Ok(corners),
    }
}

/// What is wrong with a quad, if anything: its corners must be distinct, lie in a plane, and turn
/// the same way.
fn quad_mistake(corners: [DVec3; 4]) -> Option<&'static str> {
    let [a, b, c, d] = corners;
    let turns = [[a, b, c], [b, c, d], [c, d, a], [d, a, b]];
    if turns.into_iter().any(mesh::is_degenerate) {
        return Some("three corners of the quad lie on a line");
    }
    let normal = (b - a).cross(c - a).normalize();
    let size = (c - a).length().max((d - b).length());
    if (d - a).dot(normal).abs() > PLANARITY * size {
        return Some("the quad is not planar");
    }
    let turns_left = |[p, q, r]: [DVec3; 3]| (q - p).cross(r - q).dot(normal) > 0.0;
    if !turns.into_iter().all(turns_left) {
        return Some("the quad is not convex");
    }
    None
}

/// Applies `scale` and `translate`.
fn place(mesh: &mut Mesh, fields: &Fields<'_>) -> Result<()> {
    let scale = fields.optional("scale").map(values::scale).transpose()?;
    let translate = fields
        .optional("translate")
        .map(|node| values::point(node, "translate"))
        .transpose()?;
    mesh::place(
        mesh,
        scale.unwrap_or(DVec3::ONE),
        translate.unwrap_or(DVec3::ZERO),
    );
    Ok(())
}

/// The mesh without faces that cannot be traced; a warning at `node` counts them. Errors if none is left.
fn cleaned(mut mesh: Mesh, node: &Node, library: &mut Library) -> Result<Mesh> {
    let removed = mesh::clean(&mut mesh);
    let sentences = removed.sentences(|_| None, |_| None);
    let warnings = sentences.map(|line| node.spot.warning(&line));
    library.warnings.extend(warnings);
    if mesh.faces.is_empty() {
        return Err(node.spot.error("no face of the mesh can be traced"));
    }
    Ok(mesh)
}

/// Which procedural mesh `node` is, for messages, and its keys.
fn mesh_keys(node: &Node) -> Result<(&'static str, &'static [&'static str])> {
    const MESHES: [&str; 8] = [
        "box",
        "icosphere",
        "torus",
        "grid",
        "hairball",
        "terrain",
        "sponge",
        "soup",
    ];
    const SEEDED_KEYS: &[&str] = &["mesh", "scale", "translate", "triangles", "seed"];
    let entry = node.table()?.iter().find(|entry| entry.key == "mesh");
    let entry = entry.ok_or_else(|| node.spot.error("a shape of type `mesh` needs `mesh`"))?;
    Ok(match one_of(&entry.node, "mesh", &MESHES)? {
        "box" => ("mesh `box`", &["mesh", "scale", "translate", "size"]),
        "icosphere" => (
            "mesh `icosphere`",
            &["mesh", "scale", "translate", "radius", "subdivisions"],
        ),
        "torus" => (
            "mesh `torus`",
            &[
                "mesh",
                "scale",
                "translate",
                "radius",
                "tube_radius",
                "segments",
                "sides",
            ],
        ),
        "hairball" => ("mesh `hairball`", SEEDED_KEYS),
        "terrain" => ("mesh `terrain`", SEEDED_KEYS),
        "sponge" => (
            "mesh `sponge`",
            &["mesh", "scale", "translate", "triangles"],
        ),
        "soup" => ("mesh `soup`", SEEDED_KEYS),
        _ => ("mesh `grid`", &["mesh", "scale", "translate", "cells"]),
    })
}

fn make_mesh(fields: &Fields<'_>) -> Result<Mesh> {
    let length = |key, default| match fields.optional(key) {
        Some(node) => values::length(node, key),
        None => Ok(default),
    };
    let count = |key, min, max, default| match fields.optional(key) {
        Some(node) => values::integer(node, key, min, max),
        None => Ok(default),
    };
    let scalable = |kind| {
        let (min, max) = (ScalableMesh::MIN_TRIANGLES, ScalableMesh::MAX_TRIANGLES);
        let triangles = count("triangles", min, max, DEFAULT_TRIANGLES)?;
        let seed = count("seed", 0, u32::MAX, 0)?;
        Ok(ScalableMesh::new(kind, triangles, seed.into())?.to_mesh())
    };
    Ok(match fields.required("mesh")?.string()? {
        "hairball" => scalable(ScalableKind::Hairball)?,
        "terrain" => scalable(ScalableKind::Terrain)?,
        "sponge" => scalable(ScalableKind::Sponge)?,
        "soup" => scalable(ScalableKind::Soup)?,
        "box" => procedural::cuboid(match fields.optional("size") {
            Some(node) => read_size(node)?,
            None => DVec3::ONE,
        }),
        "icosphere" => procedural::icosphere(
            length("radius", 1.0)?,
            count("subdivisions", 0, MAX_SUBDIVISIONS, 3)?,
        ),
        "torus" => procedural::torus(
            length("radius", 1.0)?,
            length("tube_radius", 0.25)?,
            count("segments", 3, MAX_STEPS, 64)?,
            count("sides", 3, MAX_STEPS, 32)?,
        ),
        _ => procedural::grid(match fields.optional("cells") {
            Some(node) => read_cells(node)?,
            None => [16, 16],
        }),
    })
}

fn read_size(node: &Node) -> Result<DVec3> {
    let elements = node.array()?;
    let [x, y, z] = elements else {
        return Err(node.spot.error("`size` must have three lengths"));
    };
    let edge = |element| values::length(element, "size");
    Ok(DVec3::new(edge(x)?, edge(y)?, edge(z)?))
}

fn read_cells(node: &Node) -> Result<[u32; 2]> {
    let elements = node.array()?;
    let [columns, rows] = elements else {
        return Err(node.spot.error("`cells` must have two numbers"));
    };
    let count = |element| values::integer(element, "cells", 1, MAX_STEPS);
    Ok([count(columns)?, count(rows)?])
}
