//! `[cameras.NAME]`.

use glam::DVec3;

use super::description::{CameraDescription, Projection};
use super::document::{Entry, Node};
use super::values;
use crate::error::Result;

/// Sine of the angle, or share of an edge, below which directions count as parallel and a plane as
/// a line: far above the rounding of decimals to f64 (1e-16), far below any view one would want.
const DEGENERATE: f64 = 1e-9;

const PLANE_KEYS: [&str; 4] = ["eye", "top_left", "right", "down"];
const LOOK_AT_KEYS: [&str; 4] = ["eye", "look_at", "up", "fov"];

/// One camera. Errors if its image plane is degenerate, seen edge-on, or cannot be made.
pub(super) fn read(entry: &Entry) -> Result<CameraDescription> {
    let node = &entry.node;
    let is_plane = node
        .table()?
        .iter()
        .any(|entry| PLANE_KEYS[1..].contains(&entry.key.as_str()));
    let projection = if is_plane {
        read_plane(node)?
    } else {
        read_look_at(node)?
    };
    Ok(CameraDescription {
        name: entry.key.clone(),
        projection,
    })
}

fn read_plane(node: &Node) -> Result<Projection> {
    let fields = node.fields("a camera with an image plane", &PLANE_KEYS)?;
    let vector = |key| values::point(fields.required(key)?, key);
    let (eye, top_left) = (vector("eye")?, vector("top_left")?);
    let (right, down) = (vector("right")?, vector("down")?);
    let normal = right.cross(down);
    if normal.length() <= DEGENERATE * right.length() * down.length() {
        return Err(node
            .spot
            .error("the image plane is degenerate: `right` and `down` are parallel or zero"));
    }
    let reach = (top_left - eye).length() + right.length() + down.length();
    if (top_left - eye).dot(normal.normalize()).abs() <= DEGENERATE * reach {
        return Err(node
            .spot
            .error("the image plane is degenerate: the eye lies in it"));
    }
    Ok(Projection::Plane {
        eye,
        top_left,
        right,
        down,
    })
}

fn read_look_at(node: &Node) -> Result<Projection> {
    let fields = node.fields("a camera with a field of view", &LOOK_AT_KEYS)?;
    let vector = |key| values::point(fields.required(key)?, key);
    let eye = vector("eye")?;
    let target = vector("look_at")?;
    let up_node = fields.required("up")?;
    let up = values::point(up_node, "up")?;
    let fov_y = values::number(
        fields.required("fov")?,
        "fov",
        "between 0 and 180 degrees, both excluded",
        |degrees| degrees > 0.0 && degrees < 180.0,
    )?;
    let view: DVec3 = target - eye;
    if view == DVec3::ZERO {
        return Err(node.spot.error("`eye` and `look_at` are the same point"));
    }
    if view.cross(up).length() <= DEGENERATE * view.length() * up.length() {
        return Err(up_node
            .spot
            .error("`up` must not be zero or parallel to the view"));
    }
    Ok(Projection::LookAt {
        eye,
        target,
        up,
        fov_y,
    })
}
