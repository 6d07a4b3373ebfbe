//! Numbers, points and colours, each with its range check.

use glam::DVec3;

use super::document::Node;
use crate::error::Result;

/// Largest absolute coordinate or length in metres. The squared distance of two such points,
/// 3·(3.6e18)² = 3.9e37, stays below the largest f32, 3.4e38.
pub(super) const MAX_COORDINATE: f64 = 1.8e18;

/// Largest radiance or intensity: leaves f32 eight decades for products with cosines and weights.
const MAX_RADIANCE: f64 = 1e30;

/// The number `node` if it satisfies `holds`; else an error that says "`name` must be `rule`".
pub(super) fn number(
    node: &Node,
    name: &str,
    rule: &str,
    holds: impl Fn(f64) -> bool,
) -> Result<f64> {
    let value = node.number()?;
    if holds(value) {
        Ok(value)
    } else {
        Err(node
            .spot
            .error(format!("`{name}` must be {rule}, got {value}")))
    }
}

/// The whole number `node` if it lies in `min ..= max`.
pub(super) fn integer(node: &Node, name: &str, min: u32, max: u32) -> Result<u32> {
    let value = node.integer()?;
    u32::try_from(value)
        .ok()
        .filter(|value| (min..=max).contains(value))
        .ok_or_else(|| {
            node.spot.error(format!(
                "`{name}` must be between {min} and {max}, got {value}"
            ))
        })
}

/// Three numbers that each satisfy `holds`.
fn triple(node: &Node, name: &str, rule: &str, holds: impl Fn(f64) -> bool) -> Result<DVec3> {
    let elements = node.array()?;
    let [x, y, z] = elements else {
        return Err(node.spot.error(format!(
            "`{name}` must have three numbers, has {}",
            elements.len()
        )));
    };
    let component = |element| number(element, name, rule, &holds);
    Ok(DVec3::new(component(x)?, component(y)?, component(z)?))
}

/// A point or vector in metres: finite, no coordinate beyond [`MAX_COORDINATE`].
pub(super) fn point(node: &Node, name: &str) -> Result<DVec3> {
    triple(
        node,
        name,
        "finite and at most 1.8e18 in absolute value",
        |x| x.abs() <= MAX_COORDINATE,
    )
}

/// A length in metres: > 0, not so small that f32 has no such normal number, at most [`MAX_COORDINATE`].
pub(super) fn length(node: &Node, name: &str) -> Result<f64> {
    number(
        node,
        name,
        "> 0 (at least 1.2e-38) and at most 1.8e18",
        |x| x >= f64::from(f32::MIN_POSITIVE) && x <= MAX_COORDINATE,
    )
}

/// A factor per axis, written as one number or three; none is 0.
pub(super) fn scale(node: &Node) -> Result<DVec3> {
    number_or_triple(
        node,
        "scale",
        "finite, not 0 and at most 1.8e18 in absolute value",
        |x| x != 0.0 && x.abs() <= MAX_COORDINATE,
    )
}

/// RGB shares in [0, 1], written as one number or three.
pub(super) fn albedo(node: &Node, name: &str) -> Result<DVec3> {
    number_or_triple(node, name, "in [0, 1]", |x| (0.0..=1.0).contains(&x))
}

/// RGB radiance or intensity, written as one number or three: finite, ≥ 0.
pub(super) fn radiance(node: &Node, name: &str) -> Result<DVec3> {
    number_or_triple(node, name, "≥ 0 and at most 1e30", |x| {
        (0.0..=MAX_RADIANCE).contains(&x)
    })
}

fn number_or_triple(
    node: &Node,
    name: &str,
    rule: &str,
    holds: impl Fn(f64) -> bool,
) -> Result<DVec3> {
    if node.array().is_ok() {
        triple(node, name, rule, holds)
    } else {
        Ok(DVec3::splat(number(node, name, rule, holds)?))
    }
}
