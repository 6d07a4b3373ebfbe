//! Scenes as written: reading, checking, meshes. Nothing here knows how they are traced.
//!
//! # The scene file
//!
//! A scene is one [TOML](https://toml.io) file in UTF-8. Lengths are in metres, radiance is in
//! W·sr⁻¹·m⁻² and radiant intensity in W·sr⁻¹, both linear RGB; axes are right-handed and no axis
//! is "up". A colour is three numbers, or one number for all three channels. Unknown keys are
//! errors, so that a misspelt one cannot pass for a default.
//!
//! ```toml
//! [film]
//! width = 320                       # pixels, 1 to 65535
//! height = 240
//! exposure = 0.0                    # stops; PNG values are multiplied by 2^exposure; default 0
//!
//! [cameras.front]                   # the first camera is the default one
//! eye = [0, -4, 1]
//! look_at = [0, 0, 1]               # the point in the middle of the image
//! up = [0, 0, 1]
//! fov = 40                          # vertical field of view in degrees, in (0, 180)
//!
//! [materials.chalk]
//! type = "lambertian"
//! reflectance = [0.7, 0.7, 0.6]
//!
//! [materials.lamp]
//! type = "emitter"
//! emission = 20
//!
//! [[shapes]]
//! name = "ball"
//! type = "sphere"
//! material = "chalk"
//! center = [0, 0, 1]
//! radius = 1
//!
//! [[shapes]]
//! type = "quad"
//! material = "lamp"
//! corners = [[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3]]   # faces down
//! ```
//!
//! ## Top level
//! | key | meaning |
//! | --- | --- |
//! | `extends` | another scene file, relative to this one, that this one changes (see below) |
//! | `camera` | name of the default camera, if not the first |
//! | `[film]` | `width`, `height`, `exposure` |
//! | `[cameras.NAME]` | pinhole cameras, at least one |
//! | `[materials.NAME]` | materials |
//! | `[[shapes]]` | everything with a surface |
//! | `[[lights]]` | lights without a surface: `type = "point"`, `position`, `intensity`, `name` (optional) |
//! | `[background]` | `radiance` of every ray that leaves the scene; default 0 |
//! | `[closed_form]` | what the exact image is known to be (see below) |
//! | `[render]` | defaults of the render's settings: the keys of [`RenderDefaults`] |
//!
//! ## Cameras
//! Either `eye`, `look_at`, `up`, `fov` as above: then the image plane has the film's aspect. Or
//! `eye`, `top_left`, `right`, `down`: an image plane given by the corner that is its top left as
//! seen from the eye and by its two edges from there, whatever the film's aspect.
//!
//! ## Materials
//! All surfaces scatter on both sides.
//!
//! | `type` | keys |
//! | --- | --- |
//! | `lambertian` | `reflectance` in [0, 1] |
//! | `oren-nayar` | `reflectance` of the facets in [0, 1]; `sigma`, the standard deviation of their slope in radians, 0 to `inf` |
//! | `mirror` | `reflectance` in [0, 1], default 1 |
//! | `dielectric` | `ior`, inside over outside, in [0.001, 1000]; `fresnel`, `"exact"` (default) or `"schlick"` |
//! | `phong` | `reflectance` of the lobe in [0, 1]; `exponent` in [0, 1e6] |
//! | `glossy` | `diffuse` and `specular`, together at most 1 per channel; `exponent` of the specular lobe in [0, 1e6] |
//! | `black`, `emitter` | reflects nothing; an `emitter` must have `emission` |
//!
//! Any material may have `emission`, a radiance ≥ 0, the same in every direction. It leaves the
//! side of the geometric normal, or both with `two_sided = true`.
//!
//! ## Shapes
//! Each has a `material`, unless it is an OBJ file, and may have a `name`, unique in the scene. The geometric normal of a
//! face with corners a, b, c is along (b − a) × (c − a): corners are counter-clockwise as seen
//! from the front. No coordinate may exceed 1.8e18 in absolute value.
//!
//! | `type` | keys |
//! | --- | --- |
//! | `quad` | `corners`: four points in order, in a plane (to 1e-6 of the quad's size), convex |
//! | `triangles` | `positions`: points; `faces`: triples of indices into them, from 0 |
//! | `sphere` | `center`, `radius` > 0; the normal points outward |
//! | `obj` | `file`, a Wavefront OBJ file relative to the scene file; `scale`, `translate`; without `material`, the materials of its MTL files |
//! | `mesh` | `mesh`, the name of a procedural mesh, with its keys; `scale`, `translate` |
//!
//! | `mesh` | keys and defaults |
//! | --- | --- |
//! | `box` | about the origin; `size = [1, 1, 1]` |
//! | `icosphere` | about the origin; `radius = 1`, `subdivisions = 3` (0 to 9): 20·4ⁿ faces |
//! | `torus` | about the z axis; `radius = 1`, `tube_radius = 0.25`, `segments = 64` around the axis, `sides = 32` around the tube (3 to 2048) |
//! | `grid` | unit square in z = 0 about the origin, facing +z; `cells = [16, 16]` (1 to 2048) |
//! | `hairball`, `terrain`, `soup` | thin tubes that grow from a small sphere, a fractal heightfield with z up, random triangles; in [−1, 1]³; `triangles = 100000` (1000 to 30000000), at most so many; `seed = 0` (0 to 4294967295) |
//! | `sponge` | Menger's, in [−1, 1]³; `triangles = 100000`: the largest of 144, 2112, 36096, 672768 and 13062144 that is not more |
//!
//! `scale` (one factor or one per axis, not 0) is applied before `translate`; fronts stay fronts
//! under negative factors. Faces of zero area are errors where they are written in the scene file;
//! in OBJ files and procedural meshes they, and faces with non-finite or too large coordinates, are removed
//! and counted in [`SceneDescription::warnings`], as are faces that occur twice and vertices of no face
//! in any mesh.
//!
//! ## Closed forms
//! A scene whose exact image is known may state it; errors are then measured against that.
//!
//! | `type` | meaning |
//! | --- | --- |
//! | `constant` | `radiance` at every pixel |
//! | `direct` | Lambertian surfaces under one-sided emitters that are polygons and reflect nothing; nothing is in the light's way, and no surface that reflects sees another |
//!
//! ## OBJ files
//! Positions, faces, normals, texture coordinates and materials are used; polygons, concave ones too,
//! become triangles. The file may be compressed by gzip or Zstandard. Without `material`, each face has
//! the one that `usemtl` names, from the files that `mtllib` names; `src/scene/obj/material.rs` has the
//! table of what becomes of MTL values. They are added to the scene as `FILE/NAME`. What is missing or
//! makes no sense is counted in the warnings: a face without a material is grey, a material without its
//! texture plain. Files are sought in any case and with either slash.
//!
//! An OBJ file may stand in for a scene file, by the name `.obj`, `.obj.gz` or `.obj.zst`. It then has a
//! film of 800 × 600 pixels, a camera `view` that looks at the whole mesh from the front, the right
//! and above (+y is up, +z the front, whatever the mesh), and unless a material of it has `Ke`, a
//! sky and a quad `sun`. Overrides change these as if they were written: `film.width=64`,
//! `cameras.view.up=[0,0,1]`.
//!
//! ## Files that build on another
//! With `extends = "base.toml"` a file states only what differs. Tables are merged key by key, the
//! derived file winning; but one that has its own `type` replaces the base's as a whole. The
//! `shapes` and `lights` of the derived file are added to those of the base; every other array is
//! replaced. Files named in the base stay relative to the base. Up to 16 files may form a chain.
//!
//! ## Overrides
//! `path.to.key=value` replaces one value: `film.width=64`, `materials.glass.ior=1.75`,
//! `shapes.ball.radius=0.5`, `cameras.front.eye.2=2`. Elements of an array are named by their
//! `name`, else by their index from 0; names with other characters than letters, digits, `_` and
//! `-` are quoted. The value is TOML, and where it is none, a string: `materials.glass.fresnel=schlick`.
//! Files named by an override are relative to the working directory. Overrides are applied in
//! order, after `extends`, and before the scene is checked.

