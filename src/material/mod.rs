//! Materials: how surfaces scatter, one file per material, as kernels on lanes of hits.
//!
//! All directions are in the local frame of the hit, of unit length, and point away from the
//! surface; z is the shading normal. Reflecting materials see `wo.z > 0` (the frame is turned to
//! the side of the ray). A dielectric sees z along the outward normal, so `wo.z < 0` says that the
//! ray comes from inside. Densities are per steradian. Lanes that hold no hit may hold anything,
//! NaN included; their results mean nothing.

mod black;
mod dielectric;
mod glossy;
mod lambertian;
mod mirror;
mod oren_nayar;
mod phong;
#[cfg(test)]
mod tests;

pub use black::Black;
pub use dielectric::{Dielectric, DielectricBranches, DielectricParams, FresnelFormula};
pub use glossy::{Glossy, GlossyParams};
pub use lambertian::{Lambertian, LambertianParams};
pub use mirror::{Mirror, MirrorParams};
pub use oren_nayar::{OrenNayar, OrenNayarParams};
pub use phong::{Phong, PhongParams};

use crate::math::{F32s, Mask, Table, U32s, Vec3s};

/// A scattered direction per lane.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Where the path goes on, of unit length.
    pub wi: Vec3s,
    /// f·|cos wi| / pdf, RGB; of a delta lobe, its share over the probability of choosing it.
    pub weight: Vec3s,
    /// Density of `wi`; 0 for delta lobes.
    pub pdf: F32s,
    /// n_t/n_i where the ray was refracted, else 1. A refracted `weight` contains 1/η².
    pub eta: F32s,
    /// Where a direction was found; elsewhere the path is absorbed.
    pub valid: Mask,
}

/// The lane kernels of a material.
pub trait Material {
    /// All lobes are deltas (or none exist): there is nothing to evaluate and no light to sample.
    const SPECULAR: bool;
    /// Light passes: `wo` and `wi` may lie on either side, and z is the outward normal.
    const TRANSMISSIVE: bool = false;
    /// Which kind it is.
    const KIND: MaterialKind;
    /// Parameters of a lane group of hits.
    type Params: Copy;

    /// The parameters of the hits' materials, which must all be of this kind.
    fn fetch(table: &MaterialTable, material: U32s) -> Self::Params;

    /// Multiplies the (diffuse) reflectance by a texture's colour, linear RGB in [0, 1]. What has no
    /// reflectance stays as it is.
    #[inline(always)]
    fn tint(_params: &mut Self::Params, _by: Vec3s) {}

    /// (f·|cos wi|, density with which [`Self::sample`] finds wi). Both are 0 where wi lies below the
    /// surface, and for delta lobes.
    fn eval(params: &Self::Params, wo: Vec3s, wi: Vec3s) -> (Vec3s, F32s);

    /// A direction from three uniform numbers in [0, 1): the first two for the direction within a
    /// lobe, the third for the choice of the lobe.
    fn sample(params: &Self::Params, wo: Vec3s, u: [F32s; 3]) -> BsdfSample;

    /// n_t/n_i for light that goes straight through the boundary, as if it met no surface: it must not
    /// come out of a body brighter than it went in.
    #[inline(always)]
    fn straight_eta(_params: &Self::Params, _wo: Vec3s) -> F32s {
        F32s::splat(1.0)
    }

    /// Both directions that light goes on in, for materials that split it in two.
    #[inline(always)]
    fn split(_params: &Self::Params, _wo: Vec3s) -> Option<[BsdfSample; 2]> {
        None
    }
}

/// The kinds of materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MaterialKind {
    /// [`Black`].
    Black,
    /// [`Lambertian`].
    Lambertian,
    /// [`OrenNayar`].
    OrenNayar,
    /// [`Mirror`].
    Mirror,
    /// [`Dielectric`].
    Dielectric,
    /// [`Phong`].
    Phong,
    /// [`Glossy`].
    Glossy,
}

impl MaterialKind {
    /// Every kind.
    pub const ALL: [Self; 7] = [
        Self::Black,
        Self::Lambertian,
        Self::OrenNayar,
        Self::Mirror,
        Self::Dielectric,
        Self::Phong,
        Self::Glossy,
    ];

    /// Number of kinds.
    pub const COUNT: usize = Self::ALL.len();

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::Lambertian => "Lambertian",
            Self::OrenNayar => "Oren–Nayar",
            Self::Mirror => "mirror",
            Self::Dielectric => "dielectric",
            Self::Phong => "Phong",
            Self::Glossy => "glossy",
        }
    }

    /// [`Material::SPECULAR`] of the kind.
    pub const fn is_specular(self) -> bool {
        match self {
            Self::Black => Black::SPECULAR,
            Self::Lambertian => Lambertian::SPECULAR,
            Self::OrenNayar => OrenNayar::SPECULAR,
            Self::Mirror => Mirror::SPECULAR,
            Self::Dielectric => Dielectric::SPECULAR,
            Self::Phong => Phong::SPECULAR,
            Self::Glossy => Glossy::SPECULAR,
        }
    }
}

