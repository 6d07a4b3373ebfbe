//! Which instance of each stage a scene runs: stages are compiled for a few sets of features, and
//! the leanest set that covers the scene is taken.

use super::{
    connect::connect, connect_transparent::connect_transparent, generate::generate,
    intersect::intersect, record_aux::record_aux, roulette::roulette, shade::shade,
    shade_emission::shade_emission, shade_escaped::shade_escaped, sort::sort,
};
use crate::compile::{CompiledScene, Features, WorkItem};
use crate::material::{Dielectric, Glossy, Lambertian, MaterialKind, Mirror, OrenNayar, Phong};
use crate::wave::{MATERIAL_KINDS, Wave, material_feature};

type Stage = fn(&CompiledScene, &mut Wave);
type ItemStage = fn(&CompiledScene, &WorkItem, &mut Wave);

/// The stages of a render, in the order of the driver loop; what is absent is `None`.
#[derive(Debug, Clone, Copy)]
pub struct Kernels {
    /// Name of the instance.
    pub name: &'static str,
    /// Features that the instance was compiled for.
    pub features: Features,
    /// work item → rays.
    pub generate: ItemStage,
    /// rays → hits.
    pub intersect: Stage,
    /// camera hits → auxiliary sums.
    pub record_aux: Option<ItemStage>,
    /// hits → queues.
    pub sort: Stage,
    /// escaped rays → radiance.
    pub shade_escaped: Option<Stage>,
    /// emitter hits → radiance.
    pub shade_emission: Option<Stage>,
    /// material queues → shadow rays, next rays.
    pub shade: [Option<ItemStage>; MATERIAL_KINDS],
    /// shadow rays → radiance.
    pub connect: Option<Stage>,
    /// next rays → rays.
    pub roulette: Stage,
}

/// Features that change the code of a stage; the others decide whether a stage runs at all.
const IN_CODE: Features = Features::TRIANGLES
    .with(Features::SPHERES)
    .with(Features::LIGHT_FLAT)
    .with(Features::LIGHT_SPHERE)
    .with(Features::LIGHT_POINT)
    .with(Features::BACKGROUND)
    .with(Features::MANY_LIGHTS)
    .with(Features::DIELECTRIC)
    .with(Features::MESH_NORMALS)
    .with(Features::TEXTURES)
    .with(Features::OPACITY)
    .with(Features::SHADOW_RAYS)
    .with(Features::MIS)
    .with(Features::STRATIFIED)
    .with(Features::WHITTED)
    .with(Features::TRANSPARENT_SHADOWS)
    .with(Features::SHADOW_BIAS);

/// Path tracing of triangles lit by flat lights, without glass.
const TRIANGLES: u32 = Features::TRIANGLES
    .with(Features::LIGHT_FLAT)
    .with(Features::SHADOW_RAYS)
    .with(Features::MIS)
    .0;
/// The same with spheres and glass.
const ROOM: u32 = Features(TRIANGLES)
    .with(Features::SPHERES)
    .with(Features::DIELECTRIC)
    .0;
/// What the attributes of meshes and the maps of materials add to a hit.
const APPEARANCE: Features = Features::MESH_NORMALS
    .with(Features::TEXTURES)
    .with(Features::OPACITY);
/// Everything else: 2 % of the time of the hexagonal room with strata, which would do without.
const BARE: u32 = IN_CODE.0 & !APPEARANCE.0;
/// Everything.
const FULL: u32 = IN_CODE.0;

impl Kernels {
    /// The leanest instance that covers `features`, or the one that covers everything.
    pub fn choose(features: Features, force_full: bool) -> Self {
        let needed = Features(features.0 & IN_CODE.0);
        if !force_full && Features(TRIANGLES).contains(needed) {
            Self::instance::<TRIANGLES>("triangles", features)
        } else if !force_full && Features(ROOM).contains(needed) {
            Self::instance::<ROOM>("triangles, spheres and glass", features)
        } else if !force_full && Features(BARE).contains(needed) {
            Self::instance::<BARE>(
                "everything but smooth normals, textures and opacity",
                features,
            )
        } else {
            Self::instance::<FULL>("everything", features)
        }
    }

    fn instance<const F: u32>(name: &'static str, features: Features) -> Self {
        let when = |needs: Features, stage: Stage| features.intersects(needs).then_some(stage);
        Self {
            name,
            features: Features(F),
            generate: generate::<F>,
            intersect,
            record_aux: features.contains(Features::AUX).then_some(record_aux::<F>),
            sort,
            shade_escaped: when(Features::BACKGROUND, shade_escaped::<F>),
            shade_emission: when(
                Features::LIGHT_FLAT | Features::LIGHT_SPHERE,
                shade_emission::<F>,
            ),
            shade: std::array::from_fn(|kind| {
                let stage: ItemStage = match MaterialKind::ALL[kind] {
                    MaterialKind::Black => return None,
                    MaterialKind::Lambertian => shade::<Lambertian, F>,
                    MaterialKind::OrenNayar => shade::<OrenNayar, F>,
                    MaterialKind::Mirror => shade::<Mirror, F>,
                    MaterialKind::Dielectric => shade::<Dielectric, F>,
                    MaterialKind::Phong => shade::<Phong, F>,
                    MaterialKind::Glossy => shade::<Glossy, F>,
                };
                features.contains(material_feature(kind)).then_some(stage)
            }),
            connect: if features.contains(Features::TRANSPARENT_SHADOWS) {
                when(Features::SHADOW_RAYS, connect_transparent::<F>)
            } else {
                when(Features::SHADOW_RAYS, connect)
            },
            roulette: roulette::<F>,
        }
    }
}
