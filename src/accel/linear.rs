//! No structure: [`LANES`] rays at a time against every primitive. For a few dozen primitives this beats
//! every tree.
//!
//! Triangles are tested as convex polygons over shared vertices and edges. Each group of rays puts every
//! vertex once into the frame of each ray, takes every edge function once, and then decides every polygon
//! from the signs of its edges. Watertight by the argument of Woop, Benthin and Wald (2013): a vertex has
//! one image per ray for all polygons around it, and an edge function of plain, unfused products has the
//! right sign for those images or is zero. Distances are n·(a − o) / n·d, compared as fractions, so that
//! one division per ray remains.
//!
//! A closed convex shell around everything (the walls of a room) needs no edges at all: a ray from inside
//! leaves through the plane that it reaches first (see [`super::shell`]). And shadow rays that cannot leave
//! the convex hull are not tested against what lies on it.
//!
//! What lanes cannot decide for certain goes to a scalar scan of the triangles, whole rays at a time: an
//! edge function of zero on a polygon that would be accepted, a ray nearly within the plane of a polygon
//! (where that quotient is not bounded by the polygon's extent, and the image of a merged polygon need not
//! be convex), and a start far outside of the scene.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use super::polygon::{MAX_CORNERS, Polygon, Polygons, polygons};
use super::shell::{HullPolygon, closed, ids, on_hull};
use super::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::geometry::hit::RayFrame;
use crate::geometry::sphere::sphere_distance;
use crate::geometry::triangle::ShearRay;
use crate::geometry::{Geometry, PrimitiveId, Sphere, Triangle};
use crate::math::float::gamma;
use crate::math::lanes::{
    Compare, F32s, LANES, Mask, U32s, from_bits, gather_u32, load, load_u32, store, store_u32,
    to_bits,
};
use crate::math::vec3::Vec3s;

/// Rays whose cosine with a face's normal is below this are grazing, and doubtful if they also start
/// within this share of the scene's extent from the plane. Above it the quotient of plane distances is
/// right to a thousandth of the distance. Of rays that start away from the plane one in 10⁶ is doubtful,
/// of rays within the plane (from a coplanar neighbour) one in 10³.
const GRAZING: f32 = 1.0 / 1024.0;

/// Rays that start farther than this many scene radii from the scene's centre are traced one at a time.
pub(super) const REACH: f32 = 32.0;

/// Bound of the error of a hit point, as a share of the largest coordinate: γ(7) of barycentric terms that
/// are at most three times that large on a merged polygon, and as much for the distance that chose the wall.
const SLACK: f32 = 2.0 * 3.0 * gamma(7);

/// A wall of the closed convex shell.
#[derive(Debug, Clone)]
struct Wall {
    /// Unit normal out of the shell.
    outward: [f32; 3],
    /// One of its corners.
    anchor: [f32; 3],
    id: u32,
}

/// A polygon as the scan reads it.
#[derive(Debug, Clone)]
struct Face {
    normal: [f32; 3],
    /// One of its corners.
    anchor: [f32; 3],
    id: u32,
    /// Where its corners are.
    corners: Range<usize>,
    /// For each corner the edge from it to the next: twice the edge's index, plus one if the face runs
    /// along it backward. Filled up by repeating the first, so that the loop over them has no end to find.
    uses: [[u16; 4]; MAX_CORNERS / 4],
}

/// Faces with the vertices and edges that they share.
#[derive(Debug)]
struct FaceSet {
    vertices: Vec<[f32; 3]>,
    /// Pairs of vertex indices; none if there are more than fit a [`Scratch`].
    edges: Vec<[u16; 2]>,
    faces: Vec<Face>,
    /// Vertex indices of all faces, in order.
    corners: Vec<u32>,
}