/// A material as it is put into the table. Reflectances are linear RGB in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MaterialSpec {
    /// Absorbs everything.
    Black,
    /// See [`Lambertian`].
    Lambertian {
        /// Albedo.
        reflectance: [f32; 3],
    },
    /// See [`OrenNayar`].
    OrenNayar {
        /// Albedo of the facets.
        reflectance: [f32; 3],
        /// Spread of the facets' slopes in radians, in [0, ∞].
        sigma: f64,
    },
    /// See [`Mirror`].
    Mirror {
        /// Reflected share.
        reflectance: [f32; 3],
    },
    /// See [`Dielectric`].
    Dielectric {
        /// Index of refraction inside over outside, > 0.
        ior: f32,
        /// Formula of the reflectance.
        fresnel: FresnelFormula,
    },
    /// See [`Phong`].
    Phong {
        /// Weight of the lobe.
        reflectance: [f32; 3],
        /// n, in [0, 1e6].
        exponent: f32,
    },
    /// See [`Glossy`].
    Glossy {
        /// Albedo of the diffuse part; `diffuse` + `specular` ≤ 1.
        diffuse: [f32; 3],
        /// Weight of the lobe.
        specular: [f32; 3],
        /// n, in [0, 1e6].
        exponent: f32,
    },
}

impl MaterialSpec {
    /// Which kernels it needs.
    pub const fn kind(&self) -> MaterialKind {
        match self {
            Self::Black => MaterialKind::Black,
            Self::Lambertian { .. } => MaterialKind::Lambertian,
            Self::OrenNayar { .. } => MaterialKind::OrenNayar,
            Self::Mirror { .. } => MaterialKind::Mirror,
            Self::Dielectric { .. } => MaterialKind::Dielectric,
            Self::Phong { .. } => MaterialKind::Phong,
            Self::Glossy { .. } => MaterialKind::Glossy,
        }
    }
}

/// The parameters of all materials of a scene, in columns indexed by material.
#[derive(Debug, Clone, Default)]
pub struct MaterialTable {
    kinds: Vec<MaterialKind>,
    /// RGB.
    reflectance: [Table<f32>; 3],
    /// RGB of a second lobe, up to the last material that has one.
    specular: [Table<f32>; 3],
    /// Two numbers whose meaning the kind decides; each material's file says which.
    parameters: [Table<f32>; 2],
}

impl MaterialTable {
    /// Adds a material and returns its index.
    ///
    /// # Panics
    /// If there are more than 2³² materials.
    pub fn push(&mut self, spec: MaterialSpec) -> u32 {
        let (reflectance, parameters) = match spec {
            MaterialSpec::Black => ([0.0; 3], [0.0; 2]),
            MaterialSpec::Lambertian { reflectance } | MaterialSpec::Mirror { reflectance } => {
                (reflectance, [0.0; 2])
            }
            MaterialSpec::OrenNayar { reflectance, sigma } => {
                (reflectance, oren_nayar::parameters(sigma))
            }
            MaterialSpec::Dielectric { ior, fresnel } => {
                ([1.0; 3], dielectric::parameters(ior, fresnel))
            }
            MaterialSpec::Phong {
                reflectance,
                exponent,
            } => (reflectance, [exponent, 0.0]),
            MaterialSpec::Glossy {
                diffuse,
                specular,
                exponent,
            } => {
                for (column, value) in self.specular.iter_mut().zip(specular) {
                    (column.len()..self.kinds.len()).for_each(|_| column.push(0.0));
                    column.push(value);
                }
                (diffuse, [exponent, 0.0])
            }
        };
        let index = u32::try_from(self.kinds.len()).expect("materials are counted in 32 bits");
        self.kinds.push(spec.kind());
        for (column, value) in self.reflectance.iter_mut().zip(reflectance) {
            column.push(value);
        }
        for (column, value) in self.parameters.iter_mut().zip(parameters) {
            column.push(value);
        }
        index
    }

    /// Number of materials.
    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// The kind of each material.
    pub fn kinds(&self) -> &[MaterialKind] {
        &self.kinds
    }

    /// Bytes held by the columns.
    pub fn bytes(&self) -> usize {
        self.len() * (size_of::<MaterialKind>() + 5 * size_of::<f32>())
            + 3 * self.specular[0].len() * size_of::<f32>()
    }

    /// Weight of the second lobe per lane; some material must have one.
    #[inline(always)]
    fn specular(&self, material: U32s) -> Vec3s {
        let [r, g, b] = &self.specular;
        Vec3s::new(r.get(material), g.get(material), b.get(material))
    }

    /// Reflectance parameter per lane, whatever the kind: 0 for black, 1 for a dielectric.
    #[inline(always)]
    pub fn reflectance(&self, material: U32s) -> Vec3s {
        let [r, g, b] = &self.reflectance;
        Vec3s::new(r.get(material), g.get(material), b.get(material))
    }

    /// The two kind-specific numbers per lane.
    #[inline(always)]
    fn parameters(&self, material: U32s) -> [F32s; 2] {
        [
            self.parameters[0].get(material),
            self.parameters[1].get(material),
        ]
    }
}
