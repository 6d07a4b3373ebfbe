//! What a scene and its settings need: the set from which everything else is left out.

use std::fmt;
use std::ops::{BitOr, BitOrAssign};

use crate::light::kinds;

/// A set of needed features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Features(pub u32);

impl Features {
    /// Emissive triangles or parallelograms.
    pub const LIGHT_FLAT: Self = Self(kinds::FLAT);
    /// Emissive spheres.
    pub const LIGHT_SPHERE: Self = Self(kinds::SPHERE);
    /// Point lights.
    pub const LIGHT_POINT: Self = Self(kinds::POINT);
    /// Background of constant radiance.
    pub const BACKGROUND: Self = Self(kinds::BACKGROUND);
    /// More than one light: one has to be chosen.
    pub const MANY_LIGHTS: Self = Self(kinds::MANY);
    /// Triangles.
    pub const TRIANGLES: Self = Self(1 << 8);
    /// Spheres.
    pub const SPHERES: Self = Self(1 << 9);
    /// Lambertian surfaces.
    pub const LAMBERTIAN: Self = Self(1 << 10);
    /// Oren–Nayar surfaces.
    pub const OREN_NAYAR: Self = Self(1 << 11);
    /// Perfect mirrors.
    pub const MIRROR: Self = Self(1 << 12);
    /// Glass.
    pub const DIELECTRIC: Self = Self(1 << 13);
    /// Phong lobes.
    pub const PHONG: Self = Self(1 << 14);
    /// Shadow rays are sent.
    pub const SHADOW_RAYS: Self = Self(1 << 15);
    /// Light and direction sampling are weighted against each other.
    pub const MIS: Self = Self(1 << 16);
    /// Jittered strata.
    pub const STRATIFIED: Self = Self(1 << 17);
    /// Whitted's light transport.
    pub const WHITTED: Self = Self(1 << 18);
    /// Shadow rays pass through glass.
    pub const TRANSPARENT_SHADOWS: Self = Self(1 << 19);
    /// Albedo, normal and depth images.
    pub const AUX: Self = Self(1 << 20);
    /// Diffuse surfaces with a Phong lobe.
    pub const GLOSSY: Self = Self(1 << 21);
    /// Interpolated shading normals.
    pub const MESH_NORMALS: Self = Self(1 << 22);
    /// Textures.
    pub const TEXTURES: Self = Self(1 << 23);
    /// Surfaces that let part of the light go straight on.
    pub const OPACITY: Self = Self(1 << 24);

    /// Secondary rays start off their surface by a fixed bias.
    pub const SHADOW_BIAS: Self = Self(1 << 28);

    /// What a scene can have, as opposed to what settings ask for.
    pub const SCENE: Self = Self(kinds::ALL)
        .with(Self::TRIANGLES)
        .with(Self::SPHERES)
        .with(Self::LAMBERTIAN)
        .with(Self::OREN_NAYAR)
        .with(Self::MIRROR)
        .with(Self::DIELECTRIC)
        .with(Self::PHONG)
        .with(Self::GLOSSY)
        .with(Self::MESH_NORMALS)
        .with(Self::TEXTURES)
        .with(Self::OPACITY);

    const NAMES: [(Self, &'static str); 23] = [
        (Self::TRIANGLES, "triangles"),
        (Self::SPHERES, "spheres"),
        (Self::LAMBERTIAN, "Lambertian surfaces"),
        (Self::OREN_NAYAR, "Oren–Nayar surfaces"),
        (Self::MIRROR, "mirrors"),
        (Self::DIELECTRIC, "glass"),
        (Self::PHONG, "Phong surfaces"),
        (Self::GLOSSY, "glossy surfaces"),
        (Self::MESH_NORMALS, "smooth normals"),
        (Self::TEXTURES, "textures"),
        (Self::OPACITY, "opacity"),
        (Self::LIGHT_FLAT, "flat lights"),
        (Self::LIGHT_SPHERE, "sphere lights"),
        (Self::LIGHT_POINT, "point lights"),
        (Self::BACKGROUND, "background"),
        (Self::MANY_LIGHTS, "choice of a light"),
        (Self::SHADOW_RAYS, "shadow rays"),
        (Self::MIS, "multiple importance sampling"),
        (Self::STRATIFIED, "stratified sampling"),
        (Self::WHITTED, "Whitted's transport"),
        (Self::TRANSPARENT_SHADOWS, "transparent shadows"),
        (Self::AUX, "auxiliary images"),
        (Self::SHADOW_BIAS, "shadow bias"),
    ];

    /// Every feature (also: always needed).
    pub const fn all() -> Self {
        Self(u32::MAX)
    }

    /// The union, in constants.
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether all of `other` is in the set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether some of `other` is in the set.
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether what needs one of `needs` is needed; what needs [`Self::all`] always is, also by a
    /// scene that needs nothing.
    pub const fn require(self, needs: Self) -> bool {
        needs.0 == u32::MAX || self.intersects(needs)
    }

    /// Names of the members.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .iter()
            .filter(move |(bit, _)| self.contains(*bit))
            .map(|(_, name)| *name)
    }

    /// Names of what is not in the set.
    pub fn absent(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .iter()
            .filter(move |(bit, _)| !self.contains(*bit))
            .map(|(_, name)| *name)
    }
}

impl BitOr for Features {
    type Output = Self;
    fn bitor(self, rhs: Self) -> Self {
        self.with(rhs)
    }
}

impl BitOrAssign for Features {
    fn bitor_assign(&mut self, rhs: Self) {
        *self = self.with(rhs);
    }
}

impl fmt::Display for Features {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.names().collect::<Vec<_>>().join(", "))
    }
}