/// Every ray against every primitive.
#[derive(Debug)]
pub struct LinearScan {
    /// Every polygon.
    all: FaceSet,
    /// The closed convex shell, if there is one.
    walls: Vec<Wall>,
    /// The polygons beside the shell.
    inner: FaceSet,
    /// The polygons that a shadow ray can cross.
    crossed: FaceSet,
    /// Per triangle, the id under which its polygon is reported.
    owner: Vec<u32>,
    /// Per triangle, whether a shadow ray can cross it.
    crossable: Vec<bool>,
    triangles: Vec<Triangle>,
    spheres: Vec<Sphere>,
    /// Middle of the box around all vertices.
    center: [f32; 3],
    /// Sum of the half extents of that box: no vertex is farther from the centre.
    radius: f32,
    /// How far beyond a wall a point of another surface may lie by rounding.
    slack: f32,
}

/// Images of the vertices and signs of the edge functions for one group of rays.
struct Scratch<const VERTICES: usize, const USES: usize> {
    x: [F32s; VERTICES],
    y: [F32s; VERTICES],
    /// Lanes where the edge function of a use is ≥ 0; the other direction is beside it.
    not_negative: [Mask; USES],
}

/// Scratch sizes: vertices and edge uses.
const SMALL: (usize, usize) = (32, 256);
const LARGE: (usize, usize) = (256, 2048);

/// The nearest hit so far as a fraction t = numerator / denominator, denominator ≥ 0.
#[derive(Clone, Copy)]
struct Nearest {
    numerator: F32s,
    denominator: F32s,
    id: U32s,
}

impl Nearest {
    /// No hit.
    #[inline(always)]
    fn none() -> Self {
        Self {
            numerator: F32s::splat(1.0),
            denominator: F32s::splat(0.0),
            id: U32s::splat(PrimitiveId::NONE),
        }
    }
}

/// One group of rays.
#[derive(Clone, Copy)]
struct Rays {
    origin: Vec3s,
    direction: Vec3s,
    /// Primitive started on, as reported (the polygon's id).
    skip: U32s,
    active: Mask,
    /// Planes nearer than this to a start are near it.
    near_plane: F32s,
    /// Rays that start too far away for the lanes.
    distant: Mask,
}

/// Where the edge signs of a face come from.
trait Inside {
    /// Prepares a group of rays.
    fn project(&mut self, set: &FaceSet, rays: &Rays);
    /// Lanes whose line meets the face, and lanes among them with an edge value of zero.
    fn inside(&self, set: &FaceSet, face: &Face, rays: &Rays) -> (Mask, Mask);
}

impl<const VERTICES: usize, const USES: usize> Scratch<VERTICES, USES> {
    fn new() -> Self {
        let zero = F32s::splat(0.0);
        Self {
            x: [zero; VERTICES],
            y: [zero; VERTICES],
            not_negative: [Mask::NONE; USES],
        }
    }
}

impl<const VERTICES: usize, const USES: usize> Inside for Scratch<VERTICES, USES> {
    #[inline(always)]
    fn project(&mut self, set: &FaceSet, rays: &Rays) {
        let frame = RayFrame::new(rays.direction);
        for ((x, y), &vertex) in self.x.iter_mut().zip(&mut self.y).zip(&set.vertices) {
            (*x, *y) = frame.project(Vec3s::splat(vertex) - rays.origin);
        }
        for (signs, edge) in self.not_negative.chunks_exact_mut(2).zip(&set.edges) {
            // The sizes are powers of two, which spares a check.
            let [a, b] = edge.map(|vertex| usize::from(vertex) % VERTICES);
            let forward = self.x[a] * self.y[b];
            let backward = self.y[a] * self.x[b];
            signs[0] = forward.ge(backward);
            signs[1] = backward.ge(forward);
        }
    }

    #[inline(always)]
    fn inside(&self, _set: &FaceSet, face: &Face, _rays: &Rays) -> (Mask, Mask) {
        let (mut left, mut right, mut zero) = (Mask::ALL, Mask::ALL, Mask::NONE);
        let mut meet = |uses: &[u16; 4]| {
            for &edge in uses {
                let at = usize::from(edge) % USES;
                let (same, opposite) = (self.not_negative[at], self.not_negative[at ^ 1]);
                left = left & same;
                right = right & opposite;
                zero = zero | (same & opposite);
            }
        };
        meet(&face.uses[0]);
        if face.corners.len() > 4 {
            meet(&face.uses[1]);
        }
        let inside = left | right;
        (inside, inside & zero)
    }
}