mod cameras;
pub mod description;
mod diagnostics;
mod document;
mod extends;
mod files;
pub mod fingerprint;
mod library;
mod materials;
mod mesh;
mod mesh_scene;
mod obj;
mod overrides;
pub mod procedural;
mod reader;
pub mod settings;
mod shapes;
#[cfg(test)]
mod tests;
mod values;

use std::ffi::OsStr;
use std::path::Path;

pub use description::*;
pub use fingerprint::fingerprint;
pub use settings::*;

use crate::error::Result;

/// Reads and checks the scene file `path` with the files that it names, after applying
/// `overrides` of the form `path.to.key=value` in order. An OBJ file gets a scene of its own.
///
/// Errors with the first mistake found: one in a scene or OBJ file has the file's place (line and
/// column where one can be given), one in an override quotes it as `--set path.to.key=value`.
pub fn load(path: &Path, overrides: &[String]) -> Result<SceneDescription> {
    if obj::stem(path).is_some() {
        return mesh_scene::load(path, overrides);
    }
    parse(extends::read_text(path)?, path, overrides)
}

/// The name of the scene in a file: the file's without folder and endings.
pub fn name(path: &Path) -> &OsStr {
    let stem = obj::stem(path).map(OsStr::new).or(path.file_stem());
    stem.unwrap_or(OsStr::new("scene"))
}

/// As [`load`], for a scene file whose `text` is given: `path` names it in errors, and files that
/// it names are sought relative to that path.
pub fn parse(
    text: impl Into<String>,
    path: &Path,
    overrides: &[String],
) -> Result<SceneDescription> {
    let mut root = extends::resolve(text.into(), path)?;
    for option in overrides {
        overrides::apply(&mut root, option)?;
    }
    reader::scene(&root, path)
}