/// For scenes that do not fit a [`Scratch`]: each face projects its own corners. The images are the same.
struct Unshared(Option<RayFrame>);

impl Inside for Unshared {
    #[inline(always)]
    fn project(&mut self, _set: &FaceSet, rays: &Rays) {
        self.0 = Some(RayFrame::new(rays.direction));
    }

    #[inline(always)]
    fn inside(&self, set: &FaceSet, face: &Face, rays: &Rays) -> (Mask, Mask) {
        let Some(frame) = self.0 else {
            return (Mask::NONE, Mask::NONE);
        };
        let corners = &set.corners[face.corners.clone()];
        let image =
            |corner: u32| frame.project(Vec3s::splat(set.vertices[corner as usize]) - rays.origin);
        let (mut left, mut right, mut zero) = (Mask::ALL, Mask::ALL, Mask::NONE);
        let first = image(corners[0]);
        let mut from = first;
        for next in corners[1..]
            .iter()
            .map(|&corner| image(corner))
            .chain([first])
        {
            let forward = from.0 * next.1;
            let backward = from.1 * next.0;
            let (same, opposite) = (forward.ge(backward), backward.ge(forward));
            left = left & same;
            right = right & opposite;
            zero = zero | (same & opposite);
            from = next;
        }
        let inside = left | right;
        (inside, inside & zero)
    }
}

impl FaceSet {
    /// The faces of `polygons`, whose corners are indices into `positions`.
    fn new<'a>(positions: &[[f32; 3]], polygons: impl Iterator<Item = &'a Polygon>) -> Self {
        let mut vertices: Vec<[f32; 3]> = Vec::new();
        let mut vertex_index = HashMap::new();
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let mut edge_index = HashMap::new();
        let (mut faces, mut corners) = (Vec::new(), Vec::new());
        for polygon in polygons {
            let polygon_corners: Vec<u32> = polygon
                .corners
                .iter()
                .map(|&corner| {
                    *vertex_index.entry(corner).or_insert_with(|| {
                        vertices.push(positions[corner as usize]);
                        vertices.len() as u32 - 1
                    })
                })
                .collect();
            let n = polygon_corners.len();
            let uses: Vec<usize> = (0..n)
                .map(|i| {
                    let (a, b) = (polygon_corners[i], polygon_corners[(i + 1) % n]);
                    let key = [a.min(b), a.max(b)];
                    let edge = *edge_index.entry(key).or_insert_with(|| {
                        edges.push(key);
                        edges.len() - 1
                    });
                    2 * edge + usize::from(a > b)
                })
                .collect();
            // Scenes in which the index does not fit 16 bits do without shared edges.
            let at = |i: usize| *uses.get(i).unwrap_or(&uses[0]) as u16;
            faces.push(Face {
                normal: polygon.normal,
                anchor: positions[polygon.corners[0] as usize],
                id: polygon.id,
                corners: corners.len()..corners.len() + n,
                uses: [0, 4].map(|from| [0, 1, 2, 3].map(|i| at(from + i))),
            });
            corners.extend_from_slice(&polygon_corners);
        }
        if vertices.len() > LARGE.0 || 2 * edges.len() > LARGE.1 {
            edges.clear();
        }
        Self {
            vertices,
            edges: edges
                .iter()
                .map(|edge| edge.map(|vertex| vertex as u16))
                .collect(),
            faces,
            corners,
        }
    }

    fn fits(&self, size: (usize, usize)) -> bool {
        self.vertices.len() <= size.0 && 2 * self.edges.len() <= size.1
    }

    fn bytes(&self) -> usize {
        std::mem::size_of_val(&*self.vertices)
            + std::mem::size_of_val(&*self.edges)
            + std::mem::size_of_val(&*self.faces)
            + std::mem::size_of_val(&*self.corners)
    }
}

impl LinearScan {
    /// Prepares the primitives.
    pub fn new(geometry: &Geometry) -> Self {
        let Polygons {
            vertices,
            polygons,
            owner,
        } = polygons(geometry);
        let (low, high) = vertices.iter().fold(
            ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]),
            |(low, high), p| {
                (
                    [0, 1, 2].map(|k| low[k].min(p[k])),
                    [0, 1, 2].map(|k| high[k].max(p[k])),
                )
            },
        );
        let (center, radius) = if vertices.is_empty() {
            ([0.0; 3], 0.0)
        } else {
            let half = [0, 1, 2].map(|k| 0.5 * high[k] - 0.5 * low[k]);
            ([0, 1, 2].map(|k| low[k] + half[k]), half.iter().sum())
        };
        let walls = closed(&on_hull(&polygons, &vertices, geometry, &[]), &polygons);
        let wall_ids = ids(&walls, &polygons);
        // A segment between two points on one side of a plane does not cross the plane.
        let outer = geometry
            .segment_ends
            .as_ref()
            .map_or_else(HashSet::new, |ends| {
                ids(&on_hull(&polygons, &vertices, geometry, ends), &polygons)
            });
        let beside = |left_out: &HashSet<u32>| {
            let kept = polygons
                .iter()
                .filter(|polygon| !left_out.contains(&polygon.id));
            FaceSet::new(&vertices, kept)
        };
        let wall = |wall: &HullPolygon| {
            let Polygon {
                corners,
                normal,
                id,
            } = &polygons[wall.index];
            Wall {
                outward: if wall.inward {
                    normal.map(|x| -x)
                } else {
                    *normal
                },
                anchor: vertices[corners[0] as usize],
                id: *id,
            }
        };
        Self {
            all: beside(&HashSet::new()),
            walls: walls.iter().map(wall).collect(),
            inner: beside(&wall_ids),
            crossed: beside(&outer),
            crossable: owner.iter().map(|owner| !outer.contains(owner)).collect(),
            owner,
            triangles: geometry.triangles.clone(),
            spheres: geometry.spheres.clone(),
            center,
            radius,
            slack: SLACK * center.iter().fold(radius, |sum, x| sum + x.abs()),
        }
    }

    /// The ids under which hits on these primitives are reported.
    #[inline(always)]
    fn reported(&self, ids: U32s) -> U32s {
        if self.owner.is_empty() {
            return ids;
        }
        let triangle = ids.lt(U32s::splat(self.owner.len() as u32));
        triangle.select_u32(gather_u32(&self.owner, ids), ids)
    }

    #[inline(always)]
    fn load(&self, rays: &RayBatch<'_>, at: usize) -> Rays {
        let vector = |columns: [&[f32]; 3]| {
            Vec3s::new(
                load(columns[0], at),
                load(columns[1], at),
                load(columns[2], at),
            )
        };
        let origin = vector(rays.origin);
        let away = (origin - Vec3s::splat(self.center)).abs();
        // The sum of absolute values is at least the distance.
        let away = away.x + away.y + away.z;
        let reach = away + F32s::splat(2.0 * self.radius);
        Rays {
            origin,
            direction: vector(rays.direction),
            skip: self.reported(load_u32(rays.skip, at)),
            active: Mask::first(rays.len - at),
            near_plane: reach * F32s::splat(GRAZING),
            distant: away.gt(F32s::splat(REACH * self.radius)),
        }
    }

    /// Distance to the plane of a face as a fraction with denominator ≥ 0.
    #[inline(always)]
    fn plane(face: &Face, rays: &Rays) -> (F32s, F32s) {
        let normal = Vec3s::splat(face.normal);
        let numerator = normal.dot(Vec3s::splat(face.anchor) - rays.origin);
        let denominator = normal.dot(rays.direction);
        let sign = to_bits(denominator) & U32s::splat(1 << 31);
        (from_bits(to_bits(numerator) ^ sign), denominator.abs())
    }

    /// Lanes nearly within the plane of a face.
    #[inline(always)]
    fn grazing(rays: &Rays, numerator: F32s, denominator: F32s) -> Mask {
        let grazing = denominator.lt(F32s::splat(GRAZING));
        if grazing.any() {
            grazing & numerator.abs().lt(rays.near_plane)
        } else {
            Mask::NONE
        }
    }

    fn closest_with<T: Inside>(
        &self,
        scratch: &mut T,
        rays: &RayBatch<'_>,
        hits: &mut HitBatch<'_>,
    ) {
        for at in (0..rays.len).step_by(LANES) {
            let group = self.load(rays, at);
            let (mut nearest, set) = match self.nearest_wall(&group) {
                Some(wall) => (wall, &self.inner),
                None => (Nearest::none(), &self.all),
            };
            if !set.faces.is_empty() {
                nearest = self.nearest_face(scratch, set, &group, nearest);
            }
            nearest = self.nearest_sphere(&group, nearest);
            store(hits.t, at, nearest.numerator / nearest.denominator);
            store_u32(hits.primitive, at, nearest.id);
        }
    }

    /// The wall through which each ray leaves the shell; `None` if there is no shell, or if not all of the
    /// rays start inside of it.
    #[inline(always)]
    fn nearest_wall(&self, group: &Rays) -> Option<Nearest> {
        if self.walls.is_empty() {
            return None;
        }
        let zero = F32s::splat(0.0);
        let bounced = !Compare::eq(group.skip, U32s::splat(PrimitiveId::NONE));
        let mut nearest = Nearest::none();
        let mut outside = Mask::NONE;
        for wall in &self.walls {
            let outward = Vec3s::splat(wall.outward);
            let numerator = outward.dot(Vec3s::splat(wall.anchor) - group.origin);
            let denominator = outward.dot(group.direction);
            let leaving = denominator.gt(zero);
            let own = Compare::eq(group.skip, U32s::splat(wall.id));
            // On the plane itself, a ray that runs inward is inside. Near an edge, rounding puts a point
            // of one wall beyond the other now and then: it is on that one. A ray through its own wall
            // is outside. Said so that NaN is outside.
            let inside = numerator.gt(zero) | (numerator.ge(zero) & !leaving);
            let rounded = bounced & !own & numerator.ge(F32s::splat(-self.slack));
            outside = outside | !(inside | rounded);
            let numerator = numerator.fast_max(F32s::splat(f32::MIN_POSITIVE));
            let nearer = leaving
                & !own
                & (numerator * nearest.denominator).lt(nearest.numerator * denominator);
            nearest = Nearest {
                numerator: nearer.select(numerator, nearest.numerator),
                denominator: nearer.select(denominator, nearest.denominator),
                id: nearer.select_u32(U32s::splat(wall.id), nearest.id),
            };
        }
        (outside & group.active).none().then_some(nearest)
    }

    #[inline(always)]
    fn nearest_face<T: Inside>(
        &self,
        scratch: &mut T,
        set: &FaceSet,
        group: &Rays,
        mut nearest: Nearest,
    ) -> Nearest {
        scratch.project(set, group);
        let mut uncertain = group.distant;
        for face in &set.faces {
            let (inside, zero) = scratch.inside(set, face, group);
            let (numerator, denominator) = Self::plane(face, group);
            let other = !Compare::eq(group.skip, U32s::splat(face.id));
            let candidate = inside & other & numerator.gt(F32s::splat(0.0));
            let grazing = Self::grazing(group, numerator, denominator) & other;
            // A denominator of zero is never nearer. The mask is folded into it, and the sign dropped from
            // what may be negative beside it, to keep all but a product and a comparison off the chain
            // that runs from face to face.
            let numerator = numerator.abs();
            let denominator = candidate.select(denominator, F32s::splat(0.0));
            let nearer = (numerator * nearest.denominator).lt(nearest.numerator * denominator);
            uncertain = uncertain | (zero & nearer) | grazing;
            nearest = Nearest {
                numerator: nearer.select(numerator, nearest.numerator),
                denominator: nearer.select(denominator, nearest.denominator),
                id: nearer.select_u32(U32s::splat(face.id), nearest.id),
            };
        }
        let uncertain = uncertain & group.active;
        if uncertain.any() {
            self.rescan(*group, uncertain, nearest)
        } else {
            nearest
        }
    }

    /// The triangles again, one ray at a time, for the lanes of `mask`. Takes copies, so that the loop
    /// before it keeps its own in registers.
    #[cold]
    #[inline(never)]
    fn rescan(&self, group: Rays, mask: Mask, nearest: Nearest) -> Nearest {
        let mut numerator = nearest.numerator.to_array();
        let mut denominator = nearest.denominator.to_array();
        let mut id = nearest.id.to_array();
        for lane in mask.lanes() {
            let ray = ShearRay::new(extract(group.origin, lane), extract(group.direction, lane));
            let (t, hit) = self.scan_triangles(&ray, group.skip.to_array()[lane]);
            (numerator[lane], denominator[lane]) = if hit == PrimitiveId::NONE {
                (1.0, 0.0)
            } else {
                (t, 1.0)
            };
            id[lane] = hit;
        }
        Nearest {
            numerator: F32s::from(numerator),
            denominator: F32s::from(denominator),
            id: U32s::from(id),
        }
    }

    /// Nearest triangle of one ray by Woop's test.
    fn scan_triangles(&self, ray: &ShearRay, skip: u32) -> (f32, u32) {
        let mut nearest = (f32::INFINITY, PrimitiveId::NONE);
        for ((id, triangle), &owner) in (0u32..).zip(&self.triangles).zip(&self.owner) {
            if let Some(t) = ray.intersect(triangle)
                && t < nearest.0
                && owner != skip
            {
                nearest = (t, id);
            }
        }
        nearest
    }

    #[inline(always)]
    fn sphere(sphere: &Sphere, id: u32, rays: &Rays) -> F32s {
        let leaving = Compare::eq(rays.skip, U32s::splat(id));
        sphere_distance(
            Vec3s::splat(sphere.center),
            F32s::splat(sphere.radius),
            rays.origin,
            rays.direction,
            leaving,
        )
    }

    #[inline(always)]
    fn nearest_sphere(&self, group: &Rays, mut nearest: Nearest) -> Nearest {
        for (id, sphere) in (self.triangles.len() as u32..).zip(&self.spheres) {
            let t = Self::sphere(sphere, id, group);
            let nearer =
                (t * nearest.denominator).lt(nearest.numerator) & t.lt(F32s::splat(f32::INFINITY));
            nearest = Nearest {
                numerator: nearer.select(t, nearest.numerator),
                denominator: nearer.select(F32s::splat(1.0), nearest.denominator),
                id: nearer.select_u32(U32s::splat(id), nearest.id),
            };
        }
        nearest
    }

    fn occluded_with<T: Inside>(
        &self,
        scratch: &mut T,
        shadow: &ShadowBatch<'_>,
        occluded: &mut [u32],
    ) {
        for at in (0..shadow.rays.len).step_by(LANES) {
            let group = self.load(&shadow.rays, at);
            let t_max = load(shadow.t_max, at);
            let target = self.reported(load_u32(shadow.target, at));
            let mut blocked = !group.active;
            self.spheres_between(&group, t_max, target, &mut blocked);
            if blocked != Mask::ALL && !self.crossed.faces.is_empty() {
                scratch.project(&self.crossed, &group);
                self.faces_between(scratch, &group, t_max, target, &mut blocked);
            }
            store_u32(
                occluded,
                at,
                blocked.select_u32(U32s::splat(1), U32s::splat(0)),
            );
        }
    }

    #[inline(always)]
    fn spheres_between(&self, group: &Rays, t_max: F32s, target: U32s, blocked: &mut Mask) {
        for (id, sphere) in (self.triangles.len() as u32..).zip(&self.spheres) {
            let t = Self::sphere(sphere, id, group);
            *blocked = *blocked | (t.lt(t_max) & !Compare::eq(target, U32s::splat(id)));
        }
    }

    #[inline(always)]
    fn faces_between<T: Inside>(
        &self,
        scratch: &T,
        group: &Rays,
        t_max: F32s,
        target: U32s,
        blocked: &mut Mask,
    ) {
        // The first face that decides a ray or casts doubt on it settles it, so that the answer does not
        // depend on when the other rays of the group allow to stop.
        let mut uncertain = group.distant & !*blocked;
        for face in &self.crossed.faces {
            let (inside, zero) = scratch.inside(&self.crossed, face, group);
            let (numerator, denominator) = Self::plane(face, group);
            let id = U32s::splat(face.id);
            let open =
                !Compare::eq(group.skip, id) & !Compare::eq(target, id) & !uncertain & !*blocked;
            let between =
                inside & open & numerator.gt(F32s::splat(0.0)) & numerator.lt(t_max * denominator);
            let doubtful = (zero & between) | (Self::grazing(group, numerator, denominator) & open);
            uncertain = uncertain | doubtful;
            *blocked = *blocked | (between & !doubtful);
            if uncertain | *blocked == Mask::ALL {
                break;
            }
        }
        for lane in uncertain.lanes() {
            let ray = ShearRay::new(extract(group.origin, lane), extract(group.direction, lane));
            let (skip, target) = (group.skip.to_array()[lane], target.to_array()[lane]);
            let t_max = t_max.to_array()[lane];
            let between = self
                .triangles
                .iter()
                .zip(&self.owner)
                .zip(&self.crossable)
                .any(|((triangle, &owner), &crossable)| {
                    crossable
                        && owner != skip
                        && owner != target
                        && ray.intersect(triangle).is_some_and(|t| t < t_max)
                });
            if between {
                *blocked = *blocked | Mask(1 << lane);
            }
        }
    }

    fn count(&self, rays: usize, set: &FaceSet, counters: &mut AccelCounters) {
        counters.tests += (rays * (set.faces.len() + self.spheres.len())) as u64;
    }
}

impl Accel for LinearScan {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn bytes(&self) -> usize {
        self.all.bytes()
            + self.inner.bytes()
            + self.crossed.bytes()
            + std::mem::size_of_val(&*self.walls)
            + std::mem::size_of_val(&*self.crossable)
            + std::mem::size_of_val(&*self.owner)
            + std::mem::size_of_val(&*self.triangles)
            + std::mem::size_of_val(&*self.spheres)
    }

    fn closest(&self, rays: RayBatch<'_>, mut hits: HitBatch<'_>, counters: &mut AccelCounters) {
        self.count(rays.len, &self.all, counters);
        if self.all.fits(SMALL) {
            self.closest_with(
                &mut Scratch::<{ SMALL.0 }, { SMALL.1 }>::new(),
                &rays,
                &mut hits,
            );
        } else if self.all.fits(LARGE) {
            self.closest_with(
                &mut Scratch::<{ LARGE.0 }, { LARGE.1 }>::new(),
                &rays,
                &mut hits,
            );
        } else {
            self.closest_with(&mut Unshared(None), &rays, &mut hits);
        }
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], counters: &mut AccelCounters) {
        self.count(rays.rays.len, &self.crossed, counters);
        if self.crossed.fits(SMALL) {
            self.occluded_with(
                &mut Scratch::<{ SMALL.0 }, { SMALL.1 }>::new(),
                &rays,
                occluded,
            );
        } else if self.crossed.fits(LARGE) {
            self.occluded_with(
                &mut Scratch::<{ LARGE.0 }, { LARGE.1 }>::new(),
                &rays,
                occluded,
            );
        } else {
            self.occluded_with(&mut Unshared(None), &rays, occluded);
        }
    }
}

fn extract(v: Vec3s, lane: usize) -> [f32; 3] {
    [
        v.x.to_array()[lane],
        v.y.to_array()[lane],
        v.z.to_array()[lane],
    ]
}
